//! Where a device is: the text of a node's `device` setting.
//!
//! | text | client side | server side |
//! |---|---|---|
//! | `serial:/dev/ttyUSB0?baud=9600`, or just `/dev/ttyUSB0` | opens the port, 8N1, raw | – |
//! | `pty:/path` | opens an existing terminal, raw | makes a pseudo-terminal and a symbolic link to it |
//! | `tcp:host:port` | connects | listens, one client at a time |
//! | `memory:NAME`, `memory:NAME?baud=9600` | in-process link of the simulated host | the same link's other end |
//! | `simulator` | the body of the robot file's `[simulator]` table; the host says where that is | – |

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// What a serial port is opened with when its address names no rate [baud].
pub const DEFAULT_BAUD: u32 = 9600;

const SCHEMES: [&str; 5] = ["serial:", "pty:", "tcp:", "memory:", "simulator"];

/// Where a device is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A serial port.
    Serial {
        /// The device file.
        path: PathBuf,
        /// Rate [baud].
        baud: u32,
    },
    /// A terminal by its path.
    Pty {
        /// The terminal, or the symbolic link to make.
        path: PathBuf,
    },
    /// A TCP endpoint.
    Tcp {
        /// Name or address, without the brackets of IPv6.
        host: String,
        /// Port; 0 lets the kernel choose when listening.
        port: u16,
    },
    /// The body of the `[simulator]` table.
    Simulator,
    /// A link within one simulated host.
    Memory {
        /// The link's name.
        name: String,
        /// Rate of the modelled line [baud]; none: bytes arrive at once.
        baud: Option<u32>,
    },
}

/// Why a text is no device address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "device address \"{address}\": {reason}; write serial:/dev/ttyUSB0?baud=9600, tcp:host:port, pty:/path, \
     memory:NAME or simulator"
)]
pub struct AddressError {
    /// The text.
    pub address: String,
    /// What is wrong with it.
    pub reason: String,
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Address, AddressError> {
        parse(text).map_err(|reason| AddressError { address: text.into(), reason })
    }
}

fn parse(text: &str) -> Result<Address, String> {
    if text.contains('\0') {
        return Err("contains a NUL byte".into());
    }
    if text == "simulator" {
        return Ok(Address::Simulator);
    }
    if text.starts_with('/') {
        return serial(text);
    }
    match text.split_once(':') {
        Some(("serial", rest)) => serial(rest),
        Some(("pty", rest)) => Ok(Address::Pty { path: absolute(rest)? }),
        Some(("tcp", rest)) => tcp(rest),
        Some(("memory", rest)) => memory(rest),
        _ => Err(unknown(text)),
    }
}

fn serial(rest: &str) -> Result<Address, String> {
    let (path, baud) = with_baud(rest)?;
    Ok(Address::Serial { path: absolute(path)?, baud: baud.unwrap_or(DEFAULT_BAUD) })
}

fn memory(rest: &str) -> Result<Address, String> {
    let (name, baud) = with_baud(rest)?;
    match name.is_empty() || name.contains(char::is_whitespace) {
        true => Err("the link needs a name without blanks".into()),
        false => Ok(Address::Memory { name: name.into(), baud }),
    }
}

fn tcp(rest: &str) -> Result<Address, String> {
    let Some((host, port)) = rest.rsplit_once(':') else { return Err("the port is missing".into()) };
    let host = match host.strip_prefix('[') {
        Some(inner) => inner.strip_suffix(']').ok_or("\"[\" without \"]\"")?,
        None if host.contains(':') => return Err("an IPv6 address stands in brackets: tcp:[::1]:8101".into()),
        None => host,
    };
    if host.is_empty() || host.contains(char::is_whitespace) {
        return Err("the host is missing".into());
    }
    let port = port.parse().map_err(|_| format!("\"{port}\" is no port: 0 to 65535"))?;
    Ok(Address::Tcp { host: host.into(), port })
}

