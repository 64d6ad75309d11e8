//! The one binary: every built-in node type, and no other.

fn main() -> std::process::ExitCode {
    sinew::main(&[])
}
