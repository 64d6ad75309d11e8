//! Whom to call: a node's path and one of its commands.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Name of a node's socket in the node's folder of the robot's tree.
pub const SOCKET_NAME: &str = ".calls";

/// What the kernel's address of a Unix socket holds, without the closing NUL.
const MAX_SOCKET_PATH_BYTES: usize = 107;

/// A command of a node, as in a robot file: `/drivers/base enable`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    /// The node: `/<layer>/<instance>`.
    pub path: String,
    /// The command.
    pub command: String,
}

/// Why a text names no command or no node.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TargetError {
    /// Not two words.
    #[error("\"{0}\" names no command: write \"/<layer>/<node> <command>\", as in \"/drivers/base enable\"")]
    Words(String),
    /// Not a node's path.
    #[error("\"{0}\" is no node's path: write /<layer>/<node>, as in /drivers/base")]
    Path(String),
    /// The socket's path does not fit into the kernel's address.
    #[error(
        "the path of the call socket, {path}, is {} bytes long and the kernel takes {MAX_SOCKET_PATH_BYTES}: choose a \
         shorter root (SINEW_SHM) or shorter names", path.len()
    )]
    TooLong {
        /// The socket's path.
        path: String,
    },
}

impl FromStr for Target {
    type Err = TargetError;

    fn from_str(text: &str) -> Result<Target, TargetError> {
        let mut words = text.split_whitespace();
        let (Some(path), Some(command), None) = (words.next(), words.next(), words.next()) else {
            return Err(TargetError::Words(text.into()));
        };
        node_folder(path)?;
        Ok(Target { path: path.into(), command: command.into() })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.path, self.command)
    }
}

/// The socket that the node at `path` answers on: `<root>/<layer>/<instance>/.calls`.
pub fn socket_path(root: &Path, path: &str) -> Result<PathBuf, TargetError> {
    let socket = root.join(node_folder(path)?).join(SOCKET_NAME);
    match socket.as_os_str().len() <= MAX_SOCKET_PATH_BYTES {
        true => Ok(socket),
        false => Err(TargetError::TooLong { path: socket.display().to_string() }),
    }
}

/// The node's folder relative to the robot's root.
fn node_folder(path: &str) -> Result<&str, TargetError> {
    let word = |part: &str| {
        !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-')
    };
    let folder = path.strip_prefix('/').filter(|rest| rest.split('/').count() == 2 && rest.split('/').all(word));
    folder.ok_or_else(|| TargetError::Path(path.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_a_nodes_path_and_a_command() {
        let target: Target = "/drivers/base enable".parse().unwrap();
        assert_eq!((target.path.as_str(), target.command.as_str()), ("/drivers/base", "enable"));
        assert_eq!(target.to_string(), "/drivers/base enable");
    }

    #[test]
    fn a_wrong_target_says_how_to_write_it() {
        assert!(matches!("/drivers/base".parse::<Target>(), Err(TargetError::Words(_))));
        assert!(matches!("/drivers/base/enable now".parse::<Target>(), Err(TargetError::Path(_))));
        assert!(matches!("drivers/base enable".parse::<Target>(), Err(TargetError::Path(_))));
        assert!(matches!("/drivers/.. enable".parse::<Target>(), Err(TargetError::Path(_))));
    }

    #[test]
    fn the_socket_lies_in_the_nodes_folder_and_fits_the_kernels_address() {
        let socket = socket_path(Path::new("/dev/shm/sinew/pioneer"), "/drivers/base").unwrap();
        assert_eq!(socket, Path::new("/dev/shm/sinew/pioneer/drivers/base/.calls"));
        let deep = format!("/{}", "x".repeat(100));
        let error = socket_path(Path::new(&deep), "/drivers/base").unwrap_err();
        assert!(error.to_string().contains("121 bytes long"), "{error}");
    }
}
