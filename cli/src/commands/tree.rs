//! The hidden commands that a process tree is made of: the one that becomes its root, and the supervisor.

use super::run::{fill, plan};
use crate::exit::Failure;
use crate::launch::Launch;
use crate::load;
use runtime::NodeType;
use std::ffi::OsString;
use std::io::Read;
use std::path::{Path, PathBuf};
use supervisor::Seed;

/// Becomes the root of a robot's process tree; `sinew run` starts it
#[derive(Debug, clap::Args)]
pub struct TreeArgs {
    /// Nothing moves before `sinew resume`
    #[arg(long)]
    stand: bool,
}

/// Supervises a robot; the root of its process tree starts it
#[derive(Debug, clap::Args)]
pub struct SuperviseArgs {
    /// The robot's folder of channels
    #[arg(long)]
    root: PathBuf,
}

/// Reads the launch from standard input, and becomes the root. Why not, if so, is told to `sinew run`.
pub fn prepare(args: TreeArgs, types: &[NodeType]) -> Result<(), Failure> {
    let front = supervisor::front_connection()?;
    let mut text = Vec::new();
    std::io::stdin().read_to_end(&mut text)?;
    let launch: Launch = serde_json::from_slice(&text)?;
    let robot = launch.robot(types)?;
    let graph = robot.graph().map_err(load::errors)?;
    let plan = plan(&robot)?;
    let program = std::env::current_exe()?;
    let supervisor: [OsString; 4] =
        [program.clone().into(), "supervise".into(), "--root".into(), plan.root.clone().into()];
    let seed = Seed { guard: guard_program(&program), supervisor: supervisor.into(), stand: args.stand };
    let told = front.try_clone()?;
    let error = match supervisor::prepare(&plan, &seed, front, |root| fill(root, &launch, &graph)) {
        Ok(never) => match never {},
        Err(error) => error,
    };
    supervisor::refuse(&told, &error);
    Ok(())
}

/// The small program where `SINEW_GUARD` names it, else this one, which contains it.
fn guard_program(own: &Path) -> PathBuf {
    std::env::var_os("SINEW_GUARD").filter(|path| !path.is_empty()).map_or_else(|| own.to_owned(), PathBuf::from)
}

/// Supervises until nothing of the run is left; then the root ends, too.
pub fn supervise(args: SuperviseArgs, types: &[NodeType]) -> Result<(), Failure> {
    let robot = Launch::read(&args.root)?.robot(types)?;
    let mut plan = plan(&robot)?;
    plan.root = args.root;
    Ok(supervisor::supervise(plan)?)
}
