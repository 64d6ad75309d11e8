//! The structure that the architecture promises, checked against the files.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_path_buf()
}

/// Names of the crates of this workspace that `folder`'s manifest depends on, tests' dependencies left out.
fn own_dependencies(folder: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(folder).join("Cargo.toml")).expect("a crate has a manifest");
    let mut inside = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.starts_with('[') {
            inside = line.starts_with("[dependencies");
        } else if inside && let Some(name) = line.split(['.', ' ', '=']).next().filter(|name| !name.is_empty()) {
            found.push(name.to_owned());
        }
    }
    let own = [
        "messages",
        "messages-derive",
        "runtime",
        "supervisor",
        "drivers",
        "perception",
        "actions",
        "coordinator",
        "motion",
        "simulator",
        "recorder",
        "sinew",
    ];
    found.retain(|name| own.contains(&name.as_str()));
    found
}

#[test]
fn layers_meet_only_through_messages_and_runtime() {
    for layer in ["drivers", "perception", "actions", "coordinator", "motion"] {
        for dependency in own_dependencies(layer) {
            assert!(
                ["messages", "runtime"].contains(&dependency.as_str()),
                "{layer}/Cargo.toml depends on {dependency}: a layer meets the others only through messages and runtime"
            );
        }
    }
}

#[test]
fn lower_crates_do_not_know_higher_ones() {
    assert_eq!(own_dependencies("messages"), ["messages-derive"]);
    assert_eq!(own_dependencies("runtime"), ["messages"]);
    assert!(own_dependencies("supervisor").iter().all(|name| ["messages", "runtime"].contains(&name.as_str())));
    let recorder = own_dependencies("recorder");
    let below = ["messages", "runtime", "supervisor"];
    assert!(recorder.iter().all(|name| below.contains(&name.as_str())), "{recorder:?}");
    let simulator = own_dependencies("simulator");
    assert!(simulator.iter().all(|name| ["messages", "runtime", "drivers"].contains(&name.as_str())), "{simulator:?}");
}

#[test]
fn the_workspace_lists_its_crates_in_flow_order() {
    let text = fs::read_to_string(root().join("Cargo.toml")).expect("the workspace has a manifest");
    let place = |name: &str| text.find(&format!("    \"{name}\",")).unwrap_or_else(|| panic!("{name} is no member"));
    let order = [
        "messages",
        "runtime",
        "supervisor",
        "drivers",
        "perception",
        "actions",
        "coordinator",
        "motion",
        "simulator",
        "recorder",
        "cli",
    ];
    for pair in order.windows(2) {
        assert!(place(pair[0]) < place(pair[1]), "{} must stand before {}", pair[0], pair[1]);
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" {
                sources(&path, found);
            }
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

#[test]
fn no_source_file_has_more_than_600_lines_outside_its_tests() {
    let mut files = Vec::new();
    sources(&root(), &mut files);
    assert!(files.len() > 50, "the search found {} files only", files.len());
    for file in files {
        let inside_tests =
            file.components().any(|part| ["tests", "fuzz"].contains(&part.as_os_str().to_string_lossy().as_ref()));
        let text = fs::read_to_string(&file).unwrap_or_default();
        let lines = text.split("#[cfg(test)]").next().map_or(0, |code| code.lines().count());
        assert!(inside_tests || lines <= 600, "{} has {lines} lines: one idea per file", file.display());
    }
}

#[test]
fn unsafe_code_lives_in_the_channel_module_and_the_system_calls_only() {
    let mut files = Vec::new();
    sources(&root(), &mut files);
    let allowed = [
        "runtime/src/channel",
        "runtime/src/sys",
        "supervisor/guard/src/sys.rs",
        "messages/src",
        "messages/derive",
        "xtask/",
        "/tests/",
        "runtime/src/lib.rs",
    ];
    for file in files {
        let text = fs::read_to_string(&file).unwrap_or_default();
        let path = file.display().to_string();
        let uses = text.lines().any(|line| {
            let code = line.split("//").next().unwrap_or("");
            code.contains("unsafe {") || code.contains("unsafe fn ") || code.contains("unsafe impl")
        });
        assert!(!uses || allowed.iter().any(|place| path.contains(place)), "{path} has unsafe code");
    }
}

/// Exceptions to "no `expect` outside tests": each is for what cannot happen, with its reason as the text. The number
/// may only fall.
#[test]
fn exceptions_to_error_handling_only_become_fewer() {
    const MOST: usize = 60;
    let mut files = Vec::new();
    sources(&root(), &mut files);
    let mut count = 0;
    for file in files {
        let path = file.display().to_string();
        if path.contains("/tests/") || path.contains("xtask") || path.contains("/fuzz/") || path.contains("/benches/") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap_or_default();
        let code = text.split("#[cfg(test)]").next().unwrap_or("");
        count += code.matches(".expect(\"").count()
            + code.matches("unreachable!(").count()
            + code.matches("panic!(").count();
    }
    assert!(count <= MOST, "{count} exceptions, {MOST} allowed");
}
