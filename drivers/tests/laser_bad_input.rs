//! Both laser drivers against lasers that say what none should: a reason on the paths and in the log, never a panic, and never
//! a beam that says "free" or a distance which nobody has measured.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::lms200::Lms200;
use drivers::urg::Urg;
use messages::{Echo, LaserScan, LaserState, Link, Ranges};
use runtime::{Bench, Device, Node, Time};
use support::lasers::{Lms, Scanner, Scip};

const STEP_S: f64 = 0.025;

/// What comes in the place of a scan: the sound one and the one before go in.
type Change = fn(&[u8], &[u8]) -> Vec<u8>;

/// The value of a beam in the k-th scan.
type Values = fn(usize, u32) -> u32;

/// Driver and laser, joined by a memory link.
struct Rig<N: Node, S> {
    bench: Bench<N>,
    server: Device,
    scanner: S,
    now: Time,
    k: u32,
    before: Vec<u8>,
    change: Change,
    values: Values,
    faults: Vec<String>,
    newest: Time,
}

fn same(scan: &[u8], _: &[u8]) -> Vec<u8> {
    scan.to_vec()
}

/// A room: every beam between two and three metres [mm].
fn room(beam: usize, k: u32) -> u32 {
    2000 + (beam as u32 * 7 + k) % 1000
}

impl<N: Node, S: Scanner> Rig<N, S> {
    fn new(scanner: S) -> Rig<N, S> {
        let bench = Bench::<N>::builder("").build().unwrap();
        let server = bench.links().server(Bench::<N>::DEVICE, None);
        let now = Time::from_seconds(100.0);
        let (before, faults) = (Vec::new(), Vec::new());
        Rig { bench, server, scanner, now, k: 0, before, change: same, values: room, faults, newest: Time::ZERO }
    }

