//! Last wills: the drivers' device descriptors, and the bytes that stop the devices when their drivers cannot.
//!
//! What is bought by the details, all of them seen on real lines: a terminal's O_NONBLOCK belongs to the open file that
//! driver and guard share, so the guard writes through an open file of its own where it can have one; output that flow
//! control holds back is thrown away and the line is let go (TCOON) before the stop is written, and sockets are written
//! with MSG_DONTWAIT; the stop is repeated, at least 5 ms apart, until it is longer than the packet that the driver may
//! have left half-written.

use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FileType, Mode, OFlags};
use rustix::io::Errno;
use rustix::net::SendFlags;
use rustix::termios::{Action, QueueSelector, isatty, tcflow, tcflush};

use crate::latch_page::Word;
use crate::wire::{ADDRESS_BYTES, WILL_BYTES};

/// Most devices of a robot.
pub const MOST_WILLS: usize = 16;

/// A short text without an allocation.
#[derive(Debug, Clone, Copy)]
pub struct Text<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Text<N> {
    /// The first `N` bytes of `text`.
    pub fn of(text: &[u8]) -> Self {
        let length = text.len().min(N);
        let mut bytes = [0; N];
        bytes[..length].copy_from_slice(&text[..length]);
        Text { bytes, length }
    }

    /// Its bytes.
    pub fn get(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

/// One device.
#[derive(Debug)]
pub struct Kept {
    address: Text<ADDRESS_BYTES>,
    bytes: Text<WILL_BYTES>,
    repeat: u32,
    spacing_ns: u64,
    device: OwnedFd,
    /// An open file of the guard's own, where the device can be opened a second time.
    own: Option<OwnedFd>,
    is_socket: bool,
    /// The user whose process has left it.
    by: u32,
    /// The connection of the driver that has the device.
    pub owner: u64,
    /// Whether that driver lives.
    pub alive: bool,
    /// The newest word of the latch that it has obeyed.
    obeyed: u32,
    /// Times that the stop is still to be written, and when next [ns].
    left: u32,
    next_ns: u64,
}

/// Everything that drivers have left with the guard.
#[derive(Debug, Default)]
pub struct Wills([Option<Kept>; MOST_WILLS]);

impl Wills {
    /// Takes a device and its will from the driver `owner`; false when there is no room.
    pub fn take(
        &mut self,
        owner: u64,
        address: &[u8],
        bytes: &[u8],
        repeat: u32,
        spacing_us: u32,
        device: OwnedFd,
    ) -> bool {
        let own_slot = |kept: &Option<Kept>| kept.as_ref().is_some_and(|kept| kept.address.get() == address);
        let slot = self.0.iter().position(own_slot).or_else(|| self.0.iter().position(Option::is_none));
        let Some(slot) = slot else { return false };
        let is_socket =
            rustix::fs::fstat(&device).is_ok_and(|stat| FileType::from_raw_mode(stat.st_mode) == FileType::Socket);
        self.0[slot] = Some(Kept {
            address: Text::of(address),
            bytes: Text::of(bytes),
            repeat,
            spacing_ns: u64::from(spacing_us) * 1000,
            own: if is_socket { None } else { open_again(device.as_fd()) },
            device,
            is_socket,
            by: 0,
            owner,
            alive: true,
            obeyed: 0,
            left: 0,
            next_ns: 0,
        });
        true
    }

    /// Notes whose the device at `address` is.
    pub fn sign(&mut self, address: &[u8], uid: u32) {
        self.0.iter_mut().flatten().filter(|kept| kept.address.get() == address).for_each(|kept| kept.by = uid);
    }

    /// The user who has left the device at `address`.
    pub fn left_by(&self, address: &[u8]) -> Option<u32> {
        self.0.iter().flatten().find(|kept| kept.address.get() == address).map(|kept| kept.by)
    }

    /// The driver `owner` has closed the device at `address` in order.
    pub fn give_up(&mut self, owner: u64, address: &[u8]) {
        for slot in &mut self.0 {
            if slot.as_ref().is_some_and(|kept| kept.owner == owner && kept.address.get() == address) {
                *slot = None;
            }
        }
    }

    /// The descriptor of the device at `address` that a dead driver has left, for its successor `owner`: from now on the
    /// successor speaks to the device. `None` when there is none, its driver lives, or nobody is at its other end.
    pub fn hand_on(&mut self, owner: u64, address: &[u8]) -> Option<BorrowedFd<'_>> {
        let slot = self.0.iter_mut().find(|slot| slot.as_ref().is_some_and(|kept| kept.address.get() == address))?;
        if slot.as_ref().is_some_and(|kept| kept.alive) {
            return None;
        }
        if slot.as_ref().is_some_and(|kept| hung_up(kept.device.as_fd())) {
            *slot = None;
            return None;
        }
        let kept = slot.as_mut()?;
        (kept.owner, kept.alive, kept.left, kept.obeyed) = (owner, true, 0, 0);
        Some(kept.device.as_fd())
    }

    /// The driver `owner` has obeyed `word`.
    pub fn obeyed(&mut self, owner: u64, word: u32) {
        for kept in self.0.iter_mut().flatten().filter(|kept| kept.owner == owner) {
            kept.obeyed = word;
        }
    }

    /// The driver `owner` is dead: its devices are stopped, beginning at `now_ns`. Whether it had any.
    pub fn died(&mut self, owner: u64, now_ns: u64) -> bool {
        let mut any = false;
        for kept in self.0.iter_mut().flatten().filter(|kept| kept.owner == owner && kept.alive) {
            kept.alive = false;
            kept.begin(now_ns);
            any = true;
        }
        any
    }

    /// Stops, once more, every device whose driver is dead.
    pub fn stop_orphans(&mut self, now_ns: u64) {
        self.0.iter_mut().flatten().filter(|kept| !kept.alive).for_each(|kept| kept.begin(now_ns));
    }

    /// Writes what is due at `now_ns`; when to come back [ns].
    pub fn advance(&mut self, now_ns: u64) -> Option<u64> {
        let mut next = None;
        for slot in &mut self.0 {
            let Some(kept) = slot else { continue };
            if kept.left > 0 && kept.next_ns <= now_ns && !kept.write(now_ns) {
                *slot = None;
                continue;
            }
            if kept.left > 0 {
                next = Some(next.map_or(kept.next_ns, |at: u64| at.min(kept.next_ns)));
            }
        }
        next
    }

    /// Whether every device has been told to stop since the latch's word was `since`.
    pub fn all_stopped(&self, since: Word) -> bool {
        self.0.iter().flatten().all(|kept| if kept.alive { !kept.disobeys(since) } else { kept.left == 0 })
    }

    /// Owners that live and have not obeyed `since`.
    pub fn disobedient(&self, since: Word) -> impl Iterator<Item = u64> {
        self.0.iter().flatten().filter(move |kept| kept.alive && kept.disobeys(since)).map(|kept| kept.owner)
    }

    /// Whether any driver lives, or any stop is still being written.
    pub fn is_busy(&self) -> bool {
        self.0.iter().flatten().any(|kept| kept.alive || kept.left > 0)
    }
}

impl Kept {
    fn disobeys(&self, since: Word) -> bool {
        Word(self.obeyed).epoch() < since.epoch()
    }

