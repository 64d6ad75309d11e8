#![no_main]

#[path = "../targets.rs"]
#[allow(dead_code)] // each binary runs one target
mod targets;

libfuzzer_sys::fuzz_target!(|data: &[u8]| targets::lms_session(data));
