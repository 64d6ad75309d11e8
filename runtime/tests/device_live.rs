//! Devices over real terminals and sockets: what comes, what goes, and what is said when nothing does.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use std::fs::File;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use calls_support::{Arrivals, root};
use runtime::Device;
use runtime::device::{Address, DeviceError, DeviceLink, WhyClosed};
use runtime::pump::{Pump, PumpBuilder};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// Nodes started so far.
static NODES: AtomicUsize = AtomicUsize::new(0);

/// A device with the pump that runs it.
struct Running {
    home: PathBuf,
    path: String,
    device: Device,
    arrivals: Arrivals,
    pump: Pump,
}

impl Running {
    fn start(device: Device, root: &Path) -> Running {
        Running::start_with(device, root, |_| {})
    }

    fn start_with(device: Device, root: &Path, prepare: impl FnOnce(&mut PumpBuilder)) -> Running {
        // Each node has its own folder for its call socket.
        let number = NODES.fetch_add(1, Ordering::Relaxed);
        let path = format!("/drivers/node{number}");
        let mut builder = PumpBuilder::new(&path);
        builder.attach(&device);
        let arrivals = Arrivals::of(&mut builder);
        prepare(&mut builder);
        let home = root.join(format!("robot{number}"));
        std::fs::create_dir(&home).unwrap();
        let pump = builder.spawn(&home).unwrap();
        Running { home, path, device, arrivals, pump }
    }

    fn client(address: &str, root: &Path) -> Running {
        Running::start(Device::detached(address.parse().unwrap()), root)
    }

    fn server(address: &str, root: &Path) -> Running {
        Running::start(Device::detached_server(address.parse().unwrap()), root)
    }

    /// Waits until the link is so.
    fn until_link(&self, wanted: impl Fn(DeviceLink) -> bool) -> DeviceLink {
        self.arrivals.until(|| Some(self.device.link()).filter(|link| wanted(*link)))
    }

    fn until_open(&self) -> u64 {
        match self.until_link(DeviceLink::is_open) {
            DeviceLink::Open { generation } => generation,
            other => unreachable!("{other:?}"),
        }
    }

    fn until_closed(&self, why: WhyClosed) {
        self.until_link(|link| link == DeviceLink::Closed { why });
    }

    /// Waits for `count` bytes.
    fn bytes(&mut self, count: usize) -> Vec<u8> {
        let Running { device, arrivals, .. } = self;
        let mut bytes = vec![0; count];
        let mut filled = 0;
        arrivals.until(|| {
            filled += device.receive(&mut bytes[filled..]);
            (filled == count).then_some(())
        });
        bytes
    }
}

fn pty_address(root: &Path) -> (String, PathBuf) {
    let link = root.join("tty");
    (format!("pty:{}", link.display()), link)
}

fn every_byte() -> Vec<u8> {
    (0..=255).collect()
}

#[test]
fn every_byte_crosses_a_terminal_unchanged_both_ways() {
    let root = root();
    let (address, _) = pty_address(root.path());
    let mut server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    let mut client = Running::client(&address, root.path());
    client.until_open();
    server.until_open();
    client.device.send(&every_byte()).unwrap();
    assert_eq!(server.bytes(256), every_byte());
    let before = calls_support::now();
    server.device.send(&every_byte()).unwrap();
    assert_eq!(client.bytes(256), every_byte());
    assert!(client.device.arrived() >= before);
}

#[test]
fn a_served_terminal_notices_every_client_and_gives_each_a_clean_line() {
    let root = root();
    let (address, link) = pty_address(root.path());
    let mut server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    assert_eq!(server.device.send(b"x"), Err(DeviceError::Closed(WhyClosed::NoClient)));
    for generation in 1..=5 {
        // A client of another make, that sets nothing up.
        let mut client = open_terminal(&link);
        assert_eq!(server.until_open(), generation);
        client.write_all(&[3, 17, 19, generation as u8]).unwrap();
        assert_eq!(server.bytes(4), [3, 17, 19, generation as u8]);
        server.device.send(b"\r\n").unwrap();
        let mut answer = [0; 2];
        client.read_exact(&mut answer).unwrap();
        assert_eq!(&answer, b"\r\n");
        // It leaves without having read this.
        server.device.send(b"old").unwrap();
        drop(client);
        server.until_closed(WhyClosed::NoClient);
    }
}

