//! Root and guard as a program of their own; without it beside it, `sinew` runs the same code in its own image.

fn main() {
    guard::main_of(std::env::args_os().skip(1).collect());
}
