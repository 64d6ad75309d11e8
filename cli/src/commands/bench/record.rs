//! `sinew bench record`: a live robot and a camera of 5 MB/s beside it, once alone and once recorded by `sinew record`: the
//! recorder's share of a core, the samples that it lost, and the lateness of every node in both runs.

use super::machine::Before;
use super::report::{Report, Target, Value};
use super::scratch::Scratch;
use super::witness::Testimony;
use crate::exit::Failure;
use crate::load::{self, Changes};
use messages::{Encoding, Image, Message, NodeStatistics, bytemuck};
use runtime::channel::{Claim, Geometry, SampleBuffer, Tree};
use runtime::robot::{NodeSpec, Robot};
use runtime::{NodeType, clock};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Rows and columns of the camera's pictures, a byte per pixel: 250 kB.
const SIDE_PX: usize = 500;
/// Pictures per second: 5 MB/s.
const PICTURES_HZ: f64 = 20.0;
/// Name of the robot.
const NAME: &str = "recorded";
/// Time for everything that follows a start to be over [s].
const SETTLE_S: f64 = 2.0;

/// Ends a process that is still there.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs the robot in `file` twice for `seconds`.
pub fn run(file: Option<&Path>, seconds: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let robot = load::robot(file, &Changes::default(), types)?;
    let scratch = Scratch::new()?;
    let before = Before::now();
    let (alone, _) = one_run(file, &robot, &scratch, seconds, None)?;
    let output = std::env::temp_dir().join(format!("sinew-bench-{}.mcap", std::process::id()));
    let recorded = one_run(file, &robot, &scratch, seconds, Some(&output));
    let _ = std::fs::remove_file(&output);
    let (beside, told) = recorded?;
    let told = told.ok_or("the recorder said nothing")?;
    let number = |key: &str| told[key].as_f64().unwrap_or(f64::NAN);
    let duration_s = number("duration_s");
    let (percent, lost) = (number("cpu_s") / duration_s * 100.0, number("lost"));
    let rate = number("bytes") * 1e-6 / duration_s;
    let mut values = vec![
        Value::new("recorder_cpu", percent, "% of a core"),
        Value::new("recorder_lost", lost, "samples"),
        Value::new("recorder_samples", number("samples"), "samples"),
        Value::new("recorder_file", rate, "MB/s"),
    ];
    let mut worst: f64 = 0.0;
    for ((path, alone), (_, beside)) in alone.iter().zip(&beside) {
        let us = |statistics: &NodeStatistics| statistics.lateness_s[1] * 1e6;
        values.push(Value::new(format!("lateness_p99_alone {path}"), us(alone), "µs"));
        values.push(Value::new(format!("lateness_p99_recorded {path}"), us(beside), "µs"));
        worst = worst.max(us(beside) / us(alone).max(1.0));
    }
    let targets = vec![
        Target {
            aim: "at most 5 % of a core at 5 MB/s".into(),
            measured: format!("{percent:.1} % over {duration_s:.1} s"),
            reached: percent <= 5.0,
        },
        Target { aim: "no sample lost".into(), measured: format!("{lost} lost"), reached: lost == 0.0 },
        Target {
            aim: "lateness p99 of every node unchanged: less than twice that of the run alone".into(),
            measured: format!("greatest ratio {worst:.2}"),
            reached: worst < 2.0,
        },
    ];
    let note = format!(
        "Two live runs of \"{}\" of {seconds} s, one after the other, each with a writer of {PICTURES_HZ} pictures a second of \
         {SIDE_PX} × {SIDE_PX} bytes of noise beside it. Pictures are written twice, exact and as sensor_msgs/Image, so the file \
         grows twice as fast as the camera. The recorder's time is that of its process by the kernel's ticks. A p99 of a few \
         hundred steps is a rough figure: compare several runs.",
        robot.name
    );
    let scheduling = vec!["the robot file's; the recorder SCHED_OTHER".into()];
    let machine = before.finish(scheduling, &Testimony::default());
    Ok(Report { bench: "record", machine, rows: Vec::new(), values, targets, notes: vec![note] })
}

