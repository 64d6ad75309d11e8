//! Robots that run, and what dead ones left behind.

use super::Finding;
use crate::live;
use crate::output::{bytes, count};
use std::path::Path;

/// All about robots.
pub fn look() -> Vec<Finding> {
    below(&live::root())
}

fn below(root: &Path) -> Vec<Finding> {
    let names = live::names(root);
    if names.is_empty() {
        return vec![Finding::ok("robots", "none is running, nothing is left behind")];
    }
    names.iter().map(|name| robot(root, name)).collect()
}

fn robot(root: &Path, name: &str) -> Finding {
    let folder = root.join(name);
    let (files, size) = weight(&folder);
    let shown = folder.display();
    match live::runs(&folder) {
        true => {
            Finding::ok("robot", format!("{name} is running: {}, {} in {shown}", count(files, "file"), bytes(size)))
        }
        false => Finding::warn(
            "leftovers",
            format!("{name} does not run any more, but {} ({}) left in {shown}", count(files, "file"), bytes(size)),
            format!("the next `sinew run` of it removes them; or: rm -r {shown}"),
        ),
    }
}

/// Files below `folder`, and their bytes.
fn weight(folder: &Path) -> (usize, u64) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.fold((0, 0), |(files, size), entry| match entry.metadata() {
        Ok(inner) if inner.is_dir() => {
            let (more, bytes) = weight(&entry.path());
            (files + more, size + bytes)
        }
        Ok(file) => (files + 1, size + file.len()),
        Err(_) => (files, size),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn files_without_a_living_writer_are_leftovers() {
        let machine = fake("leftovers", &[("/pioneer/drivers/base/odometry", "not a channel"), ("/Other/x", "")]);
        let findings = below(&machine.path("/"));
        assert_eq!(findings.len(), 1, "{findings:?}");
        assert_eq!(findings[0].verdict, Verdict::Warn);
        assert!(findings[0].found.contains("1 file ("), "{findings:?}");
    }

    #[test]
    fn no_robots_are_no_trouble() {
        assert_eq!(below(&fake("no-robots", &[]).path("/nowhere"))[0].verdict, Verdict::Ok);
    }
}
