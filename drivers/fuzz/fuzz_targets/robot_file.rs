#![no_main]

#[path = "../files.rs"]
#[allow(dead_code)] // each binary runs one target
mod files;

libfuzzer_sys::fuzz_target!(|data: &[u8]| files::robot_file(data));
