//! A small robot on virtual time, and its recording, whole or with something wrong in it.
#![allow(dead_code, reason = "each test file uses its part")]

use std::path::Path;

use messages::{Done, Odometry, Switch, Twist};
use recorder::{Facts, RecordingWriter};
use runtime::calls::{CallState, LocalRequest, Order};
use runtime::channel::{RawSample, ReadError, SampleBuffer};
use runtime::robot::{Resources, Robot};
use runtime::{
    CallPort, Caller, Device, Fault, Keepsake, Layer, Node, NodeType, OpenError, OrderPort, Ports, Reader, Set,
    SimulatedHost, Time, Writer,
};
use schemars::JsonSchema;
use serde::Deserialize;

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// What the sum is multiplied with.
    gain: Option<f64>,
}

/// A driver that adds up the bytes of its device, and can be told to pause. Its successor goes on from its sum.
struct Adder {
    sum: f64,
    paused: bool,
    device: Device,
    pause: CallPort<Switch, Done>,
    count: OrderPort<Switch, Done, Done>,
    counting: Option<(Order<Switch, Done, Done>, u64)>,
    keepsake: Keepsake,
    out: Writer<Twist>,
}

impl Node for Adder {
    const TYPE: &'static str = "adder";
    const LAYER: Layer = Layer::Drivers;
    type Config = Config;

    fn open(ports: &mut Ports, _: Config) -> Result<Self, OpenError> {
        let device = ports.device("simulator")?;
        Ok(Adder {
            sum: 0.0,
            paused: false,
            device,
            pause: ports.call("pause")?,
            count: ports.order("count")?,
            counting: None,
            keepsake: ports.keepsake(),
            out: ports.writer("sum")?,
        })
    }

    fn start(&mut self, _: Time) -> Result<(), Fault> {
        let mut left = [0; Keepsake::MOST_BYTES];
        if let Some(sum) = self.keepsake.kept(&mut left).first_chunk() {
            self.sum = f64::from_le_bytes(*sum);
        }
        Ok(())
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        while let Some(request) = self.pause.take() {
            self.paused = request.message.on != 0;
            match request.message.on {
                2.. => self.pause.refuse(request, "on is 0 or 1"),
                _ => self.pause.answer(request, &Done { at_ns: now.nanos() }),
            }
        }
        while let Some(mut order) = self.count.take() {
            order.accept();
            self.counting = Some((order, 0));
        }
        if let Some((mut order, steps)) = self.counting.take() {
            order.progress(&Done { at_ns: steps });
            match (order.is_cancelled(), steps) {
                (true, _) => order.cancelled(),
                (false, 6) if order.message.on == 3 => order.failed("three is too much"),
                (false, 6) => order.done(&Done { at_ns: now.nanos() }),
                _ => self.counting = Some((order, steps + 1)),
            }
        }
        let mut bytes = [0; 7];
        loop {
            let count = self.device.receive(&mut bytes);
            if count == 0 {
                break;
            }
            self.sum += bytes[..count].iter().map(|byte| f64::from(*byte)).sum::<f64>();
        }
        let _ = self.device.send(&[self.sum as u8]);
        self.keepsake.keep(&self.sum.to_le_bytes());
        if !self.device.link().is_open() {
            return Err(Fault::new("no device"));
        }
        if !self.paused {
            let twist =
                Twist { linear_x_m_s: self.sum, linear_y_m_s: self.device.arrived().seconds(), ..Twist::default() };
            self.out.write(now, &twist);
        }
        Ok(())
    }
}

/// The device's side: sends a few bytes per step.
struct Source {
    count: u8,
    device: Device,
}

impl Node for Source {
    const TYPE: &'static str = "source";
    const LAYER: Layer = Layer::Simulator;
    type Config = Config;

    fn open(ports: &mut Ports, _: Config) -> Result<Self, OpenError> {
        Ok(Source { count: (ports.seed() & 0xff) as u8, device: ports.serve_device("adder", None)? })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        self.count = self.count.wrapping_add(13);
        let bytes = [self.count; 20];
        let _ = self.device.send(&bytes[..usize::from(self.count) % 20]);
        Ok(())
    }
}

/// Orders the adder to count, again and again, sometimes cancels, and writes down how each order stands.
struct Boss {
    orders: u64,
    count: Caller<Switch, Done>,
    out: Writer<Twist>,
}

impl Node for Boss {
    const TYPE: &'static str = "boss";
    const LAYER: Layer = Layer::Tasks;
    type Config = Config;

    fn open(ports: &mut Ports, _: Config) -> Result<Self, OpenError> {
        Ok(Boss { orders: 0, count: ports.caller("count")?.with_progress::<Done>(), out: ports.writer("state")? })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let state = match self.count.poll(now) {
            CallState::Idle => {
                self.orders += 1;
                self.count.start(now, &Switch { on: self.orders % 5 }, 1, 0.2);
                0.0
            }
            CallState::Pending => 1.0,
            CallState::Running => 2.0,
            CallState::Answered(done) => 3.0 + done.at_ns as f64,
            CallState::Refused(reason) | CallState::Failed(reason) => 4.0 + reason.as_str().len() as f64,
            CallState::Cancelled => 5.0,
            CallState::Lost(_) => 6.0,
            CallState::TimedOut => 7.0,
        };
        let progress = self.count.progress::<Done>().map_or(-1.0, |done| done.at_ns as f64);
        if self.orders.is_multiple_of(4) && progress == 2.0 {
            self.count.cancel();
        }
        let twist = Twist { linear_x_m_s: state, linear_y_m_s: progress, angular_z_rad_s: self.orders as f64 };
        self.out.write(now, &twist);
        Ok(())
    }
}