#[test]
fn bytes_of_a_client_that_is_gone_already_still_arrive() {
    let root = root();
    let (address, link) = pty_address(root.path());
    let mut server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    open_terminal(&link).write_all(b"stop").unwrap();
    assert_eq!(server.bytes(4), b"stop");
}

#[test]
fn a_client_says_hung_up_when_its_peer_vanishes_and_comes_back_with_it() {
    let root = root();
    let (address, link) = pty_address(root.path());
    let server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    let mut client = Running::client(&address, root.path());
    assert_eq!(client.until_open(), 1);
    server.pump.stop();
    assert!(!link.exists() && std::fs::symlink_metadata(&link).is_err());
    client.until_closed(WhyClosed::NoSuchPort);
    assert_eq!(client.device.send(b"x"), Err(DeviceError::Closed(WhyClosed::NoSuchPort)));
    let mut server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    assert_eq!(client.until_open(), 2);
    client.device.send(b"again").unwrap();
    server.until_open();
    assert_eq!(server.bytes(5), b"again");
}

#[test]
fn a_link_that_a_killed_server_left_is_replaced_and_a_file_is_not() {
    let root = root();
    let (address, link) = pty_address(root.path());
    std::os::unix::fs::symlink("/dev/pts/no_such_terminal", &link).unwrap();
    let server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    server.pump.stop();
    std::fs::write(&link, "a letter").unwrap();
    let server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::Busy);
    server.pump.stop();
    assert_eq!(std::fs::read_to_string(&link).unwrap(), "a letter");
}

#[test]
fn a_reopened_link_is_a_new_one() {
    let root = root();
    let (address, _) = pty_address(root.path());
    let server = Running::server(&address, root.path());
    server.until_closed(WhyClosed::NoClient);
    let mut client = Running::client(&address, root.path());
    assert_eq!(client.until_open(), 1);
    client.device.reopen();
    client.until_link(|link| link == DeviceLink::Open { generation: 2 });
}

#[test]
fn a_missing_port_a_forbidden_one_and_a_file_say_so() {
    let root = root();
    let client = Running::client("serial:/dev/no_such_port?baud=9600", root.path());
    client.until_closed(WhyClosed::NoSuchPort);
    let file = root.path().join("file");
    std::fs::write(&file, "").unwrap();
    let client = Running::client(&format!("serial:{}", file.display()), root.path());
    client.until_closed(WhyClosed::NotATerminal);

    let (_master, name) = bare_pty();
    rustix::fs::chmod(&name, rustix::fs::Mode::empty()).unwrap();
    let device = Device::detached(Address::Pty { path: name });
    // Root may open anything: the pump's thread becomes nobody first.
    let client = Running::start_with(device, root.path(), |builder| {
        if rustix::process::geteuid().is_root() {
            builder.on_start(|| rustix::thread::set_thread_uid(rustix::process::Uid::from_raw(65534)).unwrap());
        }
    });
    client.until_closed(WhyClosed::PermissionDenied);
    let text = WhyClosed::PermissionDenied.explain(client.device.address());
    assert!(text.contains("permission denied") && text.contains("dialout"), "{text}");
}

#[test]
fn people_hear_once_why_a_link_is_down_and_when_it_is_up() {
    let root = root();
    let (address, _) = pty_address(root.path());
    let lines = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&lines);
    let client = Running::start_with(Device::detached(address.parse().unwrap()), root.path(), move |builder| {
        builder.log(Arc::new(move |line| heard.lock().unwrap().push(line.to_owned())));
    });
    client.until_closed(WhyClosed::NoSuchPort);
    let server = Running::server(&address, root.path());
    client.until_open();
    server.pump.stop();
    client.arrivals.until(|| (lines.lock().unwrap().len() >= 3).then_some(()));
    let lines = lines.lock().unwrap();
    let ends = [": no such port: start the program that makes it, or correct the path", ": open", ": hung up: check"];
    for (line, end) in lines.iter().zip(ends) {
        assert!(line.starts_with(&format!("device {address}")) && line.contains(end), "{line}");
    }
}

