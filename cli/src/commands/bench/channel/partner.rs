//! The answering process: this program, executed again.

use super::line::{End, Engine, Line, mark};
use crate::commands::bench::placement::Placement;
use crate::exit::Failure;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Arguments of the answering process.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[arg(long)]
    engine: Engine,
    #[arg(long)]
    placement: Placement,
    #[arg(long)]
    size: usize,
    #[arg(long)]
    folder: PathBuf,
}

/// Answers every payload with one of the same size, until standard input ends.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut line = args.engine.open(&args.folder, args.size, End::Answering, None)?;
    if args.engine != Engine::Pipe {
        // The pipe ends by itself when the asking process is gone; the others would sleep for ever.
        std::thread::Builder::new().name("end".into()).stack_size(64 * 1024).spawn(|| {
            let _ = std::io::stdin().lock().read_to_end(&mut Vec::new());
            std::process::exit(0);
        })?;
    }
    let scheduling = args.placement.enter(true);
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "{scheduling}")?;
    stdout.flush()?;
    drop(stdout);
    let mut reply = vec![0x5A; args.size];
    loop {
        let Ok([first, last]) = line.receive() else { return Ok(()) };
        // An incomplete payload is answered with a number that nobody asked for.
        mark(&mut reply, if first == last { first } else { u64::MAX });
        if line.send(&reply).is_err() {
            return Ok(());
        }
    }
}

/// A line with a process at its other end.
pub struct Partner {
    /// What carries it.
    pub engine: Engine,
    /// How the process is scheduled.
    pub scheduling: String,
    line: Box<dyn Line>,
    payload: Vec<u8>,
    count: u64,
    child: Child,
}

impl Partner {
    /// Starts the process and opens the line to it.
    pub fn start(engine: Engine, placement: Placement, size: usize, folder: &Path) -> Result<Partner, Failure> {
        let folder = folder.join(format!("{}-{}-{size}", engine.name(), placement.name()));
        std::fs::create_dir_all(&folder)?;
        engine.prepare(&folder, size)?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["bench", "partner", "--engine", engine.name(), "--placement", placement.name()]);
        command.args(["--size", &size.to_string(), "--folder"]).arg(&folder);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let opened =
            greet(&mut child).and_then(|text| Ok((text, engine.open(&folder, size, End::Asking, Some(&mut child))?)));
        match opened {
            Ok((scheduling, line)) => {
                Ok(Partner { engine, scheduling, line, payload: vec![0xA5; size], count: 0, child })
            }
            Err(failure) => {
                let _ = child.kill();
                let _ = child.wait();
                Err(Failure::from(format!("the answering process of {}: {}", engine.name(), failure.message)))
            }
        }
    }

    /// Sends a payload and sleeps until the answer has come.
    #[inline]
    pub fn round_trip(&mut self) -> Result<(), Failure> {
        self.count += 1;
        mark(&mut self.payload, self.count);
        self.line.send(&self.payload)?;
        match self.line.receive()? {
            answer if answer == [self.count; 2] => Ok(()),
            answer => Err(Failure::from(format!("{}: {} was answered by {answer:?}", self.engine.name(), self.count))),
        }
    }
}

/// Waits for the first line that the process says.
fn greet(child: &mut Child) -> Result<String, Failure> {
    let stdout = child.stdout.as_mut().ok_or("it has no output")?;
    let mut line = String::new();
    // One byte at a time: what follows belongs to the line.
    BufReader::with_capacity(1, stdout).read_line(&mut line)?;
    match line.trim() {
        "" => Err("it ended before it was ready".into()),
        text => Ok(text.to_owned()),
    }
}

impl Drop for Partner {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
