//! `sinew drive`: a person at the keyboard (S1's sixth duty), as one more action of the robot.

mod hold;
mod screen;
mod teleop;

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::launch::Launch;
use crate::live::Which;
use crate::view::{Terminal, Watch};
use hold::{Hold, Way};
use ratatui::crossterm::event::{
    DisableFocusChange, EnableFocusChange, KeyboardEnhancementFlags, PopKeyboardEnhancementFlags,
    PushKeyboardEnhancementFlags,
};
use ratatui::crossterm::{execute, terminal};
use runtime::robot::Robot;
use runtime::{NodeType, path};
use std::io::IsTerminal;
use teleop::{PATH, Teleop};

/// Drives a running robot with the keyboard; stops when the key is released
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    which: Which,
    /// Greatest speed; the robot file's own where it is less
    #[arg(long, value_name = "M_S")]
    speed: Option<f64>,
    /// Greatest turn rate; the robot file's own where it is less
    #[arg(long, value_name = "RAD_S")]
    turn: Option<f64>,
}

/// Greatest speeds while driving.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Ahead [m/s].
    pub forward_m_s: f64,
    /// Back [m/s].
    pub backward_m_s: f64,
    /// Either way round [rad/s].
    pub turn_rad_s: f64,
}

/// Drives until the person leaves.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    if !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
        let text = "drive needs a terminal: keys are read from it. Programs write /actions/NAME/proposal themselves";
        return Err(Failure::new(USAGE, text));
    }
    let live = args.which.find()?;
    let robot = Launch::read(&live.folder)?.robot(types)?;
    let limits = limits(&args, &robot)?;
    is_listened_to(&robot)?;
    let mut watch = Watch::open(&live.folder, &robot)?;
    let teleop = Teleop::start(&live.tree)?;
    let mut terminal = Terminal::take()?;
    // Given back before the terminal is: the keyboard's mode belongs to the second screen.
    let keyboard = Keyboard::take();
    screen::drive(&mut terminal, &mut watch, &teleop, &mut Hold::new(keyboard.way), limits)
}

fn limits(args: &Args, robot: &Robot) -> Result<Limits, Failure> {
    for (name, value) in [("--speed", args.speed), ("--turn", args.turn)] {
        if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
            return Err(Failure::new(USAGE, format!("{name} takes a number above 0")));
        }
    }
    let body = &robot.body;
    let speed_m_s = args.speed.unwrap_or(f64::INFINITY);
    Ok(Limits {
        forward_m_s: body.max_forward_m_s.min(speed_m_s),
        backward_m_s: body.max_backward_m_s.min(speed_m_s),
        turn_rad_s: body.max_turn_rad_s.min(args.turn.unwrap_or(f64::INFINITY)),
    })
}

/// Somebody must read what is written here, or keys would do nothing at all.
fn is_listened_to(robot: &Robot) -> Result<(), Failure> {
    let sources = robot.nodes.iter().flat_map(|node| node.reads.values()).flat_map(|wire| &wire.from);
    match sources.into_iter().any(|source| path::covers(source, PATH)) {
        true => Ok(()),
        false => {
            let text = format!(
                "no node of robot \"{}\" reads {PATH}: give it a coordinator with reads.proposals = \"/actions/*/proposal\"",
                robot.name
            );
            Err(Failure::new(NOT_RUNNING, text))
        }
    }
}

/// The keyboard, in the mode that tells most; given back when dropped.
struct Keyboard {
    way: Way,
}

impl Keyboard {
    fn take() -> Keyboard {
        let mut out = std::io::stdout();
        let _ = execute!(out, EnableFocusChange);
        let flags = KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES | KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
        let able = terminal::supports_keyboard_enhancement().unwrap_or(false);
        match able && execute!(out, PushKeyboardEnhancementFlags(flags)).is_ok() {
            true => Keyboard { way: Way::Releases },
            false => Keyboard { way: Way::Repeats },
        }
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        let mut out = std::io::stdout();
        if self.way == Way::Releases {
            let _ = execute!(out, PopKeyboardEnhancementFlags);
        }
        let _ = execute!(out, DisableFocusChange);
    }
}