#[test]
fn an_address_of_the_simulated_host_is_refused_by_the_live_one() {
    let root = root();
    for address in ["simulator", "memory:base"] {
        Running::client(address, root.path()).until_closed(WhyClosed::NotPossible);
        Running::server(address, root.path()).until_closed(WhyClosed::NotPossible);
    }
    Running::server("serial:/dev/ttyS0", root.path()).until_closed(WhyClosed::NotPossible);
}

#[test]
fn a_tcp_server_takes_one_client_at_a_time() {
    let root = root();
    let mut server = Running::server("tcp:127.0.0.1:0", root.path());
    server.until_closed(WhyClosed::NoClient);
    let port = server.device.listening_port().unwrap();
    let connect = || TcpStream::connect(("127.0.0.1", port)).unwrap();
    let mut first = connect();
    assert_eq!(server.until_open(), 1);
    // The second is turned away at once.
    let mut second = connect();
    second.set_read_timeout(Some(calls_support::STUCK)).unwrap();
    let ended = second.read(&mut [0; 1]);
    assert!(matches!(&ended, Ok(0)) || ended.is_err_and(|error| error.kind() == std::io::ErrorKind::ConnectionReset));
    first.write_all(b"hello").unwrap();
    assert_eq!(server.bytes(5), b"hello");
    server.device.send(b"you").unwrap();
    let mut answer = [0; 3];
    first.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"you");
    drop(first);
    // A successor that comes at once is not turned away: its predecessor's end came first.
    let _third = connect();
    server.until_link(|link| link == DeviceLink::Open { generation: 2 });
}

#[test]
fn a_tcp_client_finds_its_server_when_that_appears_and_loses_it_when_it_goes() {
    let root = root();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    drop(listener);
    let mut client = Running::client(&format!("tcp:localhost:{port}"), root.path());
    client.until_closed(WhyClosed::Refused);
    let listener = TcpListener::bind(("127.0.0.1", port)).unwrap();
    let (mut peer, _) = listener.accept().unwrap();
    assert_eq!(client.until_open(), 1);
    peer.write_all(b"abc").unwrap();
    assert_eq!(client.bytes(3), b"abc");
    drop((peer, listener));
    client.until_link(|link| matches!(link, DeviceLink::Closed { why: WhyClosed::HungUp | WhyClosed::Refused }));
}

#[test]
fn a_host_without_an_address_and_a_taken_port_say_so() {
    let root = root();
    // Longer than a name may be: no server need be asked.
    let name = "x".repeat(64);
    Running::client(&format!("tcp:{name}:8101"), root.path()).until_closed(WhyClosed::UnknownHost);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let server = Running::server(&format!("tcp:127.0.0.1:{port}"), root.path());
    server.until_closed(WhyClosed::Busy);
    assert!(WhyClosed::Busy.explain(server.device.address()).contains("another program listens there"));
    drop(listener);
    server.until_closed(WhyClosed::NoClient);
}

#[test]
fn a_step_that_does_not_read_holds_the_sender_back_and_loses_nothing() {
    let root = root();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let mut client = Running::client(&format!("tcp:127.0.0.1:{port}"), root.path());
    let (mut peer, _) = listener.accept().unwrap();
    client.until_open();
    let sent: Vec<u8> = (0..200_000u32).map(|index| (index % 251) as u8).collect();
    let expected = sent.clone();
    let sender = std::thread::spawn(move || peer.write_all(&sent).unwrap());
    // More than the ring holds, in pieces that leave it full again and again.
    assert_eq!(client.bytes(200_000), expected);
    sender.join().unwrap();
}

#[test]
fn a_device_that_does_not_read_is_full_and_what_was_taken_arrives_whole_and_in_order() {
    let root = root();
    let (master, name) = bare_pty();
    let mut client = Running::client(&format!("pty:{}", name.display()), root.path());
    client.until_open();
    let taken = send_until_full(&mut client.device);
    assert_eq!(client.device.refused_sends(), 1);
    let mut arrived = vec![0; taken.len()];
    let mut master = File::from(master);
    master.read_exact(&mut arrived).unwrap();
    assert_eq!(arrived, taken);
    // There is room again.
    client.device.send(b"more").unwrap();
}