    fn step(&mut self) {
        let mut heard = [0; 512];
        let count = self.server.receive(&mut heard);
        let mut said = self.scanner.hear(&heard[..count]);
        self.k += 1;
        let values: Vec<u32> = (0..self.scanner.count()).map(|beam| (self.values)(beam, self.k)).collect();
        let scan = self.scanner.scan(self.k, &values);
        if !scan.is_empty() {
            said.extend((self.change)(&scan, &self.before));
            self.before = scan;
        }
        if !said.is_empty() {
            let _ = self.server.send(&said);
        }
        self.now = self.now.after_s(STEP_S);
        if let Err(fault) = self.bench.step(self.now) {
            self.faults.push(fault.to_string());
        }
        if let Some((stamp, ..)) = self.bench.read::<Ranges>("ranges") {
            assert!(stamp >= self.newest && stamp <= self.now, "a stamp goes back, or lies ahead");
            self.newest = stamp;
        }
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.step();
        }
    }

    fn state(&self) -> LaserState {
        self.bench.read::<LaserState>("state").unwrap().1
    }

    /// The reasons that the newest scan gives, each once.
    fn echoes(&self) -> Vec<u16> {
        let mut all: Vec<u16> = self.bench.read::<LaserScan>("scan").unwrap().2.iter().map(|beam| beam.echo).collect();
        let others = self.bench.read::<Ranges>("ranges").unwrap().2;
        assert!(others.iter().zip(&all).all(|(beam, echo)| beam.echo == u32::from(*echo)), "both paths say the same");
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// One case: what comes in place of scans, and what the driver then says: link, echoes, a word of its fault.
struct Case {
    name: &'static str,
    change: Change,
    values: Values,
    link: Link,
    echoes: &'static [Echo],
    fault: &'static str,
}

fn half(scan: &[u8], _: &[u8]) -> Vec<u8> {
    scan[..scan.len() / 2].to_vec()
}

fn corrupt(scan: &[u8], _: &[u8]) -> Vec<u8> {
    let mut scan = scan.to_vec();
    let middle = scan.len() / 2;
    scan[middle] ^= 0x04;
    scan
}

fn swapped(scan: &[u8], _: &[u8]) -> Vec<u8> {
    let (head, tail) = scan.split_at(scan.len() / 2);
    [tail, head].concat()
}

fn junk(_: &[u8], _: &[u8]) -> Vec<u8> {
    (0..300_u32).map(|k| (k * 7919 % 251) as u8).collect()
}

fn nothing(_: &[u8], _: &[u8]) -> Vec<u8> {
    Vec::new()
}

fn thrice(scan: &[u8], _: &[u8]) -> Vec<u8> {
    scan.repeat(3)
}

fn reordered(scan: &[u8], before: &[u8]) -> Vec<u8> {
    [scan, before].concat()
}

const BROKEN: &str = "its scans are none";

/// What holds for both drivers.
const CASES: &[Case] = &[
    Case { name: "sound", change: same, values: room, link: Link::Up, echoes: &[Echo::Value], fault: "" },
    Case { name: "repeated", change: thrice, values: room, link: Link::Up, echoes: &[Echo::Value], fault: "" },
    Case { name: "reordered", change: reordered, values: room, link: Link::Up, echoes: &[Echo::Value], fault: "" },
    Case { name: "silent", change: nothing, values: room, link: Link::Silent, echoes: &[Echo::LinkLost], fault: "" },
    Case {
        name: "one distance",
        change: same,
        values: |_, _| 3000,
        link: Link::Up,
        echoes: &[Echo::Fault],
        fault: "every beam",
    },
];

fn check<N: Node, S: Scanner + Default>(case: &Case) {
    let mut rig = Rig::<N, S>::new(S::default());
    rig.run(3.0);
    assert_eq!((rig.state().link, rig.echoes()), (Link::Up as u32, vec![Echo::Value as u16]), "{}", case.name);
    (rig.change, rig.values) = (case.change, case.values);
    // As long as scans are bad the link comes and goes: the worst is what it says between two start-ups.
    let mut links = Vec::new();
    for _ in 0..240 {
        rig.step();
        links.push(rig.state().link);
    }
    assert!(links.contains(&(case.link as u32)), "{}: {:?} {:?}", case.name, case.link, rig.state());
    let wanted: Vec<u16> = case.echoes.iter().map(|echo| *echo as u16).collect();
    assert_eq!(rig.echoes(), wanted, "{}", case.name);
    match case.fault {
        "" => assert_eq!(rig.faults, Vec::<String>::new(), "{}", case.name),
        word => {
            assert!(rig.faults.iter().any(|fault| fault.contains(word)), "{}: {:?}", case.name, rig.faults);
            assert!(rig.faults.len() < 8, "{}: said over and over: {}", case.name, rig.faults.len());
        }
    }
    // And all is well again when the laser is.
    (rig.change, rig.values) = (same, room);
    rig.run(8.0);
    assert_eq!((rig.state().link, rig.echoes()), (Link::Up as u32, vec![Echo::Value as u16]), "{} after it", case.name);
}

#[test]
fn what_no_laser_should_say_gives_a_reason_and_passes() {
    for case in CASES {
        check::<Lms200, Lms>(case);
        check::<Urg, Scip>(case);
    }
}

#[test]
fn damaged_scans_are_counted_and_lose_the_link_but_never_tell_a_distance() {
    for change in [half as Change, corrupt, swapped, junk] {
        fn run<N: Node, S: Scanner + Default>(change: Change) {
            let mut rig = Rig::<N, S>::new(S::default());
            rig.run(3.0);
            rig.change = change;
            let (mut links, mut after_s) = (Vec::new(), 0.0);
            while after_s < 8.0 {
                rig.step();
                after_s += STEP_S;
                links.push(rig.state().link);
                if after_s > 2.5 {
                    assert!(!rig.echoes().contains(&(Echo::Value as u16)), "an old distance is told as a new one");
                    assert!(!rig.echoes().contains(&(Echo::Clear as u16)), "nobody has seen that it is free");
                }
            }
            let state = rig.state();
            assert!(state.damaged + state.skipped_bytes > 0, "{state:?}");
            assert!(links.iter().any(|link| [Link::Foreign as u32, Link::Silent as u32].contains(link)), "{state:?}");
            rig.change = same;
            rig.run(8.0);
            assert_eq!(rig.state().link, Link::Up as u32);
        }
        run::<Lms200, Lms>(change);
        run::<Urg, Scip>(change);
    }
}

#[test]
fn scans_of_no_beams_are_none() {
    fn run<N: Node, S: Scanner + Default>(empty: Change) {
        let mut rig = Rig::<N, S>::new(S::default());
        rig.run(3.0);
        rig.change = empty;
        rig.run(3.0);
        assert!(rig.state().damaged > 0);
        assert_eq!(rig.echoes(), [Echo::LinkLost as u16]);
        assert!(
            rig.faults.iter().any(|fault| fault.contains(BROKEN) || fault.contains("measures nothing")),
            "{:?}",
            rig.faults
        );
    }
    run::<Lms200, Lms>(|_, _| {
        let mut out = Vec::new();
        drivers::lms200::protocol::push(&mut out, 0x80, &[0xB0, 0, 0, 0x10]);
        out
    });
    run::<Urg, Scip>(|scan, _| {
        let lines: Vec<&[u8]> = scan.split(|byte| *byte == b'\n').take(3).collect();
        [&lines.join(&b'\n')[..], b"\n\n"].concat()
    });
}

#[test]
fn another_model_is_foreign_and_said_once() {
    fn run<N: Node, S: Scanner + Default>(config: &str, name: &str) {
        let mut scanner = S::default();
        scanner.pretend(name);
        let mut rig = Rig::<N, S>::new(scanner);
        rig.bench = Bench::<N>::builder(config).build().unwrap();
        rig.server = rig.bench.links().server(Bench::<N>::DEVICE, None);
        rig.run(14.0);
        assert_eq!(rig.state().link, Link::Foreign as u32);
        assert_eq!(rig.state().scans, 0);
        assert_eq!(rig.faults.len(), 1, "{:?}", rig.faults);
    }
    run::<Lms200, Lms>("model = \"LMS200\"", "PLS101;1;V1");
    run::<Lms200, Lms>("model = \"auto\"", "a toaster");
    run::<Urg, Scip>("model = \"ust-10lx\"", "UTM-30LX");
}

#[test]
fn codes_that_are_no_distance_say_why() {
    fn run<N: Node, S: Scanner + Default>(table: &[(Values, Echo)]) {
        for (values, echo) in table {
            let mut rig = Rig::<N, S>::new(S::default());
            rig.values = *values;
            rig.run(3.0);
            assert_eq!(rig.echoes(), [*echo as u16], "{}", values(0, 0));
        }
    }
    run::<Lms200, Lms>(&[
        (|_, _| 0, Echo::TooNear),
        (|_, _| 8183, Echo::Clear),
        (|_, _| 8190, Echo::Fault),
        (|_, _| 0xFFFF, Echo::Fault),
        (|_, _| 8182, Echo::Fault),
    ]);
    run::<Urg, Scip>(&[
        (|_, _| 0, Echo::Fault),
        (|_, _| 1, Echo::Clear),
        (|_, _| 2, Echo::TooNear),
        (|_, _| 60_000, Echo::Fault),
        (|_, _| 65_533, Echo::Clear),
    ]);
}

#[test]
fn a_sensor_clock_that_goes_back_is_counted_and_moves_no_stamp_back() {
    let mut rig = Rig::<Urg, Scip>::new(Scip::default());
    rig.run(3.0);
    for clock_ms in [1000, 9_000_000, 3] {
        rig.scanner.clock_ms = clock_ms;
        rig.run(1.0);
    }
    assert!(rig.state().clock_jumps >= 3, "{:?}", rig.state());
    assert_eq!(rig.state().link, Link::Up as u32);
}

#[test]
fn our_own_clock_going_back_moves_no_stamp_back_and_panics_nowhere() {
    fn run<N: Node, S: Scanner + Default>() {
        let mut rig = Rig::<N, S>::new(S::default());
        rig.run(3.0);
        let newest = rig.bench.read::<Ranges>("ranges").unwrap().0;
        for k in 0..100 {
            let _ = rig.bench.step(Time::from_seconds(50.0 + 0.01 * f64::from(k)));
            assert!(rig.bench.read::<Ranges>("ranges").unwrap().0 >= newest);
        }
        rig.run(3.0);
        assert_eq!(rig.state().link, Link::Up as u32);
    }
    run::<Lms200, Lms>();
    run::<Urg, Scip>();
}
