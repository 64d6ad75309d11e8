//! A file system without room.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use runtime::channel::{ChannelError, Claim, Death, Geometry, SampleBuffer, Tree};

use super::processes::{ROOT, command, role};
use super::{geometry, read};

#[test]
fn a_full_file_system_is_an_error_with_numbers_and_never_a_signal() {
    let Some(report) = in_a_file_system_of_its_own("full::full_process") else { return };
    assert_eq!(report, "done");
}

/// In a process and mount namespace of its own: a /dev/shm of 64 MB as containers have it, and a tiny one.
#[test]
fn full_process() {
    if role("full::full_process").is_none() {
        return;
    }
    let folder = PathBuf::from(std::env::var_os(ROOT).unwrap());
    for (size, image_bytes) in [("64m", 1 << 20), ("64k", 1 << 11), ("8k", 1 << 10), ("4k", 0)] {
        let place = folder.join(size);
        fs::create_dir_all(&place).unwrap();
        if !mount_tmpfs(&place, size) {
            eprintln!("skipped: mount refused ({})", std::io::Error::last_os_error());
            return;
        }
        let tree = Tree::shared(&place.join("robot")).unwrap();
        let image = Geometry { tail_element_bytes: 1, tail_capacity: image_bytes, ..geometry() };
        let mut writers = Vec::new();
        let error = loop {
            let path = format!("/camera/image_{}", writers.len());
            match tree.writer(&path, &image, Claim::Continue) {
                Ok(writer) => writers.push(writer),
                Err(error) => break error,
            }
            assert!(writers.len() < 1000, "a file system of {size} holds whatever one likes");
        };
        let text = error.to_string();
        let ChannelError::NoSpace { path, wanted_bytes, free_bytes } = error else { panic!("{text}") };
        assert!(wanted_bytes > free_bytes, "{text}");
        assert!(text.contains(&path) && text.contains(&wanted_bytes.to_string()) && text.contains("depth"), "{text}");
        assert_eq!(writers.is_empty(), size == "8k" || size == "4k", "{size}");

        // What there is works to the last byte.
        let tail = vec![0x5a; image_bytes];
        for writer in &mut writers {
            (0..10).for_each(|n| assert!(!writer.publish(n, &[1; 20], &tail).lost));
        }
        for index in 0..writers.len() {
            let reader = tree.reader(&format!("/camera/image_{index}"), None).unwrap();
            let mut buffer = SampleBuffer::new(reader.geometry());
            (7..=10).for_each(|sequence| assert!(reader.read(sequence, &mut buffer).is_ok()));
            assert_eq!(buffer.tail(), tail);
        }
        // The refused one has left nothing, neither has a refused growth.
        assert_eq!(tree.list().unwrap().len(), writers.len());
        if let Ok(folder) = fs::read_dir(place.join("robot/camera")) {
            let mut names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            assert!(!names.any(|name| name.ends_with(".new")), "the unfinished ring is still there");
        }
        if let Some(writer) = writers.pop() {
            writer.die_publishing(Death::BeforeWake, 11, &[2; 20], &tail);
            let path = format!("/camera/image_{}", writers.len());
            let deeper = Geometry { depth: 400, ..image.clone() };
            assert!(matches!(tree.writer(&path, &deeper, Claim::Continue), Err(ChannelError::NoSpace { .. })));
            let fenced = tree.writer("/camera/image_0", &deeper, Claim::Fence);
            assert!(matches!(fenced, Err(ChannelError::NoSpace { .. })));
            assert!(writers.iter().all(|writer| !writer.lost()), "a fence that failed takes nothing away");
            let reader = tree.reader(&path, None).unwrap();
            assert!(!reader.retired());
            assert_eq!((reader.head(), read(&reader, 11).unwrap().stamp_ns), (11, 11));
            let mut writer = tree.writer(&path, &image, Claim::Continue).unwrap();
            assert_eq!(writer.publish(12, &[], &[]).sequence, 12);
            assert!(read(&reader, 12).is_ok());
            if !writers.is_empty() {
                let held = tree.writer("/camera/image_0", &image, Claim::Continue);
                assert!(matches!(held, Err(ChannelError::Held { .. })));
            }
        }
    }
    eprintln!("done");
}

fn mount_tmpfs(at: &Path, size: &str) -> bool {
    let c = |text: &str| std::ffi::CString::new(text).unwrap();
    let (none, target, kind, options) = (c("none"), c(at.to_str().unwrap()), c("tmpfs"), c(&format!("size={size}")));
    // SAFETY: all pointers are to live C strings; the namespace is this process's own.
    unsafe {
        libc::mount(none.as_ptr(), c"/".as_ptr(), std::ptr::null(), libc::MS_REC | libc::MS_PRIVATE, std::ptr::null());
        libc::mount(none.as_ptr(), target.as_ptr(), kind.as_ptr(), 0, options.as_ptr().cast()) == 0
    }
}

/// Runs `role` in a mount namespace of its own, made as root or in a user namespace; `None`, with the reason printed,
/// where neither is permitted.
fn in_a_file_system_of_its_own(role: &str) -> Option<String> {
    use std::os::unix::process::CommandExt;
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(role, folder.path());
    let users = format!("0 {} 1", rustix::process::geteuid().as_raw());
    let groups = format!("0 {} 1", rustix::process::getegid().as_raw());
    // SAFETY: between fork and exec only system calls run.
    unsafe {
        command.pre_exec(move || {
            if libc::unshare(libc::CLONE_NEWNS) == 0 {
                return Ok(());
            }
            if libc::unshare(libc::CLONE_NEWUSER | libc::CLONE_NEWNS) != 0 {
                return Err(std::io::Error::last_os_error());
            }
            fs::write("/proc/self/uid_map", &users)?;
            fs::write("/proc/self/setgroups", "deny")?;
            fs::write("/proc/self/gid_map", &groups)
        });
    }
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(refusal) => {
            println!("skipped: no mount namespace can be made here ({refusal})");
            return None;
        }
    };
    let lines: Vec<String> = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok).collect();
    let status = child.wait().unwrap();
    let last = lines.iter().find(|line| *line == "done" || line.starts_with("skipped")).cloned();
    assert!(status.success(), "{status}: {}", lines.join("\n"));
    let last = last.expect("the process says how it went");
    if last.starts_with("skipped") {
        println!("{last}");
        return None;
    }
    Some(last)
}