    fn begin(&mut self, now_ns: u64) {
        (self.left, self.next_ns) = (self.repeat, now_ns);
        if !self.is_socket && isatty(&self.device) {
            // What the driver still wanted is not wanted any more; a line that flow control holds is let go.
            let _ = tcflush(&self.device, QueueSelector::OFlush);
            let _ = tcflow(&self.device, Action::OOn);
        }
    }

    /// Writes the stop once; false when there is no device any more.
    fn write(&mut self, now_ns: u64) -> bool {
        let bytes = self.bytes.get();
        let written = match (self.is_socket, &self.own) {
            (true, _) => rustix::net::send(&self.device, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL).map(drop),
            (false, Some(own)) => rustix::io::write(own, bytes).map(drop),
            // Only the shared open file is left: look first, because it may be a blocking one.
            (false, None) if is_writable(self.device.as_fd()) => rustix::io::write(&self.device, bytes).map(drop),
            (false, None) => Err(Errno::AGAIN),
        };
        self.left -= 1;
        self.next_ns = now_ns + self.spacing_ns;
        matches!(written, Ok(()) | Err(Errno::AGAIN | Errno::INTR))
    }
}

/// A second open file of the same terminal, which no driver can make blocking.
fn open_again(device: BorrowedFd<'_>) -> Option<OwnedFd> {
    let mut path = [0; 32];
    let path = decimal_path(&mut path, device.as_raw_fd());
    let flags = OFlags::WRONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    rustix::fs::open(path, flags, Mode::empty()).ok()
}

/// `/proc/self/fd/N` without an allocation.
fn decimal_path(buffer: &mut [u8; 32], number: i32) -> &std::ffi::CStr {
    const PREFIX: &[u8] = b"/proc/self/fd/";
    buffer[..PREFIX.len()].copy_from_slice(PREFIX);
    let mut digits = [0; 10];
    let (mut rest, mut count) = (number.unsigned_abs(), 0);
    loop {
        digits[count] = b'0' + (rest % 10) as u8;
        count += 1;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    for (to, from) in buffer[PREFIX.len()..].iter_mut().zip(digits[..count].iter().rev()) {
        *to = *from;
    }
    std::ffi::CStr::from_bytes_until_nul(buffer).unwrap_or(c"/dev/null")
}

fn events(device: BorrowedFd<'_>, wanted: PollFlags) -> PollFlags {
    let mut watched = [PollFd::from_borrowed_fd(device, wanted)];
    match poll(&mut watched, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })) {
        Ok(_) => watched[0].revents(),
        Err(_) => PollFlags::empty(),
    }
}