/// Takes every sum once, in order, looks at the newest of a set, and back in history.
struct Mean {
    gain: f64,
    taken: f64,
    sums: Reader<Twist>,
    all: Set<Twist>,
    out: Writer<Odometry>,
}

impl Node for Mean {
    const TYPE: &'static str = "mean";
    const LAYER: Layer = Layer::Perception;
    type Config = Config;

    fn open(ports: &mut Ports, config: Config) -> Result<Self, OpenError> {
        let (sums, all) = (ports.reader("sums")?, ports.set("all")?);
        Ok(Mean { gain: config.gain.unwrap_or(1.0), taken: 0.0, sums, all, out: ports.writer("mean")? })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        while let Some(sample) = self.sums.next_unread() {
            self.taken += sample.linear_x_m_s;
        }
        let mut members = 0.0;
        self.all.each(|_, sample| members += sample.linear_x_m_s);
        let mut history = 0.0;
        self.sums.newest(3, |sample| history += sample.linear_x_m_s);
        let before = self.sums.at(now.before_s(0.025)).map_or(-1.0, |sample| sample.linear_x_m_s);
        let mean = Odometry {
            x_m: self.taken * self.gain,
            y_m: members + history,
            heading_rad: before,
            ..Odometry::default()
        };
        self.out.write(now, &mean);
        Ok(())
    }
}

pub const TYPES: &[NodeType] =
    &[NodeType::of::<Adder>(), NodeType::of::<Source>(), NodeType::of::<Mean>(), NodeType::of::<Boss>()];

pub const TOY: &str = r#"
[robot]
name = "toy"
[record]
[nodes.source]
type = "source"
period_ms = 7
[nodes.adder]
type = "adder"
period_ms = 10
[nodes.mean]
type = "mean"
period_ms = 20
reads.sums = ["/drivers/none/sum", "/drivers/adder/sum"]
reads.all = "/drivers/*/sum"
[nodes.boss]
type = "boss"
period_ms = 3
calls.count = "/drivers/adder count"
"#;

pub fn robot() -> Robot {
    let text = TOY.replace("[\"/drivers/none/sum\", \"/drivers/adder/sum\"]", "\"/drivers/adder/sum\"");
    Robot::parse(&text, "toy.toml", Resources::Folder("/nonexistent".into()), TYPES).unwrap()
}

/// What becomes of a sample on its way into the file: false leaves it out.
pub type Change<'a> = &'a mut dyn FnMut(&str, &RawSample, &mut Vec<u8>) -> bool;

/// Runs the toy for `seconds` from `seed`, kills the adder once, calls it twice, and records to `file`.
pub fn record(file: &Path, seconds: f64, seed: u64, change: Change<'_>) {
    let robot = robot();
    let mut out = RecordingWriter::create(file, &Facts::of(&robot, seed, "simulated")).unwrap();
    let mut host = SimulatedHost::new(&robot, seed, Time::ZERO).unwrap();
    let paths = host.tree().list().unwrap();
    let mut next = vec![1_u64; paths.len()];
    let keys: Vec<_> = paths
        .iter()
        .map(|path| out.channel(path, host.tree().reader(path, None).unwrap().geometry()).unwrap())
        .collect();
    let adder = host.index_of("/drivers/adder").unwrap();
    let mut slice = 0;
    while host.now() < Time::from_seconds(seconds) {
        slice += 1;
        let request = |on: u64| LocalRequest {
            path: "/drivers/adder",
            command: "pause",
            layout_hash: <Switch as messages::Message>::layout_hash(),
            body: messages::bytemuck::bytes_of(&Switch { on }).to_vec().leak(),
            priority: 3,
            deadline: Time::from_seconds(1e6),
        };
        match slice {
            4 => drop(host.call(&request(1))),
            6 => drop(host.call(&request(0))),
            7 => drop(host.call(&request(9))),
            9 => host.kill(adder),
            10 => host.restart(adder).unwrap(),
            _ => {}
        }
        host.run_until(host.now().after_s(0.05));
        for ((path, key), next) in paths.iter().zip(&keys).zip(&mut next) {
            let ring = host.tree().reader(path, None).unwrap();
            let mut buffer = SampleBuffer::new(ring.geometry());
            while *next <= ring.head() {
                match ring.read(*next, &mut buffer) {
                    Ok(sample) => {
                        let mut fixed = buffer.fixed().to_vec();
                        if change(path, &sample, &mut fixed) {
                            out.sample(*key, &sample, &fixed, buffer.tail()).unwrap();
                        }
                    }
                    Err(ReadError::Overrun) => panic!("{path} overran"),
                    Err(_) => {}
                }
                *next += 1;
            }
        }
    }
    out.finish().unwrap();
}
