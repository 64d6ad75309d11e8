//! What every LMS 2xx at the other end of a byte stream must do, as a suite of checks.
//!
//! [`check`] asks a living laser, simulated or real; [`judge`] holds one answer against its request and is what `check` uses for
//! each, and what tests use for bytes that somebody has captured. No check asserts how fast anything is.

use super::framer::Framer;
use super::model::{CONFIG, Status, UNIT, Variant, status_at};
use super::protocol::{ACK, NAK, Scan, command, mode, push};
use crate::laser::conformance::{Failure, Outcome, Server, ensure, listen};

/// One check: a sentence and what it does.
pub type Check = (&'static str, fn(&mut dyn Server) -> Outcome);

/// All checks in the order in which [`check`] runs them.
pub const CHECKS: &[Check] = &[
    ("answers every question of a client with an acknowledgement and one telegram", questions),
    ("takes split and joined telegrams, also behind junk", cuts),
    ("refuses a damaged telegram and obeys the next", damage),
    ("says that it does not understand", not_understood),
    ("streams all values of every variant, and stops", variants),
    ("sends one scan when it is asked for one", one_scan),
    ("streams a part of the field", part),
    ("takes its configuration with the password alone, and writes distances as it says", configuration),
    ("does not leave what it has for a variant that it does not have", no_such_variant),
    ("comes back from a reset as after power-on", reset),
    ("answers a change of rate before it changes it", rates),
];

/// Runs all checks; stops at the first that fails.
pub fn check(server: &mut dyn Server) -> Result<(), Failure> {
    for (check, run) in CHECKS {
        ask(server, &[command::MODE, mode::REQUEST]).map_err(|what| Failure { check, what })?;
        listen(server, 0.5);
        run(server).map_err(|what| Failure { check, what })?;
    }
    Ok(())
}

/// Longest time that a check waits for an answer [s].
const PATIENCE_S: f64 = 15.0;

/// Holds an answer's body against its request's; streams and mode switches are checked by what follows them.
pub fn judge(request: &[u8], answer: &[u8]) -> Outcome {
    let (Some(&asked), Some(&kind)) = (request.first(), answer.first()) else { return Err("an empty telegram".into()) };
    let is_answer = kind == asked | command::ANSWER || asked == command::RESET && kind == 0x91;
    if kind == command::REFUSED {
        return ensure(answer.len() == 2, || format!("a refusal of {} bytes", answer.len()));
    }
    ensure(is_answer, || format!("{kind:02X} answers {asked:02X}"))?;
    let length = |wanted: usize| ensure(answer.len() == wanted, || format!("{} bytes, not {wanted}", answer.len()));
    match asked {
        command::RESET => length(2),
        command::MODE => length(3).and_then(|()| ensure(answer[1] <= 2, || format!("result {}", answer[1]))),
        command::TYPE => ensure(answer[1..].starts_with(b"LMS"), || format!("type {:?}", &answer[1..])),
        command::STATUS => {
            ensure(answer.len() >= status_at::LENGTH, || format!("a status of {} bytes", answer.len()))?;
            ensure(Status::parse(answer).is_some_and(|s| s.variant.is_some()), || "a status without variant".into())
        }
        command::GET_CONFIG => length(CONFIG + 2),
        command::SET_CONFIG => length(CONFIG + 3),
        command::VARIANT => length(7),
        command::SCAN => ensure(Scan::parse(answer).is_some(), || "a scan whose lengths disagree".into()),
        other => Err(format!("nobody knows command {other:02X}")),
    }
}

/// All telegrams in `bytes`, and how often the laser acknowledged and refused.
pub fn telegrams(mut bytes: &[u8]) -> (Vec<Vec<u8>>, (u64, u64)) {
    let mut framer = Framer::new(true);
    let mut found = Vec::new();
    while let Some(body) = framer.next(&mut bytes) {
        found.push(body.to_vec());
    }
    (found, framer.answers())
}

fn telegram(body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    push(&mut bytes, 0, body);
    bytes
}

/// Sends `body` and waits for its answer, scans of a stream left out; judges it.
fn ask(server: &mut dyn Server, body: &[u8]) -> Result<Vec<u8>, String> {
    server.send(&telegram(body));
    let mut bytes = Vec::new();
    let mut waited_s = 0.0;
    while waited_s < PATIENCE_S {
        bytes.extend(listen(server, 0.1));
        waited_s += 0.1;
        let (found, (acknowledged, _)) = telegrams(&bytes);
        let is_stream = |kind: u8| matches!(kind, 0xB0 | 0xB7);
        let wants_scan = body[0] == command::SCAN;
        if let Some(answer) = found.into_iter().find(|answer| wants_scan || !is_stream(answer[0])) {
            ensure(acknowledged > 0, || format!("{:02X} was not acknowledged", body[0]))?;
            judge(body, &answer)?;
            return Ok(answer);
        }
    }
    Err(format!("no answer to {:02X} in {PATIENCE_S} s", body[0]))
}

/// The scans of the next `seconds`.
fn scans(server: &mut dyn Server, seconds: f64) -> Vec<Vec<u8>> {
    telegrams(&listen(server, seconds)).0
}

fn questions(server: &mut dyn Server) -> Outcome {
    for question in [command::TYPE, command::STATUS, command::GET_CONFIG] {
        ask(server, &[question])?;
    }
    let heard = listen(server, 0.3);
    ensure(heard.is_empty(), || format!("{} bytes that nobody asked for", heard.len()))
}

fn cuts(server: &mut dyn Server) -> Outcome {
    let mut bytes = vec![0x55, ACK, 0x02, 0x80];
    bytes.extend(telegram(&[command::TYPE]));
    bytes.extend(telegram(&[command::GET_CONFIG]));
    let mut heard = Vec::new();
    for byte in &bytes {
        server.send(&[*byte]);
        heard.extend(listen(server, 0.01));
    }
    server.send(&[telegram(&[command::TYPE]), telegram(&[command::STATUS])].concat());
    heard.extend(listen(server, 1.0));
    let kinds: Vec<u8> = telegrams(&heard).0.iter().map(|body| body[0]).collect();
    ensure(kinds == [0xBA, 0xF4, 0xBA, 0xB1], || format!("answers {kinds:02X?}"))
}

fn damage(server: &mut dyn Server) -> Outcome {
    let mut bytes = telegram(&[command::TYPE]);
    bytes[4] ^= 1;
    server.send(&bytes);
    let heard = listen(server, 0.5);
    let (found, (_, refused)) = telegrams(&heard);
    ensure(refused == 1 && found.is_empty() && heard == [NAK], || format!("{heard:02X?} on a damaged telegram"))?;
    ask(server, &[command::TYPE]).map(drop)
}

fn not_understood(server: &mut dyn Server) -> Outcome {
    for body in [&[0x7F][..], &[command::VARIANT, 1], &[command::MODE]] {
        let answer = ask(server, body)?;
        ensure(answer[0] == command::REFUSED, || format!("{:02X} to {body:02X?}", answer[0]))?;
    }
    Ok(())
}

fn switch(server: &mut dyn Server, mode: u8) -> Outcome {
    let answer = ask(server, &[command::MODE, mode])?;
    ensure(answer[1] == 0, || format!("mode {mode:02X} refused with {}", answer[1]))
}

fn choose(server: &mut dyn Server, variant: Variant) -> Outcome {
    let ([a, b], [c, d]) = (variant.angle_deg.to_le_bytes(), variant.resolution_cdeg.to_le_bytes());
    let answer = ask(server, &[command::VARIANT, a, b, c, d])?;
    ensure(answer[1..6] == [1, a, b, c, d], || format!("{variant:?} answered by {answer:02X?}"))
}

fn variants(server: &mut dyn Server) -> Outcome {
    for (angle, resolution) in [(180, 100), (180, 50), (100, 100), (100, 50), (100, 25)] {
        let variant = Variant::of(angle, resolution).ok_or("no variant")?;
        choose(server, variant)?;
        switch(server, mode::STREAM)?;
        let found = scans(server, 1.0);
        ensure(found.len() >= 2, || format!("{} scans in a second of {variant:?}", found.len()))?;
        for body in &found {
            let scan = Scan::parse(body).ok_or("a scan whose lengths disagree")?;
            ensure(scan.first == 0 && scan.iter().count() == variant.count(), || {
                format!("{} values of {variant:?}", scan.iter().count())
            })?;
        }
        switch(server, mode::REQUEST)?;
        listen(server, 0.5);
        ensure(scans(server, 0.5).is_empty(), || "it streams on".into())?;
    }
    Ok(())
}

fn one_scan(server: &mut dyn Server) -> Outcome {
    choose(server, Variant::default())?;
    let answer = ask(server, &[command::SCAN, 1])?;
    let count = Scan::parse(&answer).map(|scan| scan.iter().count());
    ensure(count == Some(181), || format!("{count:?} values"))?;
    ensure(scans(server, 0.5).is_empty(), || "more than one scan".into())
}

fn part(server: &mut dyn Server) -> Outcome {
    choose(server, Variant::default())?;
    let answer = ask(server, &[command::MODE, mode::STREAM_PART, 11, 0, 30, 0])?;
    ensure(answer[1] == 0, || "a part of the field is refused".into())?;
    let found = scans(server, 1.0);
    let scan = found.first().and_then(|body| Scan::parse(body)).ok_or("no part of a scan")?;
    ensure((scan.first, scan.iter().count()) == (10, 20), || format!("from {}", scan.first))
}

fn configuration(server: &mut dyn Server) -> Outcome {
    let told = ask(server, &[command::GET_CONFIG])?;
    let config = &told[1..=CONFIG];
    let wanted_unit = 1 - config[UNIT].min(1);
    let mut request = vec![command::SET_CONFIG];
    request.extend_from_slice(config);
    request[1 + UNIT] = wanted_unit;
    let answer = ask(server, &request)?;
    ensure(answer[0] == command::REFUSED || answer[1] == 0, || "configured without the password".into())?;
    let install = |word: &[u8]| [&[command::MODE, mode::INSTALL][..], word].concat();
    let wrong = ask(server, &install(b"SICK_XXX"))?;
    ensure(wrong[1] == 1, || format!("result {} with a wrong password", wrong[1]))?;
    ask(server, &install(mode::PASSWORD))?;
    let answer = ask(server, &request)?;
    ensure(answer[1] == 1 && answer[2..][UNIT] == wanted_unit, || "not configured with the password".into())?;
    // Clients write the first bytes alone.
    let answer = ask(server, &request[..8])?;
    ensure(answer[1] == 1, || "a short configuration is refused".into())?;
    switch(server, mode::REQUEST)?;
    let scan = ask(server, &[command::SCAN, 1])?;
    let unit = Scan::parse(&scan).map(|scan| scan.unit);
    ensure(unit == super::protocol::Unit::of(wanted_unit), || format!("a scan in {unit:?}"))?;
    ask(server, &install(mode::PASSWORD))?;
    request[1..].copy_from_slice(config);
    ask(server, &request)?;
    switch(server, mode::REQUEST)
}

fn no_such_variant(server: &mut dyn Server) -> Outcome {
    choose(server, Variant::default())?;
    let answer = ask(server, &[command::VARIANT, 180, 0, 25, 0])?;
    ensure(answer[0] == command::REFUSED || answer[1] == 0, || "180° at a quarter of a degree".into())?;
    let status = ask(server, &[command::STATUS])?;
    let variant = Status::parse(&status).and_then(|status| status.variant);
    ensure(variant == Some(Variant::default()), || format!("{variant:?}"))
}

fn reset(server: &mut dyn Server) -> Outcome {
    server.send(&telegram(&[command::RESET]));
    let (found, _) = telegrams(&listen(server, PATIENCE_S));
    let kinds: Vec<u8> = found.iter().map(|body| body[0]).collect();
    ensure(kinds == [0x91, command::POWER_ON], || format!("{kinds:02X?} after a reset"))?;
    ensure(found[1][1..].starts_with(b"LMS"), || "it does not say who it is".into())
}

fn rates(server: &mut dyn Server) -> Outcome {
    for (code, baud) in mode::BAUDS {
        let answer = ask(server, &[command::MODE, code])?;
        ensure(answer[1] == 0, || format!("{baud} baud is refused"))?;
    }
    Ok(())
}