/// What stands before `?`, and the value of `baud=` behind it.
fn with_baud(rest: &str) -> Result<(&str, Option<u32>), String> {
    let Some((head, options)) = rest.split_once('?') else { return Ok((rest, None)) };
    let mut baud = None;
    for option in options.split('&') {
        match option.split_once('=') {
            Some(("baud", value)) => match value.parse() {
                Ok(rate @ 50..=4_000_000) => baud = Some(rate),
                _ => return Err(format!("\"{value}\" is no rate: 50 to 4000000 baud")),
            },
            _ => return Err(format!("unknown option \"{option}\"; valid: baud=9600")),
        }
    }
    Ok((head, baud))
}

fn absolute(path: &str) -> Result<PathBuf, String> {
    match path.starts_with('/') {
        true => Ok(PathBuf::from(path)),
        false if path.is_empty() => Err("the path is missing".into()),
        false => Err(format!("the path must be absolute: \"{path}\" does not begin with '/'")),
    }
}

fn unknown(text: &str) -> String {
    if text.is_empty() {
        return "is empty".into();
    }
    let word = text.split_once(':').map_or(text, |(scheme, _)| scheme);
    let near = SCHEMES.into_iter().map(|known| (strsim::damerau_levenshtein(word, known.trim_end_matches(':')), known));
    match near.min() {
        Some((distance, known)) if distance <= 2 => format!("unknown kind \"{word}\"; did you mean \"{known}\"?"),
        _ => format!("unknown kind \"{word}\""),
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Serial { path, baud } => write!(f, "serial:{}?baud={baud}", path.display()),
            Address::Pty { path } => write!(f, "pty:{}", path.display()),
            Address::Tcp { host, port } if host.contains(':') => write!(f, "tcp:[{host}]:{port}"),
            Address::Tcp { host, port } => write!(f, "tcp:{host}:{port}"),
            Address::Simulator => f.write_str("simulator"),
            Address::Memory { name, baud: None } => write!(f, "memory:{name}"),
            Address::Memory { name, baud: Some(baud) } => write!(f, "memory:{name}?baud={baud}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reason(text: &str) -> String {
        text.parse::<Address>().expect_err(text).reason
    }

    #[test]
    fn every_kind_of_address_parses_and_prints_as_written() {
        for text in [
            "serial:/dev/ttyUSB0?baud=38400",
            "pty:/tmp/pioneer",
            "tcp:127.0.0.1:8101",
            "tcp:[::1]:8101",
            "simulator",
            "memory:base",
            "memory:base?baud=9600",
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn a_bare_path_is_a_serial_port_at_the_default_rate() {
        let port = Address::Serial { path: "/dev/ttyS3".into(), baud: DEFAULT_BAUD };
        assert_eq!("/dev/ttyS3".parse(), Ok(port.clone()));
        assert_eq!("serial:/dev/ttyS3".parse(), Ok(port));
    }

    #[test]
    fn a_wrong_address_says_what_is_wrong_and_what_would_be_right() {
        assert!(reason("seriel:/dev/ttyUSB0").contains("did you mean \"serial:\""));
        assert!(reason("simulater").contains("did you mean \"simulator\""));
        assert!(reason("").contains("empty"));
        assert!(reason("tcp:8101").contains("port is missing"));
        assert!(reason("tcp:robot:99999").contains("no port"));
        assert!(reason("tcp::8101").contains("host"));
        assert!(reason("tcp:::1:8101").contains("brackets"));
        assert!(reason("serial:ttyUSB0").contains("absolute"));
        assert!(reason("serial:/dev/ttyUSB0?baud=fast").contains("no rate"));
        assert!(reason("serial:/dev/ttyUSB0?parity=even").contains("unknown option"));
        assert!(reason("pty:").contains("path is missing"));
        assert!(reason("memory:").contains("name"));
        assert!("usb:1".parse::<Address>().unwrap_err().to_string().contains("write serial:/dev/ttyUSB0"));
    }

    proptest! {
        #[test]
        fn no_text_panics_and_what_parses_parses_again(text in "\\PC{0,40}|(serial:|pty:|tcp:|memory:)\\PC{0,30}") {
            if let Ok(address) = text.parse::<Address>() {
                prop_assert_eq!(address.to_string().parse(), Ok(address));
            }
        }
    }
}