fn is_writable(device: BorrowedFd<'_>) -> bool {
    events(device, PollFlags::OUT).contains(PollFlags::OUT)
}

fn hung_up(device: BorrowedFd<'_>) -> bool {
    events(device, PollFlags::empty()).intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::latch::State;
    use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
    use rustix::pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, unlockpt};

    const MS: u64 = 1_000_000;

    /// The device's end and the driver's end of a raw terminal.
    fn terminal() -> (OwnedFd, OwnedFd) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = ioctl_tiocgptpeer(&master, OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        let mut raw = rustix::termios::tcgetattr(&slave).unwrap();
        raw.make_raw();
        rustix::termios::tcsetattr(&slave, rustix::termios::OptionalActions::Now, &raw).unwrap();
        rustix::io::ioctl_fionbio(&master, true).unwrap();
        (master, slave)
    }

    fn heard(device: &OwnedFd) -> Vec<u8> {
        let mut buffer = [0; 1 << 14];
        let mut all = Vec::new();
        while let Ok(count @ 1..) = rustix::io::read(device, &mut buffer) {
            all.extend_from_slice(&buffer[..count]);
        }
        all
    }

    fn socket() -> (OwnedFd, OwnedFd) {
        socketpair(AddressFamily::UNIX, SocketType::STREAM, SocketFlags::NONBLOCK, None).unwrap()
    }

    #[test]
    fn the_stop_is_written_at_once_and_repeated_with_its_spacing() {
        let (device, driver) = terminal();
        let mut wills = Wills::default();
        assert!(wills.take(1, b"pty:a", b"STOP", 3, 5_000, driver));
        assert_eq!(wills.advance(0), None, "a living driver speaks for itself");
        wills.died(1, 10 * MS);
        assert_eq!(wills.advance(10 * MS), Some(15 * MS));
        assert_eq!(heard(&device), b"STOP");
        assert_eq!(wills.advance(12 * MS), Some(15 * MS));
        assert_eq!(wills.advance(15 * MS), Some(20 * MS));
        assert_eq!(wills.advance(20 * MS), None);
        assert_eq!(heard(&device), b"STOPSTOP");
    }

    #[test]
    fn a_terminal_that_its_driver_made_blocking_and_filled_does_not_hold_the_guard_and_still_hears_the_stop() {
        let (device, driver) = terminal();
        let mut wills = Wills::default();
        let duplicate = driver.try_clone().unwrap();
        assert!(wills.take(1, b"pty:a", b"STOP", 2, 5_000, duplicate));
        rustix::io::ioctl_fionbio(&driver, true).unwrap();
        while rustix::io::write(&driver, &[b'x'; 512]).is_ok() {}
        rustix::io::ioctl_fionbio(&driver, false).unwrap();
        drop(driver);
        wills.died(1, 0);
        // Whether the kernel had carried the bytes to the device's side already or they were flushed, is its affair.
        wills.advance(0);
        let mut all = heard(&device);
        wills.advance(5 * MS);
        all.extend(heard(&device));
        assert!(all.ends_with(b"STOP"), "{}", all.escape_ascii());
    }

    #[test]
    fn flow_control_is_let_go() {
        let (device, driver) = terminal();
        let mut wills = Wills::default();
        assert!(wills.take(1, b"pty:a", b"STOP", 1, 5_000, driver.try_clone().unwrap()));
        tcflow(&driver, Action::OOff).unwrap();
        wills.died(1, 0);
        wills.advance(0);
        assert_eq!(heard(&device), b"STOP");
    }

    #[test]
    fn a_full_socket_does_not_hold_the_guard() {
        let (device, driver) = socket();
        let mut wills = Wills::default();
        assert!(wills.take(1, b"tcp:a:1", b"STOP", 2, 5_000, driver.try_clone().unwrap()));
        while rustix::io::write(&driver, &[b'x'; 4096]).is_ok() {}
        rustix::io::ioctl_fionbio(&driver, false).unwrap();
        wills.died(1, 0);
        wills.advance(0);
        assert!(heard(&device).len() > 4096);
        wills.advance(5 * MS);
        assert_eq!(heard(&device), b"STOP");
    }

    #[test]
    fn the_successor_gets_the_same_open_device_and_the_guard_falls_silent() {
        let (device, driver) = terminal();
        let mut wills = Wills::default();
        wills.take(1, b"pty:a", b"STOP", 100, 5_000, driver);
        assert!(wills.hand_on(2, b"pty:a").is_none(), "its driver lives");
        wills.died(1, 0);
        wills.advance(0);
        let kept = wills.hand_on(2, b"pty:a").unwrap();
        rustix::io::write(kept, b"hello").unwrap();
        assert_eq!(wills.advance(50 * MS), None);
        assert_eq!(heard(&device), b"STOPhello");
        wills.died(2, 60 * MS);
        wills.advance(60 * MS);
        assert_eq!(heard(&device), b"STOP", "also when the successor dies before it has said a word");
    }

    #[test]
    fn a_device_that_is_gone_is_not_handed_on() {
        let (device, driver) = socket();
        let mut wills = Wills::default();
        wills.take(1, b"tcp:a:1", b"STOP", 3, 5_000, driver);
        wills.died(1, 0);
        drop(device);
        assert!(wills.hand_on(2, b"tcp:a:1").is_none());
        assert!(!wills.is_busy());
    }

    #[test]
    fn an_ordered_end_leaves_no_will() {
        let (device, driver) = terminal();
        let mut wills = Wills::default();
        wills.take(1, b"pty:a", b"STOP", 3, 5_000, driver);
        wills.give_up(1, b"pty:a");
        wills.died(1, 0);
        assert_eq!((wills.advance(0), heard(&device).len()), (None, 0));
    }

    #[test]
    fn all_have_stopped_when_each_driver_has_obeyed_and_each_orphan_was_told() {
        let (_device, driver) = terminal();
        let (_other, dead) = terminal();
        let mut wills = Wills::default();
        let stop = Word::new(7, State::Stopping);
        assert!(wills.all_stopped(stop), "a robot without devices stands");
        wills.take(1, b"pty:a", b"STOP", 1, 5_000, driver);
        wills.take(2, b"pty:b", b"STOP", 2, 5_000, dead);
        wills.obeyed(1, Word::new(6, State::Stopping).0);
        assert_eq!(wills.disobedient(stop).collect::<Vec<_>>(), [1, 2]);
        wills.obeyed(1, stop.0);
        wills.died(2, 0);
        wills.advance(0);
        assert!(!wills.all_stopped(stop));
        wills.advance(5 * MS);
        assert!(wills.all_stopped(stop));
    }
}
