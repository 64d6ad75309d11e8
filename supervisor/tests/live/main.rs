//! The supervisor with real processes. Each test has a folder of its own under /dev/shm and leaves nothing there.

#[allow(clippy::unwrap_used, reason = "the exception for tests does not reach what they share")]
mod bench;
mod births_and_deaths;
mod claims;
mod stops;

#[test]
fn supervises_as_a_process_of_its_own() {
    bench::supervise_for_remote();
}
