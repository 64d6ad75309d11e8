//! Names in the robot's tree: `/<layer>/<instance>/<port>`.

use std::fmt;

/// The first folder of a path: what its writer does. The order is the flow, from the device to the wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// Worlds and bodies that answer in the devices' protocols.
    Simulator,
    /// Devices.
    Drivers,
    /// Quantities of the world from samples.
    Perception,
    /// Where am I, what is where, which way.
    Navigation,
    /// Orders.
    Tasks,
    /// Behaviours.
    Actions,
    /// Arbitration, modes.
    Coordinator,
    /// Limits, guard zones, kinematics.
    Motion,
    /// Other robots and machines.
    Link,
    /// The supervisor's own paths.
    Supervisor,
}

impl Layer {
    /// All layers, in flow order.
    pub const ALL: [Layer; 10] = [
        Layer::Simulator,
        Layer::Drivers,
        Layer::Perception,
        Layer::Navigation,
        Layer::Tasks,
        Layer::Actions,
        Layer::Coordinator,
        Layer::Motion,
        Layer::Link,
        Layer::Supervisor,
    ];

    /// The folder's name.
    pub const fn folder(self) -> &'static str {
        match self {
            Layer::Simulator => "simulator",
            Layer::Drivers => "drivers",
            Layer::Perception => "perception",
            Layer::Navigation => "navigation",
            Layer::Tasks => "tasks",
            Layer::Actions => "actions",
            Layer::Coordinator => "coordinator",
            Layer::Motion => "motion",
            Layer::Link => "link",
            Layer::Supervisor => "supervisor",
        }
    }

    /// The layer whose folder is called `name`.
    pub fn from_folder(name: &str) -> Option<Layer> {
        Layer::ALL.into_iter().find(|layer| layer.folder() == name)
    }
}

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.folder())
    }
}

/// Why a text is no path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// A path is absolute.
    #[error("path \"{0}\" must begin with '/': write \"/{0}\"")]
    Relative(String),
    /// A path has exactly three parts.
    #[error("path \"{0}\" must have three parts: /<layer>/<node>/<port>")]
    Parts(String),
    /// The first part names a layer.
    #[error("path \"{path}\" begins with \"{layer}\", which is no layer; layers are {}", layers())]
    Layer {
        /// The whole path.
        path: String,
        /// Its first part.
        layer: String,
    },
    /// The other parts are names.
    #[error("\"{part}\" in path \"{path}\" is no name: use 1 to 32 of a-z, 0-9 and _, beginning with a letter")]
    Name {
        /// The whole path.
        path: String,
        /// The part that is no name.
        part: String,
    },
}

fn layers() -> String {
    Layer::ALL.map(Layer::folder).join(", ")
}

/// Whether `text` can name a node, a port or a robot: 1 to 32 of a-z, 0-9 and _, beginning with a letter.
pub fn is_name(text: &str) -> bool {
    text.len() <= 32
        && text.starts_with(|c: char| c.is_ascii_lowercase())
        && text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}

/// The parts of `path`: layer, node, port. `*` stands for any node in the patterns of typed sets.
pub fn split_path(path: &str) -> Result<(Layer, &str, &str), PathError> {
    let Some(rest) = path.strip_prefix('/') else { return Err(PathError::Relative(path.into())) };
    let mut parts = rest.split('/');
    let (Some(layer), Some(node), Some(port), None) = (parts.next(), parts.next(), parts.next(), parts.next()) else {
        return Err(PathError::Parts(path.into()));
    };
    let Some(layer) = Layer::from_folder(layer) else {
        return Err(PathError::Layer { path: path.into(), layer: layer.into() });
    };
    for part in [node, port] {
        if !(is_name(part) || part == "*" && std::ptr::eq(part, node)) {
            return Err(PathError::Name { path: path.into(), part: part.into() });
        }
    }
    Ok((layer, node, port))
}

/// Whether `path` is a pattern for a typed set.
pub fn is_pattern(path: &str) -> bool {
    path.contains('*')
}

/// Whether `pattern` (which may have `*` for the node) covers `path`.
pub fn covers(pattern: &str, path: &str) -> bool {
    match (split_path(pattern), split_path(path)) {
        (Ok((layer, node, port)), Ok((other_layer, other_node, other_port))) => {
            layer == other_layer && port == other_port && (node == "*" || node == other_node)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_names_its_writers_layer_node_and_port() {
        assert_eq!(split_path("/drivers/base/sonar"), Ok((Layer::Drivers, "base", "sonar")));
    }

    #[test]
    fn a_path_that_is_none_says_why() {
        assert!(matches!(split_path("drivers/base/sonar"), Err(PathError::Relative(_))));
        assert!(matches!(split_path("/drivers/base"), Err(PathError::Parts(_))));
        assert!(matches!(split_path("/driver/base/sonar"), Err(PathError::Layer { .. })));
        assert!(matches!(split_path("/drivers/../sonar"), Err(PathError::Name { .. })));
        assert!(matches!(split_path("/drivers/base/*"), Err(PathError::Name { .. })));
    }

    #[test]
    fn a_pattern_covers_any_node_of_its_layer() {
        assert!(covers("/actions/*/proposal", "/actions/forward/proposal"));
        assert!(!covers("/actions/*/proposal", "/actions/forward/free_sectors"));
        assert!(!covers("/actions/*/proposal", "/motion/forward/proposal"));
    }
}
