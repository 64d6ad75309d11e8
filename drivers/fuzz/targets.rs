//! What the fuzz targets assert. The drivers' tests run the same functions over the corpus on every toolchain.

use drivers::laser::{Event as LaserEvent, News, Session as _};
use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::*;
use drivers::p2os::session::{Port, Session, SessionConfig};
use drivers::p2os::sip::{EncoderTicks, Identity, Sip};
use drivers::{lms200, urg};
use messages::{Echo, ScanBeam};
use runtime::Time;

/// A target by its name.
pub type Target = (&'static str, fn(&[u8]));

/// All targets; each has a folder of seeds in `corpus`.
pub const TARGETS: [Target; 9] = [
    ("framer", framer),
    ("packets", packets),
    ("requests", requests),
    ("session", session),
    ("lms_framer", lms_framer),
    ("lms_session", lms_session),
    ("scip_framer", scip_framer),
    ("scip_session", scip_session),
    ("laser_answers", laser_answers),
];

/// Any stream: every byte is accounted for, and it does not matter how the stream is cut.
pub fn framer(data: &[u8]) {
    let mut whole = Framer::new();
    let mut in_packets = 0;
    let mut rest = data;
    let mut count = 0;
    while let Some(payload) = whole.next(&mut rest) {
        assert!((1..=MAX_PAYLOAD).contains(&payload.len()));
        in_packets += payload.len() + OVERHEAD;
        count += 1;
    }
    assert!(rest.is_empty());
    let mut single = Framer::new();
    let mut found = 0;
    for byte in data {
        let mut one = std::slice::from_ref(byte);
        while single.next(&mut one).is_some() {
            found += 1;
        }
    }
    assert_eq!((count, whole.checksum_errors()), (found, single.checksum_errors()));
    whole.clear();
    assert_eq!(in_packets as u64 + whole.skipped_bytes(), data.len() as u64);
}

/// Any payload from a robot: parsed without panic, and what was understood survives being sent again.
pub fn packets(data: &[u8]) {
    let mut out = [0; MAX_PACKET];
    let payload = &data[..data.len().min(MAX_PAYLOAD)];
    if let Some(sip) = Sip::parse(payload) {
        let length = sip.encode(&mut out).expect("what fitted once fits again");
        assert_eq!(Sip::parse(&out[3..length - 2]), Some(sip));
    }
    if let Some(config) = ConfigPacket::parse(payload)
        && let Ok(length) = config.encode(&mut out)
    {
        assert_eq!(ConfigPacket::parse(&out[3..length - 2]), Some(config));
    }
    if let Some(ticks) = EncoderTicks::parse(payload) {
        let length = ticks.encode(&mut out).expect("what fitted once fits again");
        assert_eq!(EncoderTicks::parse(&out[3..length - 2]), Some(ticks));
    }
    if let Some(identity) = Identity::parse(payload) {
        let length = identity.encode(&mut out).expect("three short texts fit");
        assert_eq!(Identity::parse(&out[3..length - 2]), Some(identity));
    }
}

/// Any payload from a client: read without panic, integers within their 16 bits.
pub fn requests(data: &[u8]) {
    let Some(request) = Request::parse(data) else { return };
    assert!((-65_535..=65_535).contains(&request.integer()));
    let (left, right) = unpack_wheels(request.integer());
    assert_eq!(unpack_wheels(i32::from(pack_wheels(left, right))), (left.max(-2540), right.max(-2540)));
    assert!(request.text().len() <= data.len());
    for index in [0, 1, 2, usize::MAX] {
        let _ = (request.word(index), request.long(index));
    }
}

/// A session under any bytes, times and port events: it never sends two packets without the pause between them, only
/// packets that a robot can read, and nothing while the port is closed.
///
/// The first byte of each piece says what happens: 0…199 that many of the following bytes arrive, 200…239 time
/// passes, 240…255 the port changes.
pub fn session(data: &[u8]) {
    let mut session = Session::new(SessionConfig::default());
    let mut now = Time::from_seconds(1.0);
    let mut last_sent: Option<Time> = None;
    let mut is_open = false;
    let mut generation = 0;
    let mut out = [0; MAX_PACKET];
    let mut robot = Framer::with_max_count(MAX_COMMAND_COUNT);
    let mut rest = data;
    while let Some((&kind, behind)) = rest.split_first() {
        rest = behind;
        match kind {
            0..=199 => {
                let (bytes, behind) = rest.split_at(usize::from(kind).min(rest.len()));
                rest = behind;
                session.receive(now, bytes, |_| {});
            }
            200..=239 => now = now.after_s(f64::from(kind - 199) * 0.02),
            _ => {
                is_open = kind % 3 == 0;
                generation += 1;
                let closed = if kind % 3 == 1 { Port::Closed } else { Port::Opening };
                session.port(now, if is_open { Port::Open(generation) } else { closed });
            }
        }
        session.tick(now, |_| {});
        session.enqueue(command::VEL, Argument::Integer(i32::from(kind)));
        while let Some(length) = session.next_queued(now, &mut out).or_else(|| session.next_pulse(now, &mut out)) {
            assert!(is_open, "sends to a closed port");
            assert!(last_sent.is_none_or(|last| now.since(last) >= COMMAND_SPACING_S), "two packets at once");
            last_sent = Some(now);
            let mut packet = &out[..length];
            assert!(robot.next(&mut packet).is_some(), "sends what is no packet");
        }
    }
    assert_eq!((robot.checksum_errors(), robot.skipped_bytes()), (0, 0));
}

/// Any stream from or to an LMS: every byte is accounted for, and it does not matter how the stream is cut.
pub fn lms_framer(data: &[u8]) {
    use lms200::framer::Framer;
    use lms200::protocol::{MAX_BODY, OVERHEAD, Scan};
    for from_laser in [true, false] {
        let (mut whole, mut single) = (Framer::new(from_laser), Framer::new(from_laser));
        let (mut count, mut found, mut in_telegrams) = (0, 0, 0);
        let mut rest = data;
        while let Some(body) = whole.next(&mut rest) {
            assert!((1..=MAX_BODY).contains(&body.len()));
            in_telegrams += body.len() + OVERHEAD;
            count += 1;
            if let Some(scan) = Scan::parse(body) {
                assert!(scan.first + scan.iter().count() <= lms200::protocol::MAX_VALUES);
            }
        }
        for byte in data {
            let mut one = std::slice::from_ref(byte);
            while single.next(&mut one).is_some() {
                found += 1;
            }
        }
        assert_eq!((count, whole.sum_errors(), whole.answers()), (found, single.sum_errors(), single.answers()));
        whole.clear();
        let (acknowledged, refused) = whole.answers();
        let all = in_telegrams as u64 + whole.skipped_bytes() + acknowledged + refused;
        assert_eq!(all, data.len() as u64);
    }
}

/// Any stream from a scanner: it does not matter how the stream is cut.
pub fn scip_framer(data: &[u8]) {
    use urg::framer::{Framer, MAX_MESSAGE};
    let (mut whole, mut single) = (Framer::new(), Framer::new());
    let (mut count, mut found) = (0, 0);
    let mut rest = data;
    while let Some(message) = whole.next(&mut rest) {
        assert!(!message.is_empty() && message.len() <= MAX_MESSAGE);
        count += 1;
    }
    for byte in data {
        let mut one = std::slice::from_ref(byte);
        while single.next(&mut one).is_some() {
            found += 1;
        }
    }
    assert_eq!((count, whole.skipped_bytes()), (found, single.skipped_bytes()));
}

/// Any single answer: judged and parsed without panic.
pub fn laser_answers(data: &[u8]) {
    let _ = urg::conformance::judge(data);
    for asked in [0x10, 0x20, 0x30, 0x31, 0x3A, 0x3B, 0x74, 0x77] {
        let _ = lms200::conformance::judge(&[asked, 1], data);
    }
    let _ = lms200::model::Status::parse(data);
    if let Some(reply) = urg::protocol::Reply::parse(data)
        && let Some(sensor) = urg::model::Sensor::parse(&reply)
    {
        let area = sensor.area(-10.0, 10.0, 1);
        assert!((1..=drivers::laser::MAX_BEAMS).contains(&area.count()));
        assert!(sensor.sweep(&area).span_s().is_finite());
    }
}

/// A beam is a distance that can be, or a reason.
fn check_beams(beams: &[ScanBeam]) {
    assert!(!beams.is_empty() && beams.len() <= drivers::laser::MAX_BEAMS);
    for beam in beams {
        assert!(beam.range_m.is_finite() && (beam.echo != Echo::Value as u16 || beam.range_m > 0.0));
    }
}

/// What the next piece of `data` says happens: the first byte is 0…199 for that many bytes that arrive, 200…239 for time that
/// passes, 240…255 for the port.
fn pieces(data: &[u8], mut happens: impl FnMut(&[u8], f64, Option<Port>)) {
    let (mut rest, mut generation) = (data, 0);
    while let Some((&kind, behind)) = rest.split_first() {
        rest = behind;
        match kind {
            0..=199 => {
                let (bytes, behind) = rest.split_at(usize::from(kind).min(rest.len()));
                rest = behind;
                happens(bytes, 0.0, None);
            }
            200..=239 => happens(&[], f64::from(kind - 199) * 0.1, None),
            _ => {
                generation += 1;
                let port = [Port::Open(generation), Port::Closed, Port::Opening][usize::from(kind % 3)];
                happens(&[], 0.0, Some(port));
            }
        }
    }
}

/// An LMS session under any bytes, times and port events: what it sends are telegrams, and nothing while the port is closed.
pub fn lms_session(data: &[u8]) {
    use lms200::session::{Session, SessionConfig};
    let variant = lms200::model::Variant::of(180, 50);
    let config = SessionConfig {
        variant,
        reach: lms200::model::Reach::ThirtyTwo,
        line_baud: Some(9600),
        fast_baud: Some(38_400),
        hunt_bauds: vec![9600, 19_200],
        ..SessionConfig::default()
    };
    let (mut session, mut now, mut is_open) = (Session::new(config), Time::from_seconds(1.0), false);
    let mut laser = lms200::framer::Framer::new(false);
    pieces(data, |bytes, seconds, port| {
        now = now.after_s(seconds);
        if let Some(port) = port {
            is_open = matches!(port, Port::Open(_));
            session.port(now, port);
        }
        let mut take = |event: LaserEvent<'_>| {
            if let LaserEvent::Scan(News { beams, .. }) = event {
                check_beams(beams);
            }
        };
        session.receive(now, now, bytes, &mut take);
        session.tick(now, take);
        while let Some(request) = session.next_request(now) {
            assert!(is_open, "sends to a closed port");
            let mut telegram = request.as_bytes();
            assert!(laser.next(&mut telegram).is_some(), "sends what is no telegram");
        }
    });
    assert_eq!((laser.sum_errors(), laser.skipped_bytes()), (0, 0));
}

/// A SCIP session under any bytes, times and port events.
pub fn scip_session(data: &[u8]) {
    use urg::session::{Session, SessionConfig};
    let (mut session, mut now, mut is_open) = (Session::new(SessionConfig::default()), Time::from_seconds(1.0), false);
    pieces(data, |bytes, seconds, port| {
        now = now.after_s(seconds);
        if let Some(port) = port {
            is_open = matches!(port, Port::Open(_));
            session.port(now, port);
        }
        session.receive(now, now, bytes, |event| {
            if let LaserEvent::Scan(News { beams, .. }) = event {
                check_beams(beams);
            }
        });
        session.tick(now, |_| {});
        while let Some(request) = session.next_request(now) {
            assert!(is_open, "sends to a closed port");
            assert!(request.as_bytes().ends_with(b"\n") && !request.line().is_empty());
        }
    });
}
