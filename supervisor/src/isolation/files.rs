//! Landlock: files, TCP ports, signals and abstract sockets.

use landlock::{
    ABI, Access, AccessFs, AccessNet, BitFlags, CompatLevel, Compatible, LandlockStatus, NetPort, Ruleset, RulesetAttr,
    RulesetCreatedAttr, RulesetError, RulesetStatus, Scope, make_bitflags, path_beneath_rules,
};
use runtime::realtime::Grant;
use std::path::Path;

use super::needs::Needs;

/// The newest rules that are made use of: signals and abstract sockets (Linux 6.12).
const WANTED: ABI = ABI::V6;

/// What this kernel's Landlock can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Landlock {
    /// The kernel has none, or it is switched off.
    Missing,
    /// It is there, at this version of its rules.
    Version(i32),
}

impl Landlock {
    /// What strict nodes have to do without.
    pub fn flaw(self) -> Option<String> {
        match self {
            Landlock::Missing => {
                Some("this kernel has no Landlock: strict nodes can open what their user can; Linux 5.13 with lsm=…,landlock has it".into())
            }
            Landlock::Version(version) if version < WANTED as i32 => Some(format!(
                "this kernel's Landlock is version {version}: {} not restricted by it (Linux 6.12 does)",
                match version {
                    ..4 => "TCP ports and signals are",
                    _ => "signals are",
                }
            )),
            Landlock::Version(_) => None,
        }
    }
}

/// Asks the kernel, in a thread of its own: what it takes on ends with it.
pub fn landlock() -> Landlock {
    let asked = std::thread::spawn(|| {
        let rules = Ruleset::default().handle_access(make_bitflags!(AccessFs::{MakeBlock}))?;
        Ok::<_, RulesetError>(rules.create()?.restrict_self()?.landlock)
    });
    match asked.join() {
        Ok(Ok(LandlockStatus::Available { effective_abi, kernel_abi })) => {
            Landlock::Version(kernel_abi.unwrap_or(effective_abi as i32))
        }
        _ => Landlock::Missing,
    }
}

/// What the owner of a folder does in it.
fn own() -> BitFlags<AccessFs> {
    make_bitflags!(AccessFs::{ReadFile | ReadDir | WriteFile | Truncate | RemoveFile | RemoveDir | MakeReg | MakeDir | MakeSock | MakeSym})
}

fn read() -> BitFlags<AccessFs> {
    make_bitflags!(AccessFs::{ReadFile | ReadDir})
}

fn device() -> BitFlags<AccessFs> {
    make_bitflags!(AccessFs::{ReadFile | WriteFile | IoctlDev})
}

/// Keeps this thread, and every later one of its process, to `needs`, for good.
pub(super) fn restrict(needs: &Needs) -> Grant {
    match try_restrict(needs) {
        Ok((RulesetStatus::FullyEnforced, number)) => {
            Grant::Granted(format!("Landlock: {number} places, TCP, signals, abstract sockets"))
        }
        Ok((RulesetStatus::PartiallyEnforced, _)) => {
            let flaw =
                landlock().flaw().unwrap_or_else(|| "this kernel's Landlock knows only a part of the rules".into());
            Grant::Refused(flaw)
        }
        Ok((RulesetStatus::NotEnforced, _)) => Grant::Refused(Landlock::Missing.flaw().unwrap_or_default()),
        Err(error) => Grant::Refused(format!("Landlock: {error}")),
    }
}

fn try_restrict(needs: &Needs) -> Result<(RulesetStatus, usize), RulesetError> {
    let rules = Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(AccessFs::from_all(WANTED))?
        .handle_access(AccessNet::from_all(WANTED))?
        .scope(Scope::from_all(WANTED))?
        .create()?
        .add_rules(path_beneath_rules(existing(&needs.read), read()))?
        .add_rules(path_beneath_rules(existing(&needs.devices), device()))?
        .add_rules(path_beneath_rules(existing(&needs.own), own()))?
        .add_rules(needs.connect.iter().map(|&port| Ok::<_, RulesetError>(NetPort::new(port, AccessNet::ConnectTcp))))?
        .add_rules(needs.listen.iter().map(|&port| Ok::<_, RulesetError>(NetPort::new(port, AccessNet::BindTcp))))?;
    let number = needs.read.len() + needs.devices.len() + needs.own.len();
    Ok((rules.restrict_self()?.ruleset, number))
}

fn existing<P: AsRef<Path>>(paths: &[P]) -> impl Iterator<Item = &Path> {
    paths.iter().map(AsRef::as_ref)
}
