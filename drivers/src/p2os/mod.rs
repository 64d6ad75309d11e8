//! ActivMedia/MobileRobots Pioneer (P2OS, AROS, ARCOS) over a serial line, TCP or a pseudo-terminal.

mod framer;
pub mod numbers;
pub mod protocol;
