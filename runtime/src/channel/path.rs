//! Names of channels, as far as files care: `/folder/…/name`, each part of letters, digits, `_`, `-` and inner dots.

use super::error::ChannelError;

/// The longest path, in bytes.
const MOST_BYTES: usize = 512;
/// Leaves room for what the lock's and the unfinished file's names add.
const MOST_PART_BYTES: usize = 200;

/// The parts of a valid path.
pub(super) fn parts(path: &str) -> Result<Vec<&str>, ChannelError> {
    split(path, false)
}

/// The parts of a valid pattern, in which `*` stands for any one part.
pub(super) fn pattern_parts(pattern: &str) -> Result<Vec<&str>, ChannelError> {
    split(pattern, true)
}

/// Whether a channel or folder may have this name; lock files and unfinished rings are hidden behind a dot.
pub(super) fn is_part(part: &str) -> bool {
    (1..=MOST_PART_BYTES).contains(&part.len())
        && !part.starts_with('.')
        && part.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.'))
}

/// Whether `path` is covered by the parts of a pattern.
pub(super) fn covers(pattern: &[&str], path: &str) -> bool {
    let mut rest = path.strip_prefix('/').unwrap_or(path).split('/');
    pattern.iter().all(|&wanted| rest.next().is_some_and(|part| wanted == "*" || wanted == part))
        && rest.next().is_none()
}

/// Whether one of two different paths would be a folder of the other.
pub(super) fn nested(a: &str, b: &str) -> bool {
    let within = |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('/'));
    within(a, b) || within(b, a)
}

fn split(path: &str, wild: bool) -> Result<Vec<&str>, ChannelError> {
    let bad = |why: String| ChannelError::BadPath { path: path.into(), why };
    let Some(rest) = path.strip_prefix('/') else { return Err(bad("it must begin with '/'".into())) };
    if path.len() > MOST_BYTES {
        return Err(bad(format!("it is longer than {MOST_BYTES} bytes")));
    }
    rest.split('/')
        .map(|part| match part {
            "*" if wild => Ok(part),
            _ if is_part(part) => Ok(part),
            _ => Err(bad(format!("\"{part}\" is no name; use letters, digits, '_' and '-'"))),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_cannot_leave_its_tree() {
        for bad in ["", "/", "a/b", "/a//b", "/a/", "/../a", "/a/..", "/a/.b", "/a b", "/a\0", "/*", "/a/*/b"] {
            assert!(parts(bad).is_err(), "{bad:?}");
        }
        assert_eq!(parts("/drivers/base/sonar").unwrap(), ["drivers", "base", "sonar"]);
    }

    #[test]
    fn a_star_covers_one_part() {
        let pattern = pattern_parts("/actions/*/proposal").unwrap();
        assert!(covers(&pattern, "/actions/forward/proposal"));
        assert!(!covers(&pattern, "/actions/forward/left/proposal"));
        assert!(!covers(&pattern, "/actions/forward/proposal/more"));
        assert!(!covers(&pattern, "/actions/forward"));
    }
}