type Lateness = Vec<(String, NodeStatistics)>;

/// One live run; the nodes' statistics, and what the recorder said.
fn one_run(
    file: Option<&Path>,
    robot: &Robot,
    scratch: &Scratch,
    seconds: f64,
    output: Option<&Path>,
) -> Result<(Lateness, Option<serde_json::Value>), Failure> {
    let length = format!("{}s", seconds + 3.0 * SETTLE_S);
    let command = || -> Result<Command, Failure> {
        let mut command = Command::new(std::env::current_exe()?);
        command.env("SINEW_SHM", scratch.path()).env("SINEW_STATE", scratch.path().join("state"));
        command.stdin(Stdio::null()).stderr(Stdio::null());
        Ok(command)
    };
    let mut running = command()?;
    running.arg("run").args(file).args(["--plain", "--svg", "none", "--name", NAME, "--for", &length]);
    let mut running = Process(running.stdout(Stdio::null()).spawn()?);
    let root = scratch.path().join(NAME);
    let begin_by = clock::now().after_s(20.0);
    while !root.join(".run/launch.json").exists() {
        if clock::now() > begin_by {
            return Err(Failure::from("the robot did not come up within 20 s"));
        }
        clock::sleep_s(0.05);
    }
    clock::sleep_s(SETTLE_S);
    let stop = AtomicBool::new(false);
    let tree = Tree::shared(&root)?;
    let told = std::thread::scope(|scope| -> Result<Option<serde_json::Value>, Failure> {
        let camera = scope.spawn(|| take_pictures(&tree, &stop));
        let told = match output {
            None => {
                clock::sleep_s(seconds);
                Ok(None)
            }
            Some(output) => {
                let mut recorder = command()?;
                recorder.args(["record", NAME, "--json", "--for", &format!("{seconds}s"), "-o"]).arg(output);
                let said = recorder.output()?;
                serde_json::from_slice(&said.stdout).map(Some).map_err(Failure::from)
            }
        };
        stop.store(true, Ordering::Relaxed);
        camera.join().map_err(|_| Failure::from("the camera's thread panicked"))??;
        told
    })?;
    // Statistics come once a second.
    clock::sleep_s(1.2);
    let mut lateness = Vec::new();
    for node in robot.nodes.iter().map(NodeSpec::path) {
        let ring = tree.reader(&format!("{node}/statistics"), None)?;
        let mut buffer = SampleBuffer::new(ring.geometry());
        if ring.read(ring.head(), &mut buffer).is_ok() {
            lateness.push((node, *bytemuck::from_bytes(buffer.fixed())));
        }
    }
    running.0.wait()?;
    Ok((lateness, told))
}

/// Writes pictures of noise until it is told to stop.
fn take_pictures(tree: &Tree, stop: &AtomicBool) -> Result<(), Failure> {
    let schema = Image::schema();
    let geometry = Geometry {
        type_name: Image::NAME.into(),
        layout_hash: schema.hash(),
        schema: schema.to_text(),
        fixed_bytes: size_of::<Image>(),
        tail_element_bytes: 1,
        tail_capacity: SIDE_PX * SIDE_PX,
        depth: 16,
    };
    let mut writer = tree.writer("/drivers/camera/image", &geometry, Claim::Continue)?;
    let side = SIDE_PX as u32;
    let image = Image { height_px: side, width_px: side, step_bytes: side, encoding: Encoding::Mono8 as u32 };
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut pixels = vec![0; SIDE_PX * SIDE_PX];
    let mut next = clock::now();
    while !stop.load(Ordering::Relaxed) {
        for pixel in &mut pixels {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            *pixel = random as u8;
        }
        writer.publish(clock::now().nanos(), bytemuck::bytes_of(&image), &pixels);
        next = next.after_s(1.0 / PICTURES_HZ);
        clock::sleep_until(next);
    }
    Ok(())
}
