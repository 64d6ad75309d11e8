//! A root of robots of the test's own.

use messages::{Message, bytemuck};
use runtime::channel::{Claim, Geometry, RawWriter, Tree};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A private folder of robots, removed in the end.
pub struct Place {
    pub root: PathBuf,
}

impl Place {
    pub fn new(name: &str) -> Place {
        let root = PathBuf::from(format!("/dev/shm/sinew-cli-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        Place { root }
    }

    pub fn tree(&self, robot: &str) -> Tree {
        Tree::shared(&self.root.join(robot)).unwrap()
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sinew"));
        command.args(arguments).env("SINEW_SHM", &self.root).env("SINEW_STATE", self.root.join("state"));
        command.env("NO_COLOR", "1").env_remove("CLICOLOR_FORCE").stdin(Stdio::null());
        command
    }

    /// Starts a command whose words are kept for [`Said::during`].
    pub fn start(&self, arguments: &[&str]) -> Child {
        self.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    pub fn sinew(&self, arguments: &[&str]) -> Said {
        Said::of(self.command(arguments).output().unwrap())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.root);
    }
}

/// What a command printed, and how it ended.
#[derive(Debug)]
pub struct Said {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Said {
    pub fn of(output: Output) -> Said {
        Said {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// What the command says, while the test does `each` as the node that it talks to.
    pub fn during(mut child: Child, mut each: impl FnMut()) -> Said {
        while child.try_wait().unwrap().is_none() {
            each();
            std::thread::yield_now();
        }
        Said::of(child.wait_with_output().unwrap())
    }

    pub fn json(&self) -> Vec<serde_json::Value> {
        self.out.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
    }
}

/// A channel of `M` and its writer.
pub struct Channel {
    pub writer: RawWriter,
}

impl Channel {
    pub fn make<M: Message>(tree: &Tree, path: &str, depth: usize, tail_capacity: usize) -> Channel {
        let schema = M::schema();
        let tail = schema.tail.as_ref().map_or(0, messages::Element::size);
        let geometry = Geometry {
            type_name: M::NAME.into(),
            layout_hash: schema.hash(),
            schema: schema.to_text(),
            fixed_bytes: size_of::<M>(),
            tail_element_bytes: tail,
            tail_capacity,
            depth,
        };
        Channel { writer: tree.writer(path, &geometry, Claim::Continue).unwrap() }
    }

    pub fn write<M: Message>(&mut self, stamp_ns: u64, message: &M, tail: &[M::Tail]) {
        self.writer.publish(stamp_ns, bytemuck::bytes_of(message), bytemuck::cast_slice(tail));
    }
}
