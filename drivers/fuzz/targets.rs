//! What the fuzz targets assert. The drivers' tests run the same functions over the corpus on every toolchain.

use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::*;
use drivers::p2os::session::{Port, Session, SessionConfig};
use drivers::p2os::sip::{EncoderTicks, Identity, Sip};
use runtime::Time;

/// A target by its name.
pub type Target = (&'static str, fn(&[u8]));

/// All targets; each has a folder of seeds in `corpus`.
pub const TARGETS: [Target; 4] =
    [("framer", framer), ("packets", packets), ("requests", requests), ("session", session)];

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
