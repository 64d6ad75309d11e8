//! The program as people and scripts meet it: every command run as a process, on channels that the test itself fills.
#![allow(clippy::unwrap_used, reason = "tests")]

mod batch;
mod call;
mod cat;
mod drive;
mod files;
mod goto;
mod hz;
mod ls;
mod place;
mod recordings;
mod terminal;
