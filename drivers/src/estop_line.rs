//! An emergency stop button: one character of a file, as the kernel shows a GPIO line (`/sys/class/gpio/gpio17/value`).
//!
//! The robot may move while the file begins with `free`. Anything else, an empty file and one that cannot be read hold the
//! stop: a broken wire stops. No paths; it steps on its period, and a step reads a few bytes that the kernel has at hand.

use runtime::{Fault, Layer, Node, OpenError, Ports, StopSource, Time};
use schemars::JsonSchema;
use serde::Deserialize;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

/// Settings of an [`EstopLine`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EstopLineConfig {
    /// The file, an absolute path.
    pub file: String,
    /// The character that it begins with while the robot may move.
    pub free: char,
}

impl Default for EstopLineConfig {
    fn default() -> EstopLineConfig {
        EstopLineConfig { file: String::new(), free: '1' }
    }
}

/// The node.
pub struct EstopLine {
    path: PathBuf,
    free: u8,
    line: Option<File>,
    source: StopSource,
}

const REASONS: &[&str] = &["the button is pressed", "the line cannot be read"];
const UNREADABLE: Fault = Fault::new("the line cannot be read: the robot is stopped");

impl Node for EstopLine {
    const TYPE: &'static str = "estop_line";
    const LAYER: Layer = Layer::Drivers;
    type Config = EstopLineConfig;

    fn open(ports: &mut Ports, config: EstopLineConfig) -> Result<EstopLine, OpenError> {
        let path = PathBuf::from(&config.file);
        if !path.is_absolute() {
            return Err(OpenError::config(format!("file = \"{}\" must be an absolute path", config.file)));
        }
        if !config.free.is_ascii_graphic() {
            return Err(OpenError::config("free must be a printable ASCII character, such as \"1\""));
        }
        Ok(EstopLine { path, free: config.free as u8, line: None, source: ports.stop_source(REASONS) })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        match judge(self.read(), self.free) {
            None => self.source.lower(),
            Some(reason) => self.source.hold(reason),
        }
        if self.line.is_some() { Ok(()) } else { Err(UNREADABLE) }
    }
}

impl EstopLine {
    /// The first character; `None` when there is none or it cannot be had. What was unplugged is opened anew.
    fn read(&mut self) -> Option<u8> {
        if self.line.is_none() {
            self.line = File::open(&self.path).ok();
        }
        let mut first = [0];
        match self.line.as_ref()?.read_at(&mut first, 0) {
            Ok(count) => (count > 0).then_some(first[0]),
            Err(_) => {
                self.line = None;
                None
            }
        }
    }
}

/// The number of the reason to hold the stop; `None`: the robot may move.
fn judge(first: Option<u8>, free: u8) -> Option<usize> {
    match first {
        Some(character) if character == free => None,
        Some(_) => Some(0),
        None => Some(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_agreed_character_lets_the_robot_move() {
        assert_eq!(judge(Some(b'1'), b'1'), None);
        assert_eq!(judge(Some(b'0'), b'1'), Some(0));
        assert_eq!(judge(Some(b'\n'), b'1'), Some(0));
        assert_eq!(judge(None, b'1'), Some(1));
    }
}
