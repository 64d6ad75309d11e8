//! Where the core dump of a dead process is (core(5)): found by the kernel's pattern, and kept with the logs.
//!
//! A node's newest core lies in the log folder as `NODE.core`, one per node, so that a crash loop does not fill the disk.
//! A pattern that pipes to a program, or lies on another file system, leaves the core where it went; the incident says
//! where that is. Whether there are cores at all is the machine's affair (`ulimit -c` of whoever started the robot).

use std::fs;
use std::path::{Path, PathBuf};

/// What `kernel.core_pattern` and `kernel.core_uses_pid` say.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CorePattern {
    pub text: String,
    pub uses_pid: bool,
}

impl CorePattern {
    /// This machine's.
    pub fn of_machine() -> CorePattern {
        let read = |name: &str| fs::read_to_string(format!("/proc/sys/kernel/{name}")).unwrap_or_default();
        CorePattern {
            text: read("core_pattern").trim_end_matches('\n').to_owned(),
            uses_pid: read("core_uses_pid").trim() == "1",
        }
    }

    /// Where the core of process `pid`, which worked in `cwd`, went: a sentence for the record.
    pub fn account(&self, pid: i32, cwd: &Path, keep_as: Option<&Path>) -> String {
        if let Some(program) = self.text.strip_prefix('|') {
            let program = program.split_whitespace().next().unwrap_or("a program");
            return format!("its core dump went to {program} (kernel.core_pattern)");
        }
        match (self.find(pid, cwd), keep_as) {
            (Some(file), Some(kept)) if fs::rename(&file, kept).is_ok() => format!("core dump: {}", kept.display()),
            (Some(file), _) => format!("core dump: {}", file.display()),
            (None, _) => format!("its core dump is not where kernel.core_pattern ({}) says", self.text),
        }
    }

    /// The newest file that this pattern can have made for `pid`.
    fn find(&self, pid: i32, cwd: &Path) -> Option<PathBuf> {
        let (folder, name) = self.text.rsplit_once('/').unwrap_or(("", &self.text));
        // core(5): a process number is added where the pattern has none.
        let name = if self.uses_pid && !name.contains("%p") { format!("{name}.%p") } else { name.to_owned() };
        let folder = if self.text.starts_with('/') { PathBuf::from(format!("{folder}/")) } else { cwd.join(folder) };
        let pieces = pieces(&name, pid);
        let entries = fs::read_dir(folder).ok()?.flatten();
        let fitting = entries.filter(|entry| entry.file_name().to_str().is_some_and(|name| fits(&pieces, name)));
        let aged = fitting.filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())));
        aged.max().map(|(_, path)| path)
    }
}

/// The pattern cut where something stands that only the kernel knew.
fn pieces(pattern: &str, pid: i32) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut letters = pattern.chars();
    while let Some(letter) = letters.next() {
        let Some(piece) = pieces.last_mut() else { return pieces };
        match (letter, if letter == '%' { letters.next() } else { None }) {
            ('%', Some('%')) => piece.push('%'),
            ('%', Some('p')) => piece.push_str(&pid.to_string()),
            ('%', Some(_)) => pieces.push(String::new()),
            // A single % at the end is dropped by the kernel.
            ('%', None) => {}
            (letter, _) => piece.push(letter),
        }
    }
    pieces
}

/// Whether `name` is made of the pieces in order, with anything between them.
fn fits(pieces: &[String], name: &str) -> bool {
    let [first, between @ ..] = pieces else { return name.is_empty() };
    let Some(mut rest) = name.strip_prefix(first.as_str()) else { return false };
    let Some((last, between)) = between.split_last() else { return rest.is_empty() };
    for piece in between {
        let Some(at) = rest.find(piece.as_str()) else { return false };
        rest = &rest[at + piece.len()..];
    }
    rest.ends_with(last.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(text: &str, uses_pid: bool) -> CorePattern {
        CorePattern { text: text.to_owned(), uses_pid }
    }

    #[test]
    fn a_core_is_found_by_any_pattern_and_kept_beside_the_logs() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("base.core");
        for (text, uses_pid, name) in [
            ("core", false, "core"),
            ("core", true, "core.77"),
            ("core.%e.%p", true, "core.base.77"),
            ("%e-%t-%p%%.core", false, "base-1764000000-77%.core"),
        ] {
            fs::write(folder.path().join(name), name).unwrap();
            fs::write(folder.path().join("core.other.78"), "another's").unwrap();
            let told = pattern(text, uses_pid).account(77, folder.path(), Some(&kept));
            assert_eq!(told, format!("core dump: {}", kept.display()), "{text}");
            assert_eq!(fs::read_to_string(&kept).unwrap(), name);
        }
        let absolute = format!("{}/c.%p", folder.path().display());
        fs::write(folder.path().join("c.77"), "absolute").unwrap();
        let told = pattern(&absolute, false).account(77, Path::new("/nowhere"), None);
        assert_eq!(told, format!("core dump: {}", folder.path().join("c.77").display()));
    }

    #[test]
    fn a_piped_core_and_one_that_is_not_there_are_told_as_such() {
        let piped = pattern("|/usr/lib/systemd/systemd-coredump %P %u", false);
        let told = piped.account(7, Path::new("/"), None);
        assert_eq!(told, "its core dump went to /usr/lib/systemd/systemd-coredump (kernel.core_pattern)");
        let folder = tempfile::tempdir().unwrap();
        assert!(pattern("core.%p", false).account(7, folder.path(), None).contains("is not where"));
    }
}
