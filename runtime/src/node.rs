//! The unit of work, and how node types are listed.

use crate::path::Layer;
use crate::ports::Ports;
use crate::time::Time;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

/// A unit of work: opens its ports, then steps, on a period or on a new sample, within a deadline.
///
/// `open` only declares (so `sinew check` and `sinew graph` need no hardware); `step` reads, calls one pure function,
/// writes. A step neither allocates nor blocks nor logs nor reads a clock.
pub trait Node: Sized + 'static {
    /// The type's name in the robot file.
    const TYPE: &'static str;
    /// The folder of everything that it writes.
    const LAYER: Layer;
    /// Its settings in the robot file.
    type Config: DeserializeOwned + JsonSchema;

    /// Declares ports, devices and calls, and checks the settings. Touches no device.
    fn open(ports: &mut Ports, config: Self::Config) -> Result<Self, OpenError>;

    /// Runs once before the first step.
    fn start(&mut self, _now: Time) -> Result<(), Fault> {
        Ok(())
    }

    /// One unit of work at `now`.
    fn step(&mut self, now: Time) -> Result<(), Fault>;

    /// Runs once after the last step of an ordered stop: a driver sends its device the last bytes.
    fn stop(&mut self, _now: Time) {}
}

/// What a step could not do. The robot file says what follows; safety never depends on it being reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Fault(&'static str);

impl Fault {
    /// A fault with its reason.
    pub const fn new(reason: &'static str) -> Fault {
        Fault(reason)
    }
}

/// Why a node could not be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// A setting is out of its bounds or contradicts another.
    #[error("{reason}")]
    Config {
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A file of the robot cannot be used.
    #[error("{reason}")]
    Resource {
        /// Which, where and why.
        reason: String,
    },
    /// A port is wired wrongly.
    #[error("port \"{port}\": {reason}")]
    Port {
        /// The port's name.
        port: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A device address cannot be used.
    #[error("device: {reason}")]
    Device {
        /// What is wrong with it.
        reason: String,
    },
}

impl OpenError {
    /// A wrong setting.
    pub fn config(reason: impl Into<String>) -> OpenError {
        OpenError::Config { reason: reason.into() }
    }

    /// An unusable file.
    pub fn resource(reason: impl Into<String>) -> OpenError {
        OpenError::Resource { reason: reason.into() }
    }

    pub(crate) fn port(port: &str, reason: impl Into<String>) -> OpenError {
        OpenError::Port { port: port.into(), reason: reason.into() }
    }
}

/// A node without its type.
pub trait AnyNode {
    /// See [`Node::start`].
    fn start(&mut self, now: Time) -> Result<(), Fault>;
    /// See [`Node::step`].
    fn step(&mut self, now: Time) -> Result<(), Fault>;
    /// See [`Node::stop`].
    fn stop(&mut self, now: Time);
}

impl<N: Node> AnyNode for N {
    fn start(&mut self, now: Time) -> Result<(), Fault> {
        Node::start(self, now)
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        Node::step(self, now)
    }

    fn stop(&mut self, now: Time) {
        Node::stop(self, now);
    }
}

type OpenFn = fn(&mut Ports, toml::Table) -> Result<Box<dyn AnyNode>, OpenError>;
type CheckFn = fn(toml::de::ValueDeserializer<'_>) -> Result<(), toml::de::Error>;

/// A node type as a registry lists it: one line per node.
#[derive(Clone, Copy)]
pub struct NodeType {
    /// The type's name in the robot file.
    pub name: &'static str,
    /// Its layer.
    pub layer: Layer,
    /// Opens an instance.
    pub open: OpenFn,
    /// Checks the settings as written, so that an error knows its place.
    pub check_config: CheckFn,
    /// The settings' JSON Schema.
    pub config_schema: fn(&mut schemars::SchemaGenerator) -> schemars::Schema,
}

impl NodeType {
    /// The registry's line for `N`.
    pub const fn of<N: Node>() -> NodeType {
        NodeType {
            name: N::TYPE,
            layer: N::LAYER,
            open: |ports, config| {
                let config = N::Config::deserialize_table(config)?;
                Ok(Box::new(N::open(ports, config)?))
            },
            check_config: |value| <N::Config as serde::Deserialize>::deserialize(value).map(|_| ()),
            config_schema: |generator| generator.subschema_for::<N::Config>(),
        }
    }
}

impl std::fmt::Debug for NodeType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "NodeType({}/{})", self.layer, self.name)
    }
}

trait FromTable: DeserializeOwned {
    fn deserialize_table(table: toml::Table) -> Result<Self, OpenError> {
        table.try_into().map_err(|e: toml::de::Error| OpenError::config(e.message().to_owned()))
    }
}

impl<C: DeserializeOwned> FromTable for C {}
