//! The guard's process: one thread, one wait, no allocation after the start.
//!
//! It watches the processes of all who have attached, writes their last wills, and keeps the latch. It judges nothing.

use std::os::fd::{AsFd, OwnedFd};
use std::process::exit;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::net::{SendFlags, SocketFlags, accept_with, send, sockopt::socket_peercred};
use rustix::process::{PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use rustix::time::{ClockId, clock_gettime};

use crate::client::{receive_with, send_with};
use crate::fds;
use crate::latch::{Event, Latch, Refused, State};
use crate::latch_page::{LatchPage, SOURCES, Word};
use crate::sys;
use crate::table::{Line, Phase, SUPERVISOR_LINE, Table};
use crate::wills::Wills;
use crate::wire::{PACKET_BYTES, Request, parse};

/// Most connections; people's are limited further, so that they never take a driver's place.
const MOST_CONNECTIONS: usize = 48;
const MOST_VISITORS: usize = 16;
/// A living driver that has not obeyed the latch by then is killed, and the guard stops its device itself [ns].
const OBEY_WITHIN_NS: u64 = 150_000_000;
/// When the root is dead, drivers have so long to stop by themselves [ns].
const ORPHANED_NS: u64 = 3_000_000_000;
/// A supervisor that has not beaten for so long hangs: it is killed, and the root starts another [ns].
const SUPERVISOR_SILENT_NS: u64 = 1_000_000_000;
/// How often it is looked at [ns].
const LOOK_NS: u64 = 100_000_000;
/// The name under which the supervisor attaches.
pub const SUPERVISOR: &[u8] = b"supervisor";
/// The highest priority of the robot: what the guard does takes microseconds.
const PRIORITY: i32 = 98;

/// Somebody who has connected.
struct Peer {
    /// Tells this connection from all others.
    token: u64,
    /// Gone when the other end has closed it.
    socket: Option<OwnedFd>,
    /// The process of one who has attached, until it is dead.
    process: Option<OwnedFd>,
    pid: u32,
    uid: u32,
    gid: u32,
}

/// The supervisor's heartbeat.
struct Beating {
    token: u64,
    beats: u64,
    /// Looks in a row at which it stood still. The guard's own lateness makes the looks fewer, so it blames nobody.
    still: u64,
    next_ns: u64,
}

struct Keeper {
    listener: OwnedFd,
    root: Option<OwnedFd>,
    page: LatchPage,
    /// The latch's memory, read-only, for those who ask.
    look: Option<OwnedFd>,
    latch: Latch<SOURCES>,
    /// The word that drivers must have obeyed, and when it was set [ns].
    stop: (Word, u64),
    wills: Wills,
    peers: [Option<Peer>; MOST_CONNECTIONS],
    tokens: u64,
    orphaned_ns: Option<u64>,
    supervisor: Option<Beating>,
    line: Option<Line>,
    own_uid: u32,
    /// Group of the robot's nodes where those have users of their own: the group of the socket's file.
    members: Option<u32>,
}

/// Runs the guard on the descriptors that the root holds for it.
pub fn run() -> ! {
    sys::lock_memory();
    sys::ask_for_priority(PRIORITY);
    let (Ok(listener), Ok(memfd)) = (sys::inherited(fds::GUARD), sys::inherited(fds::LATCH)) else { exit(2) };
    let Ok(page) = LatchPage::map_writable(&memfd) else { exit(2) };
    let path = c"/proc/self/fd/101";
    let held: [bool; SOURCES] = std::array::from_fn(|index| page.flags(index).0);
    let raised = std::array::from_fn(|index| page.flags(index).1);
    let before = page.word();
    let mut keeper = Keeper {
        members: group_of(&listener),
        listener,
        root: sys::inherited(fds::ROOT).ok(),
        look: rustix::fs::open(path, OFlags::RDONLY | OFlags::CLOEXEC, Mode::empty()).ok(),
        latch: Latch::restore(before.state(), held, raised),
        stop: (before, now_ns()),
        page,
        wills: Wills::default(),
        peers: [const { None }; MOST_CONNECTIONS],
        tokens: 0,
        orphaned_ns: None,
        supervisor: None,
        line: sys::inherited(fds::TABLE).ok().and_then(|memfd| Table::map(memfd).ok()?.line(SUPERVISOR_LINE)),
        own_uid: rustix::process::geteuid().as_raw(),
    };
    // A guard that died between writing a source and the word has a stop to make good.
    if keeper.latch.state() != before.state() {
        keeper.publish(now_ns());
    }
    loop {
        keeper.turn();
    }
}

impl Keeper {
    fn turn(&mut self) {
        let now = now_ns();
        let mut until = self.wills.advance(now);
        until = earlier(until, self.press_on(now));
        until = earlier(until, self.look_at_supervisor(now));
        if let Some(since) = self.orphaned_ns {
            until = earlier(until, self.wind_up(now, since));
        }
        let mut ready = [false; 2 * MOST_CONNECTIONS];
        let (listening, root_gone) = self.wait(until, &mut ready);
        let now = now_ns();
        if root_gone && self.orphaned_ns.is_none() {
            self.orphaned_ns = Some(now);
            self.root = None;
            self.want(b"root of the process tree", b"it has died", false, (0, 0), now);
        }
        for index in 0..MOST_CONNECTIONS {
            if ready[index] {
                self.listen(index);
            }
            if ready[MOST_CONNECTIONS + index] {
                self.bury(index, now_ns());
            }
        }
        if listening {
            self.welcome();
        }
    }

    /// While stopping: ends it when every device is told, kills drivers that do not obey; when to come back [ns].
    fn press_on(&mut self, now: u64) -> Option<u64> {
        if self.latch.state() != State::Stopping {
            return None;
        }
        let (word, since) = self.stop;
        if self.wills.all_stopped(word) {
            let _ = self.latch.handle(Event::Stopped);
            self.page.set(self.latch.state(), now);
            return None;
        }
        if now < since + OBEY_WITHIN_NS {
            return Some(since + OBEY_WITHIN_NS);
        }
        for owner in self.wills.disobedient(word) {
            kill(&self.peers, owner);
        }
        Some(now + OBEY_WITHIN_NS)
    }

    /// Kills a supervisor that hangs; when to look again [ns].
    fn look_at_supervisor(&mut self, now: u64) -> Option<u64> {
        let line = self.line?;
        let beating = self.supervisor.as_mut()?;
        if now < beating.next_ns {
            return Some(beating.next_ns);
        }
        beating.next_ns = now + LOOK_NS;
        let beats = line.beats();
        let stands = beats == beating.beats && matches!(line.phase(), Phase::Waiting | Phase::Stepping);
        (beating.beats, beating.still) = (beats, if stands { beating.still + 1 } else { 0 });
        if beating.still * LOOK_NS >= SUPERVISOR_SILENT_NS {
            beating.still = 0;
            kill(&self.peers, beating.token);
        }
        Some(beating.next_ns)
    }

    /// The root is dead: ends when every device is stopped.
    fn wind_up(&mut self, now: u64, since: u64) -> Option<u64> {
        if !self.wills.is_busy() {
            exit(0);
        }
        if now >= since + ORPHANED_NS {
            for peer in self.peers.iter().flatten() {
                kill(&self.peers, peer.token);
            }
            if now >= since + 2 * ORPHANED_NS {
                exit(0);
            }
        }
        Some(now + 100_000_000)
    }

    /// Waits; whether the listener spoke, whether the root is dead, and which peers: first sockets, then processes.
    fn wait(&self, until: Option<u64>, ready: &mut [bool; 2 * MOST_CONNECTIONS]) -> (bool, bool) {
        const MOST: usize = 2 + 2 * MOST_CONNECTIONS;
        let filler = self.listener.as_fd();
        let mut polled: [PollFd<'_>; MOST] =
            std::array::from_fn(|_| PollFd::from_borrowed_fd(filler, PollFlags::empty()));
        let mut places = [usize::MAX; MOST];
        polled[0] = PollFd::from_borrowed_fd(filler, PollFlags::IN);
        let mut count = 1;
        for (index, peer) in self.peers.iter().enumerate() {
            let Some(peer) = peer else { continue };
            for (place, descriptor) in [(index, &peer.socket), (MOST_CONNECTIONS + index, &peer.process)] {
                if let Some(descriptor) = descriptor {
                    polled[count] = PollFd::from_borrowed_fd(descriptor.as_fd(), PollFlags::IN);
                    places[count] = place;
                    count += 1;
                }
            }
        }
        let root_at = count;
        if let Some(root) = &self.root {
            polled[count] = PollFd::from_borrowed_fd(root.as_fd(), PollFlags::IN);
            count += 1;
        }
        let timeout = until.map(|until| {
            let left = until.saturating_sub(now_ns());
            Timespec { tv_sec: (left / 1_000_000_000) as i64, tv_nsec: (left % 1_000_000_000) as i64 }
        });
        if poll(&mut polled[..count], timeout.as_ref()).is_err() {
            return (false, false);
        }
        for (fd, place) in polled[1..root_at].iter().zip(&places[1..root_at]) {
            ready[*place] = !fd.revents().is_empty();
        }
        (!polled[0].revents().is_empty(), root_at < count && !polled[root_at].revents().is_empty())
    }

    fn welcome(&mut self) {
        while let Ok(socket) = accept_with(&self.listener, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK) {
            let Ok(peer) = socket_peercred(&socket) else { continue };
            let visitors = self.peers.iter().flatten().filter(|peer| peer.process.is_none()).count();
            let free = self.peers.iter().position(Option::is_none).filter(|_| visitors < MOST_VISITORS);
            let slot = free.or_else(|| self.oldest_visitor());
            let Some(slot) = slot else { continue };
            self.tokens += 1;
            self.peers[slot] = Some(Peer {
                token: self.tokens,
                socket: Some(socket),
                process: None,
                pid: peer.pid.as_raw_nonzero().get() as u32,
                uid: peer.uid.as_raw(),
                gid: peer.gid.as_raw(),
            });
            // Whoever connects has mostly said something already: one wait less before a stop.
            self.listen(slot);
        }
    }

    fn oldest_visitor(&self) -> Option<usize> {
        let visitors = self.peers.iter().enumerate().filter_map(|(index, peer)| Some((index, peer.as_ref()?)));
        visitors.filter(|(_, peer)| peer.process.is_none()).min_by_key(|(_, peer)| peer.token).map(|(index, _)| index)
    }

    /// The process of a peer is dead.
    fn bury(&mut self, index: usize, now: u64) {
        if let Some(peer) = self.peers[index].take() {
            if self.supervisor.as_ref().is_some_and(|beating| beating.token == peer.token) {
                self.supervisor = None;
            }
            if self.wills.died(peer.token, now) {
                self.wills.advance(now);
                self.page.note_will(now_ns());
            }
        }
    }

    /// Serves what a peer has said.
    fn listen(&mut self, index: usize) {
        let mut packet = [0; PACKET_BYTES];
        loop {
            let Some(socket) = self.peers[index].as_ref().and_then(|peer| peer.socket.as_ref()) else { return };
            match receive_with(socket.as_fd(), &mut packet) {
                Ok((length @ 1.., descriptor)) => self.serve(index, &packet[..length], descriptor),
                Err(Errno::AGAIN | Errno::INTR) => return,
                // The end of a connection is not the end of its process: a driver is buried when that is dead.
                _ => {
                    match self.peers[index].as_mut() {
                        Some(peer) if peer.process.is_some() => peer.socket = None,
                        _ => self.peers[index] = None,
                    }
                    return;
                }
            }
        }
    }

    fn serve(&mut self, index: usize, packet: &[u8], descriptor: Option<OwnedFd>) {
        let Some(peer) = &self.peers[index] else { return };
        let (token, by) = (peer.token, (peer.pid, peer.uid));
        let uid = peer.uid;
        let owner = uid == self.own_uid || uid == 0;
        let trusted = owner || self.members == Some(peer.gid);
        let attached = peer.process.is_some();
        let now = now_ns();
        match parse(packet) {
            Some(Request::Stop { source, reason }) => {
                self.want(source, reason, false, by, now);
                self.tell(index, Ok(()));
            }
            Some(Request::Look) => {
                if let Some(socket) = &peer.socket {
                    let _ = send_with(socket.as_fd(), b"latch", self.look.as_ref().map(AsFd::as_fd));
                }
            }
            Some(_) if !trusted => self.say(
                index,
                &[
                    b"no ",
                    self.latch.state().word().as_bytes(),
                    b"\nonly the robot's user and root may do this; `stop` is for everyone",
                ],
            ),
            Some(Request::Hold { source, reason }) => {
                self.want(source, reason, true, by, now);
                self.tell(index, Ok(()));
            }
            Some(Request::Lower { source }) => {
                // Whoever is not the robot's user may let go only what it has itself raised.
                if let Some(slot) = self.page.find(source)
                    && (owner || self.page.by(slot).1 == uid)
                {
                    let _ = self.latch.handle(Event::Lower(slot));
                    self.note(slot);
                }
                self.tell(index, Ok(()));
            }
            Some(Request::Reset | Request::Resume) if !self.is_person(index) => self.say(
                index,
                &[b"no ", self.latch.state().word().as_bytes(), b"\nonly a person may do this, and no confined node"],
            ),
            Some(Request::Reset) => self.obey_person(index, Event::Reset, now),
            Some(Request::Resume) => self.obey_person(index, Event::Resume, now),
            Some(Request::Attach { node }) if node == SUPERVISOR && !self.is_person(index) => {}
            Some(Request::Attach { node }) => self.attach(index, node, now),
            Some(Request::Will { address, repeat, spacing_us, bytes }) if attached => {
                // Another user's device stays that user's.
                if let Some(device) = descriptor
                    && (owner || self.wills.left_by(address).is_none_or(|by| by == uid))
                    && self.wills.take(token, address, bytes, repeat, spacing_us, device)
                {
                    self.wills.sign(address, uid);
                }
            }
            Some(Request::Drop { address }) if attached => self.wills.give_up(token, address),
            Some(Request::Claim { address }) if attached => {
                let may = owner || self.wills.left_by(address).is_none_or(|by| by == uid);
                let kept = if may { self.wills.hand_on(token, address) } else { None };
                if let Some(socket) = self.peers[index].as_ref().and_then(|peer| peer.socket.as_ref()) {
                    let word: &[u8] = if kept.is_some() { b"kept" } else { b"none" };
                    let _ = send_with(socket.as_fd(), word, kept);
                }
            }
            Some(Request::Stopped { word }) if attached => self.wills.obeyed(token, word),
            Some(_) => self.say(index, &[b"no ", self.latch.state().word().as_bytes(), b"\nsay `attach NODE` first"]),
            None => self.say(
                index,
                &[
                    b"no ",
                    self.latch.state().word().as_bytes(),
                    b"\nunknown request; known are: stop, hold, lower, reset, resume, look",
                ],
            ),
        }
    }

    /// Whether a peer is the robot's user or root, and no node of the robot under whose hands that user runs.
    fn is_person(&self, index: usize) -> bool {
        let Some(peer) = &self.peers[index] else { return false };
        (peer.uid == self.own_uid || peer.uid == 0) && !crate::is_confined(peer.pid)
    }

    fn attach(&mut self, index: usize, node: &[u8], now: u64) {
        let Some(peer) = self.peers[index].as_mut() else { return };
        if node == SUPERVISOR {
            self.supervisor = Some(Beating { token: peer.token, beats: 0, still: 0, next_ns: now + LOOK_NS });
        }
        let pid = rustix::process::Pid::from_raw(peer.pid as i32);
        match pid.map(|pid| pidfd_open(pid, PidfdFlags::empty())) {
            Some(Ok(process)) => peer.process = Some(process),
            // Dead already: then it has left nothing yet.
            _ => self.peers[index] = None,
        }
    }

    /// Somebody wants a stop. The word comes first for those who sleep on it; nothing is between.
    fn want(&mut self, source: &[u8], reason: &[u8], hold: bool, by: (u32, u32), now: u64) {
        let slot = self.page.find(source);
        if let Some(slot) = slot {
            self.page.describe(slot, source, reason, now, unix_ms(), by);
        }
        let slot = slot.unwrap_or(SOURCES);
        let was_stopping = self.latch.state() == State::Stopping;
        let _ = self.latch.handle(if hold { Event::Hold(slot) } else { Event::Raise(slot) });
        self.note(slot);
        match was_stopping {
            // The drivers are on their way already: only the readers of the page have news.
            true => self.page.set(State::Stopping, now),
            false => self.publish(now),
        }
    }

    /// Writes the word, wakes those who sleep on it, and stops the devices that nobody drives.
    fn publish(&mut self, now: u64) {
        let state = self.latch.state();
        self.page.set(state, now);
        if state == State::Stopping {
            self.stop = (self.page.word(), now);
            self.wills.stop_orphans(now);
            self.wills.advance(now);
        }
    }

    fn note(&self, slot: usize) {
        if slot < SOURCES {
            self.page.set_flags(slot, self.latch.is_held(slot), self.latch.is_raised(slot));
        }
    }

    /// A person's word: reset or resume.
    fn obey_person(&mut self, index: usize, event: Event, now: u64) {
        let done = self.latch.handle(event).map(drop);
        if done.is_ok() {
            (0..SOURCES).for_each(|slot| self.note(slot));
            self.page.set(self.latch.state(), now);
        }
        self.tell(index, done);
    }

    fn tell(&self, index: usize, done: Result<(), Refused>) {
        let state = self.latch.state().word().as_bytes();
        let why: &[u8] = match done {
            Ok(()) => return self.say(index, &[b"ok ", state]),
            Err(Refused::NotStopped) => b"nothing is to be reset or resumed",
            Err(Refused::StillStopping) => b"not every wheel is known to stand yet; try again",
            Err(Refused::NotReset) => b"it must be reset first",
            Err(Refused::Held(slot)) => {
                let mut name = [0; crate::latch_page::NAME_BYTES];
                let name = self.page.name(slot, &mut name);
                return self.say(index, &[b"no ", state, b"\nits cause is still there: ", name, b" holds the stop"]);
            }
        };
        self.say(index, &[b"no ", state, b"\n", why]);
    }

    /// Sends an answer made of parts; who does not take it has lost it.
    fn say(&self, index: usize, parts: &[&[u8]]) {
        let Some(socket) = self.peers[index].as_ref().and_then(|peer| peer.socket.as_ref()) else { return };
        let mut answer = [0; 256];
        let mut length = 0;
        for part in parts {
            let room = part.len().min(answer.len() - length);
            answer[length..length + room].copy_from_slice(&part[..room]);
            length += room;
        }
        let _ = send(socket, &answer[..length], SendFlags::DONTWAIT | SendFlags::NOSIGNAL);
    }
}

/// The group of a listening socket's file, where it is not this process's own.
fn group_of(listener: &OwnedFd) -> Option<u32> {
    let address = rustix::net::SocketAddrUnix::try_from(rustix::net::getsockname(listener).ok()?).ok()?;
    let file = rustix::fs::stat(address.path()?).ok()?;
    (file.st_gid != rustix::process::getegid().as_raw()).then_some(file.st_gid)
}

fn kill(peers: &[Option<Peer>; MOST_CONNECTIONS], token: u64) {
    let process = peers.iter().flatten().find(|peer| peer.token == token).and_then(|peer| peer.process.as_ref());
    if let Some(process) = process {
        // One that is gone already is what is wanted.
        let _ = pidfd_send_signal(process, Signal::KILL);
    }
}

fn earlier(a: Option<u64>, b: Option<u64>) -> Option<u64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

fn now_ns() -> u64 {
    nanos(ClockId::Monotonic)
}

fn unix_ms() -> u64 {
    nanos(ClockId::Realtime) / 1_000_000
}

fn nanos(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}