#[test]
fn the_last_bytes_of_an_ordered_stop_reach_the_device() {
    let root = root();
    let (master, name) = bare_pty();
    let mut client = Running::client(&format!("pty:{}", name.display()), root.path());
    client.until_open();
    // So many that the kernel does not take them at once.
    let taken = send_until_full(&mut client.device);
    let calls = client.home.join(&client.path[1..]).join(".calls");
    let pump = client.pump;
    let stopping = std::thread::spawn(move || pump.stop());
    // The pump closes everything else first.
    while calls.exists() {
        std::thread::yield_now();
    }
    let mut arrived = vec![0; taken.len()];
    File::from(master).read_exact(&mut arrived).unwrap();
    stopping.join().unwrap();
    assert_eq!(client.device.link(), DeviceLink::Closed { why: WhyClosed::Stopped });
    assert_eq!(arrived, taken);
}

#[test]
fn packets_keep_their_order_while_the_device_reads_in_bits() {
    let root = root();
    let (master, name) = bare_pty();
    let mut client = Running::client(&format!("pty:{}", name.display()), root.path());
    client.until_open();
    const PACKETS: usize = 5_000;
    let reader = std::thread::spawn(move || {
        let mut arrived = Vec::new();
        let mut chunk = [0; 37];
        let mut master = File::from(master);
        while arrived.len() < PACKETS * 20 {
            let count = master.read(&mut chunk).unwrap();
            arrived.extend_from_slice(&chunk[..count]);
        }
        arrived
    });
    for packet in 0..PACKETS {
        while client.device.send(&[packet as u8; 20]) == Err(DeviceError::Full) {
            std::thread::yield_now();
        }
    }
    let expected: Vec<u8> = (0..PACKETS).flat_map(|packet| [packet as u8; 20]).collect();
    assert!(reader.join().unwrap() == expected);
}

/// Sends packets until one is refused, and gives all that was taken.
fn send_until_full(device: &mut Device) -> Vec<u8> {
    let mut taken = Vec::new();
    for packet in 0.. {
        let bytes = [packet as u8; 100];
        match device.send(&bytes) {
            Ok(()) => taken.extend_from_slice(&bytes),
            Err(error) => {
                assert_eq!(error, DeviceError::Full);
                break;
            }
        }
    }
    taken
}

#[test]
fn the_rate_follows_the_address_and_then_the_step() {
    let root = root();
    let (master, name) = bare_pty();
    let rate = || rustix::termios::tcgetattr(&master).unwrap().output_speed();
    let mut client = Running::client(&format!("serial:{}?baud=38400", name.display()), root.path());
    client.until_open();
    assert_eq!(rate(), 38400);
    client.device.set_baud(115_200);
    while rate() != 115_200 {
        std::thread::yield_now();
    }
}

#[test]
fn one_pump_runs_several_devices_and_refuses_one_that_another_runs() {
    let root = root();
    let (_first, first_name) = bare_pty();
    let (_second, second_name) = bare_pty();
    let first = Device::detached(Address::Pty { path: first_name });
    let second = Running::start_with(Device::detached(Address::Pty { path: second_name }), root.path(), |builder| {
        builder.attach(&first);
    });
    second.until_open();
    second.arrivals.until(|| first.link().is_open().then_some(()));
    let mut builder = PumpBuilder::new("/drivers/thief");
    builder.attach(&first);
    let error = builder.spawn(root.path()).unwrap_err();
    assert!(error.to_string().contains("attached to two pumps"), "{error}");
}

/// A pseudo-terminal without a server: its master and the client's path.
fn bare_pty() -> (OwnedFd, PathBuf) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
    (master, PathBuf::from(name))
}

/// The client's side of a terminal, as a program without any idea of terminals opens it.
fn open_terminal(path: &Path) -> File {
    let flags = rustix::fs::OFlags::RDWR | rustix::fs::OFlags::NOCTTY | rustix::fs::OFlags::CLOEXEC;
    File::from(rustix::fs::open(path, flags, rustix::fs::Mode::empty()).unwrap())
}
