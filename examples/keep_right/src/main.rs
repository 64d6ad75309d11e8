//! A robot of one's own: everything that `sinew` has, and the nodes that are handed to it here.

mod keep_right;

use sinew::NodeType;
use std::process::ExitCode;

fn main() -> ExitCode {
    sinew::main(&[NodeType::of::<keep_right::KeepRight>()])
}
