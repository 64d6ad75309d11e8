//! The faults, and how long a member takes to be back.

use super::census::{Census, Member};
use crate::exit::Failure;
use guard::Injected;
use runtime::{Time, clock};
use rustix::process::{Pid, Signal, kill_process};

/// What happens to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// SIGKILL.
    Kill,
    /// SIGSTOP: it lives and does nothing.
    Stop,
    /// Its step waits for ever.
    Hang,
    /// Its step computes for ever.
    Spin,
    /// Its step takes memory for ever.
    Hog,
}

impl Fault {
    /// Every kind.
    pub const ALL: [Fault; 5] = [Fault::Kill, Fault::Stop, Fault::Hang, Fault::Spin, Fault::Hog];

    /// The kind in one word.
    pub fn word(self) -> &'static str {
        ["kill", "stop", "hang", "spin", "hog"][self as usize]
    }

    /// What befalls `member` when this is drawn: guard and supervisor run no steps that could be told to misbehave.
    pub fn for_member(self, member: &Member) -> Fault {
        match (member, self) {
            (Member::Node(_), fault) => fault,
            (_, Fault::Kill | Fault::Hog) => Fault::Kill,
            _ => Fault::Stop,
        }
    }

    fn injected(self) -> Option<Injected> {
        match self {
            Fault::Hang => Some(Injected::Hang),
            Fault::Spin => Some(Injected::Spin),
            Fault::Hog => Some(Injected::Hog),
            Fault::Kill | Fault::Stop => None,
        }
    }
}

/// A process that has been hit.
pub struct Wound {
    /// When.
    pub at: Time,
    member: Member,
    before: u32,
}

/// How often recovery is looked for [s].
const LOOK_S: f64 = 0.0005;

impl Wound {
    /// Does `fault` to `member`; `None` when it is just being restarted.
    pub fn inflict(census: &Census, member: &Member, fault: Fault) -> Result<Option<Wound>, Failure> {
        let Some(before) = census.pid(member) else { return Ok(None) };
        let wound = Wound { at: clock::now(), member: member.clone(), before };
        match (fault.injected(), census.line(member)) {
            (Some(injected), Some(line)) => line.inject(injected),
            _ => {
                let signal = if fault == Fault::Stop { Signal::STOP } else { Signal::KILL };
                let pid = Pid::from_raw(before as i32).ok_or("no process")?;
                if kill_process(pid, signal).is_err() {
                    return Ok(None);
                }
            }
        }
        Ok(Some(wound))
    }

    /// Waits until another process does the member's work; how long that took since the blow [s].
    pub fn healed(&self, census: &Census, within_s: f64) -> Option<f64> {
        let until = self.at.after_s(within_s);
        while clock::now() < until {
            if self.is_healed(census) {
                return Some(clock::now().since(self.at));
            }
            clock::sleep_s(LOOK_S);
        }
        None
    }

    fn is_healed(&self, census: &Census) -> bool {
        match census.line(&self.member) {
            // The beat is the new process's own: it came after it had signed the line.
            Some(line) => {
                let (pid, _) = line.writer();
                pid != self.before && line.phase() != guard::Phase::Absent && line.beat_at_ns() > self.at.nanos()
            }
            None => {
                census.pid(&self.member).is_some_and(|pid| pid != self.before)
                    && guard::ask(&census.folder, "look", 1.0).is_ok()
            }
        }
    }
}
