//! What a strict node may touch: its own folder, and what the robot file names in its settings.
//!
//! Every text in a node's `config` that is a device address or an absolute path counts as named; nothing else does. So
//! what a node may touch can be read from the robot file, before anything is started.

use runtime::device::Address;
use runtime::robot::{NodeSpec, Resources, Robot};
use runtime::{Layer, TWINS};
use std::net::IpAddr;
use std::path::{Path, PathBuf};

/// What a process of nodes needs of the machine.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Needs {
    /// Files and folders to read.
    pub read: Vec<PathBuf>,
    /// Devices to open, read, write and set.
    pub devices: Vec<PathBuf>,
    /// Folders to make, write and remove files in.
    pub own: Vec<PathBuf>,
    /// TCP ports to connect to.
    pub connect: Vec<u16>,
    /// TCP ports to listen on.
    pub listen: Vec<u16>,
    /// Hosts are named and must be looked up.
    pub names: bool,
    /// Makes pseudo-terminals, and gives them to whoever is to open them.
    pub serves_terminals: bool,
}

impl Needs {
    /// What `nodes` of `robot` need, the robot's channels being below `root`.
    pub fn of(robot: &Robot, nodes: &[&NodeSpec], root: &Path) -> Needs {
        let mut needs = Needs::default();
        needs.read.extend([root.to_owned(), "/proc".into(), "/sys".into()]);
        needs.devices.extend(["/dev/null", "/dev/zero", "/dev/urandom"].map(PathBuf::from));
        if let Resources::Folder(folder) = &robot.resources {
            needs.read.push(folder.clone());
        }
        for node in nodes {
            needs.own.push(root.join(node.path().trim_start_matches('/')));
            let simulates = node.kind.layer == Layer::Simulator;
            if simulates {
                needs.serves_terminals = true;
                needs.own.push(root.join(TWINS));
                needs.devices.push("/dev/ptmx".into());
            }
            if simulates || node.kind.layer == Layer::Drivers {
                needs.devices.push("/dev/pts".into());
            }
            texts(&toml::Value::Table(node.config.clone()), &mut |text| needs.named(text, simulates));
        }
        if needs.names {
            needs.read.extend(["/etc", "/lib", "/lib64", "/usr/lib", "/run/systemd/resolve"].map(PathBuf::from));
        }
        needs
    }

    /// Whether it speaks over IP at all.
    pub fn internet(&self) -> bool {
        !(self.connect.is_empty() && self.listen.is_empty())
    }

    fn named(&mut self, text: &str, serves: bool) {
        match text.parse::<Address>() {
            Ok(Address::Tcp { host, port }) => {
                self.names |= !serves && host.parse::<IpAddr>().is_err();
                if serves { &mut self.listen } else { &mut self.connect }.push(port);
            }
            Ok(Address::Pty { path }) if serves => self.own.extend(path.parent().map(Path::to_owned)),
            Ok(Address::Pty { path }) => self.devices.push(path),
            Ok(Address::Serial { path, .. }) if path.starts_with("/dev") => self.devices.push(path),
            // A plain file, which may be replaced while the node runs: its folder.
            Ok(Address::Serial { path, .. }) => self.read.extend(path.parent().map(Path::to_owned)),
            Ok(Address::Simulator | Address::Memory { .. }) | Err(_) => {}
        }
    }
}

/// The device addresses in a node's settings.
pub(super) fn addresses(node: &NodeSpec) -> Vec<Address> {
    let mut found = Vec::new();
    texts(&toml::Value::Table(node.config.clone()), &mut |text| found.extend(text.parse().ok()));
    found
}

/// Every text in `value`.
fn texts(value: &toml::Value, found: &mut dyn FnMut(&str)) {
    match value {
        toml::Value::String(text) => found(text),
        toml::Value::Array(values) => values.iter().for_each(|value| texts(value, found)),
        toml::Value::Table(table) => table.iter().for_each(|(_, value)| texts(value, found)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(text: &str, serves: bool) -> Needs {
        let mut needs = Needs::default();
        let config = toml::toml! { settings = { list = [1, "plain"] } };
        texts(&toml::Value::Table(config), &mut |text| needs.named(text, serves));
        assert_eq!(needs, Needs::default(), "an ordinary text names nothing");
        needs.named(text, serves);
        needs
    }

    #[test]
    fn a_named_device_and_nothing_beside_it_is_needed() {
        assert_eq!(named("/dev/ttyUSB0", false).devices, [PathBuf::from("/dev/ttyUSB0")]);
        assert_eq!(named("pty:/tmp/robot/tty", false).devices, [PathBuf::from("/tmp/robot/tty")]);
        assert_eq!(named("pty:/tmp/robot/tty", true).own, [PathBuf::from("/tmp/robot")]);
        assert_eq!(named("/sys/class/gpio/gpio17/value", false).read, [PathBuf::from("/sys/class/gpio/gpio17")]);
    }

    #[test]
    fn a_network_is_needed_only_where_an_address_names_one() {
        assert!(!named("/dev/ttyUSB0", false).internet());
        let literal = named("tcp:192.168.0.7:8101", false);
        assert_eq!((literal.connect.as_slice(), literal.internet(), literal.names), (&[8101][..], true, false));
        assert!(named("tcp:robot.local:8101", false).names);
        assert_eq!(named("tcp:127.0.0.1:8101", true).listen, [8101]);
    }
}
