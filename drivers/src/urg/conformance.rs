//! What every SCIP 2.0 scanner at the other end of a byte stream must do, as a suite of checks.
//!
//! [`check`] asks a living scanner, simulated or real; [`judge`] holds one reply against the line that it echoes and is what
//! `check` uses for each, and what tests use for bytes that somebody has captured. No check asserts how fast anything is.

use super::framer::Framer;
use super::model::Sensor;
use super::protocol::{Area, Coding, Reply, checked, decimal, decode, parse_scan, status};
use crate::laser::conformance::{Failure, Outcome, Server, ensure, listen};

/// One check: a sentence and what it does.
pub type Check = (&'static str, fn(&mut dyn Server) -> Outcome);

/// All checks in the order in which [`check`] runs them.
pub const CHECKS: &[Check] = &[
    ("tells version, parameters and state in lines with their sums", tells),
    ("takes CR, CR LF, empty lines, strings and lines in pieces", lines),
    ("says which character of a command, or which parameter, is wrong", errors),
    ("switches its laser on and off", laser),
    ("measures nothing while its laser is off", off),
    ("tells its clock in the clock's mode alone", clock),
    ("gives one scan in two and three characters, with and without intensities", gets),
    ("streams as many scans as it was asked for and counts them down", counted),
    ("streams for ever until QT, clustered and with gaps", streams),
    ("lets a new stream take the place of a running one", replaces),
];

/// Runs all checks; stops at the first that fails.
pub fn check(server: &mut dyn Server) -> Result<(), Failure> {
    for (check, run) in CHECKS {
        ask(server, "QT").map_err(|what| Failure { check, what })?;
        listen(server, 0.2);
        run(server).map_err(|what| Failure { check, what })?;
    }
    Ok(())
}

/// Longest time that a check waits for a reply [s].
const PATIENCE_S: f64 = 2.0;

/// Every line of a reply but the echo has its sum; a scan has as many values as its request asks for.
pub fn judge(message: &[u8]) -> Outcome {
    let text = || String::from_utf8_lossy(&message[..message.len().min(40)]).into_owned();
    let reply = Reply::parse(message).ok_or_else(|| format!("a status without its sum in {:?}", text()))?;
    for line in reply.lines() {
        ensure(checked(line).is_some(), || format!("a line without its sum in {:?}", text()))?;
    }
    let line = reply.echo.split(|byte| *byte == b';').next().unwrap_or_default();
    let is_well = reply.status == status::OK;
    let count = |wanted: usize| {
        let found = reply.lines().count();
        ensure(found == wanted, || format!("{found} lines, not {wanted}, in {:?}", text()))
    };
    match line {
        b"VV" => count(5),
        b"PP" => count(8).and_then(|()| ensure(Sensor::parse(&reply).is_some(), || "parameters that cannot be".into())),
        b"II" => count(7),
        b"TM1" if is_well => {
            count(1)?;
            let stamp = reply.lines().next().and_then(checked).filter(|stamp| stamp.len() == 4).and_then(decode);
            ensure(stamp.is_some(), || "no stamp of four characters".into())
        }
        [b'G', letter, rest @ ..] if is_well => scan(&reply, *letter, rest),
        [b'M', letter, rest @ ..] if reply.status == status::SCAN => scan(&reply, *letter, rest),
        // The state's own words.
        [b'%', ..] => Ok(()),
        _ => count(0),
    }
}

fn scan(reply: &Reply, letter: u8, parameters: &[u8]) -> Outcome {
    read(reply, letter, parameters).map(drop)
}

/// The stamp and the values of a scan.
fn read(reply: &Reply, letter: u8, parameters: &[u8]) -> Result<(u32, Vec<(u32, u32)>), String> {
    let number = |from: usize, to: usize| parameters.get(from..to).and_then(decimal).ok_or("no number");
    let area = Area { start: number(0, 4)? as u16, end: number(4, 8)? as u16, cluster: number(8, 10)? as u8 };
    let coding = Coding::of(letter).ok_or("no coding")?;
    let mut beams = vec![(0, 0); area.count()];
    let stamp = parse_scan(reply.body, coding, &mut Vec::new(), &mut beams).map_err(|e| format!("a scan: {e}"))?;
    Ok((stamp, beams))
}

/// All messages in `bytes`.
pub fn messages(mut bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut framer = Framer::new();
    let mut found = Vec::new();
    while let Some(message) = framer.next(&mut bytes) {
        found.push(message.to_vec());
    }
    found
}

/// Sends a line and waits for the message that echoes it; judges it.
fn ask(server: &mut dyn Server, line: &str) -> Result<Vec<u8>, String> {
    server.send(format!("{line}\n").as_bytes());
    let mut bytes = Vec::new();
    let mut waited_s = 0.0;
    while waited_s < PATIENCE_S {
        bytes.extend(listen(server, 0.05));
        waited_s += 0.05;
        if let Some(message) = messages(&bytes).into_iter().find(|message| echo(message) == line.as_bytes()) {
            judge(&message)?;
            return Ok(message);
        }
    }
    Err(format!("no reply to {line} in {PATIENCE_S} s"))
}

fn echo(message: &[u8]) -> &[u8] {
    message.split(|byte| *byte == b'\n').next().unwrap_or_default()
}

fn expect(server: &mut dyn Server, line: &str, status: &str) -> Outcome {
    let message = ask(server, line)?;
    let said = Reply::parse(&message).map(|reply| reply.status).unwrap_or_default();
    ensure(said == status.as_bytes(), || format!("{line} gives {}, not {status}", String::from_utf8_lossy(&said)))
}

fn sensor(server: &mut dyn Server) -> Result<Sensor, String> {
    let message = ask(server, "PP")?;
    Reply::parse(&message).and_then(|reply| Sensor::parse(&reply)).ok_or_else(|| "no parameters".into())
}

fn tells(server: &mut dyn Server) -> Outcome {
    for (line, keys) in [
        ("VV", &["VEND", "PROD", "FIRM", "PROT", "SERI"][..]),
        ("II", &["MODL", "LASR", "SCSP", "MESM", "SBPS", "TIME", "STAT"]),
    ] {
        let message = ask(server, line)?;
        let reply = Reply::parse(&message).ok_or("no reply")?;
        for key in keys {
            ensure(reply.value(key.as_bytes()).is_some(), || format!("no {key} in {line}"))?;
        }
    }
    sensor(server).map(drop)
}

fn lines(server: &mut dyn Server) -> Outcome {
    server.send(b"\n\r\nVV\rPP\r\nII;some string\n");
    for byte in b"VV;in pieces\n" {
        server.send(&[*byte]);
        server.advance(0.01);
    }
    let heard = messages(&listen(server, 0.5));
    heard.iter().try_for_each(|message| judge(message))?;
    let echoes: Vec<&[u8]> = heard.iter().map(|message| echo(message)).collect();
    ensure(echoes == [&b"VV"[..], b"PP", b"II;some string", b"VV;in pieces"], || format!("{} replies", echoes.len()))
}

fn errors(server: &mut dyn Server) -> Outcome {
    let last = sensor(server)?.last_step;
    expect(server, "XX", "0D")?;
    expect(server, "VX", "0E")?;
    expect(server, "BM", "00")?;
    for (line, status) in [
        ("MDx000001001000".to_owned(), "01"),
        ("MD0000x01001000".to_owned(), "02"),
        ("MD00000010xx000".to_owned(), "03"),
        (format!("MD0000{:04}01000", last + 1), "04"),
        ("MD0010000901000".to_owned(), "05"),
        ("MD0000001001x00".to_owned(), "06"),
        ("MD00000010010xx".to_owned(), "07"),
        ("MD000000100100".to_owned(), "0F"),
        ("GD00000010010".to_owned(), "0F"),
        ("GD0010000901".to_owned(), "05"),
    ] {
        expect(server, &line, status)?;
    }
    Ok(())
}

fn laser(server: &mut dyn Server) -> Outcome {
    expect(server, "BM", "00")?;
    expect(server, "BM", "02")?;
    expect(server, "QT", "00")?;
    expect(server, "BM", "00")
}

fn off(server: &mut dyn Server) -> Outcome {
    let line = format!("GD0000{:04}01", sensor(server)?.last_step);
    expect(server, &line, "10")
}

fn clock(server: &mut dyn Server) -> Outcome {
    expect(server, "TM1", "04").or_else(|_| expect(server, "TM1", "01"))?;
    expect(server, "TM0", "00")?;
    let stamp = |message: &[u8]| {
        let reply = Reply::parse(message)?;
        decode(checked(reply.lines().next()?)?)
    };
    let first = stamp(&ask(server, "TM1")?).ok_or("no stamp")?;
    listen(server, 0.5);
    let second = stamp(&ask(server, "TM1")?).ok_or("no stamp")?;
    let gone = second.wrapping_sub(first) & 0xFF_FFFF;
    ensure((300..5000).contains(&gone), || format!("{gone} ms in half a second and a little"))?;
    expect(server, "TM2", "00")
}

fn gets(server: &mut dyn Server) -> Outcome {
    let last = sensor(server)?.last_step;
    expect(server, "BM", "00")?;
    for letter in ["S", "D", "E"] {
        let message = ask(server, &format!("G{letter}0000{last:04}01"))?;
        let reply = Reply::parse(&message).ok_or("no reply")?;
        ensure(reply.status == status::OK, || format!("G{letter} gives {:?}", reply.status))?;
    }
    ask(server, &format!("GD0100{last:04}03")).map(drop)
}

fn counted(server: &mut dyn Server) -> Outcome {
    let last = sensor(server)?.last_step;
    for letter in ["D", "S", "E"] {
        let head = format!("M{letter}0000{last:04}010");
        server.send(format!("{head}03\n").as_bytes());
        let heard = messages(&listen(server, 1.5));
        heard.iter().try_for_each(|message| judge(message))?;
        let wanted: Vec<String> = ["03", "02", "01", "00"].map(|count| format!("{head}{count}")).into();
        let echoes: Vec<String> = heard.iter().map(|m| String::from_utf8_lossy(echo(m)).into_owned()).collect();
        ensure(echoes == wanted, || format!("{echoes:?}, not {wanted:?}"))?;
    }
    Ok(())
}

fn streams(server: &mut dyn Server) -> Outcome {
    let last = sensor(server)?.last_step;
    server.send(format!("MD0000{last:04}03100;text\n").as_bytes());
    let heard = messages(&listen(server, 2.0));
    ensure(heard.len() >= 5, || format!("{} messages in two seconds", heard.len()))?;
    let mut before = None;
    for message in &heard {
        judge(message)?;
        let reply = Reply::parse(message).ok_or("no reply")?;
        if reply.status == status::SCAN {
            let parameters = reply.echo.get(2..15).ok_or("a short echo")?;
            let (stamp, _) = read(&reply, b'D', parameters)?;
            let ahead = before.map_or(1, |before| stamp.wrapping_sub(before) & 0xFF_FFFF);
            ensure((1..0x80_0000).contains(&ahead), || "stamps do not rise".into())?;
            before = Some(stamp);
        }
    }
    expect(server, "QT", "00")?;
    ensure(messages(&listen(server, 0.5)).is_empty(), || "it streams on".into())
}

fn replaces(server: &mut dyn Server) -> Outcome {
    let last = sensor(server)?.last_step;
    server.send(format!("MD0000{last:04}01000\n").as_bytes());
    listen(server, 0.5);
    server.send(b"MS0100020001000\n");
    listen(server, 0.3);
    let heard = messages(&listen(server, 0.5));
    let is_new = |message: &Vec<u8>| echo(message) == b"MS0100020001000";
    ensure(!heard.is_empty() && heard.iter().all(is_new), || "the old stream goes on".into())
}
