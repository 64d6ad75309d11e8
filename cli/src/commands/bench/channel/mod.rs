//! `sinew bench channel`: what a round trip between two processes costs, beside the floor (a bare futex pair), the
//! ordinary (a pipe) and the peer (iceoryx2). All run at the same time, in turns, so that all meet the same machine.

mod futex_pair;
#[cfg(feature = "iceoryx2")]
mod iceoryx2_services;
mod line;
mod local;
pub mod partner;
mod pipe_pair;
mod sinew_channels;

use super::machine::Before;
use super::placement::{Placement, is_alike};
use super::report::{Report, Row, Target, Value, figure};
use super::scratch::Scratch;
use super::timing::Times;
use super::witness::Witnesses;
use crate::exit::Failure;
use line::Engine;
use partner::Partner;
use runtime::clock;

/// Round trips, costs of single operations by name and size, and remarks.
type Figures = (Vec<Measured>, Vec<(&'static str, usize, Times)>, Vec<String>);

/// Payload [byte] and round trips per engine.
const SIZES: [(usize, usize); 4] = [(64, 20_000), (3 * 1024, 20_000), (230 * 1024, 5_000), (1024 * 1024, 2_000)];
/// Turns that an engine gets.
const TURNS: usize = 20;
/// Round trips before the first that counts, per engine.
const WARM_UP: usize = 200;
/// Part of the time in which the measured core rests: a real-time thread that never sleeps would be throttled.
const REST: f64 = 0.15;

/// Times of one engine in one placement at one size.
struct Measured {
    engine: Engine,
    placement: Placement,
    size: usize,
    times: Times,
}

/// Runs all of it; `part` of the usual number of round trips.
pub fn run(part: f64) -> Result<Report, Failure> {
    let scratch = Scratch::new()?;
    let before = Before::now();
    let witnesses = Witnesses::start()?;
    // A thread of its own: what it does to its scheduling ends with it.
    let measure = || -> Result<Figures, Failure> {
        let (mut all, mut scheduling) = (Vec::new(), Vec::new());
        for placement in Placement::all() {
            let place = scratch.path();
            let (measured, how) = in_thread(|| engines(placement, part, place))?;
            all.extend(measured);
            scheduling.push(format!("{}: {how}", placement.name()));
        }
        let folder = scratch.folder("local")?;
        let local = in_thread(|| {
            Placement::SameCore.enter(false);
            local::measure(&folder, part)
        })?;
        Ok((all, local, scheduling))
    };
    let measured = measure();
    let seen = witnesses.stop();
    #[cfg(feature = "iceoryx2")]
    iceoryx2_services::clean(scratch.path());
    let (all, local, scheduling) = measured?;
    let name = |m: &Measured| format!("{}_{}", m.engine.name(), m.placement.name());
    let mut rows: Vec<Row> = all.iter().map(|m| m.times.row(&name(m), m.size, &seen)).collect();
    rows.extend(local.iter().map(|(name, size, times)| times.row(name, *size, &seen)));
    let machine = before.finish(scheduling, &seen);
    let (values, targets) = judge(&rows);
    Ok(Report { bench: "channel", machine, rows, values, targets, notes: notes() })
}

fn in_thread<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    std::thread::scope(|scope| scope.spawn(work).join()).unwrap_or_else(|e| std::panic::resume_unwind(e))
}

/// All engines and sizes in one placement, and how the processes were scheduled.
fn engines(placement: Placement, part: f64, folder: &std::path::Path) -> Result<(Vec<Measured>, String), Failure> {
    let mut all = Vec::new();
    let (mut entered, mut answering) = (None, String::new());
    for (size, round_trips) in SIZES {
        let started: Result<Vec<Partner>, Failure> =
            Engine::ALL.iter().map(|engine| Partner::start(*engine, placement, size, folder)).collect();
        let mut partners = started?;
        let own = entered.get_or_insert_with(|| placement.enter(false)).clone();
        if let Some(other) = partners.iter().find(|partner| !is_alike(&partner.scheduling, &own)) {
            return Err(Failure::from(format!("asking: {own}; answering: {}: no fair comparison", other.scheduling)));
        }
        answering.clone_from(&partners[0].scheduling);
        let turn = ((round_trips as f64 * part) as usize / TURNS).max(10);
        let mut times: Vec<Times> = partners.iter().map(|_| Times::with_room_for(turn * TURNS)).collect();
        for partner in &mut partners {
            round_trips_of(partner, WARM_UP.min(turn * TURNS), None)?;
        }
        for first in 0..TURNS {
            for k in 0..partners.len() {
                let k = (first + k) % partners.len();
                round_trips_of(&mut partners[k], turn, Some(&mut times[k]))?;
            }
        }
        for (partner, times) in partners.iter().zip(times) {
            all.push(Measured { engine: partner.engine, placement, size, times });
        }
    }
    Ok((all, format!("asking {}; answering {answering}", entered.unwrap_or_default())))
}

fn round_trips_of(partner: &mut Partner, count: usize, mut times: Option<&mut Times>) -> Result<(), Failure> {
    let begun = clock::now();
    for _ in 0..count {
        let begin = clock::now();
        partner.round_trip()?;
        let end = clock::now();
        if let Some(times) = &mut times {
            times.push(begin, end);
        }
    }
    clock::sleep_s(clock::now().since(begun) * REST);
    Ok(())
}

/// The aims of the project for channels. They are judged on one core, where the two processes always meet the same
/// scheduler; in the other placements waking a core outweighs all else, and in `free` the kernel may give one engine a
/// second core and the next one none.
fn judge(rows: &[Row]) -> (Vec<Value>, Vec<Target>) {
    let p50 = |name: &str, size: usize| {
        let row = rows.iter().find(|row| row.name == name && row.size_bytes == size);
        row.map(|row| row.p50_us)
    };
    let (mut values, mut targets) = (Vec::new(), Vec::new());
    for placement in Placement::all().into_iter().filter(|placement| *placement != Placement::Free) {
        for other in ["futex", "futex_waitv", "iceoryx2"] {
            for (size, _) in SIZES {
                let of = |engine: &str| p50(&format!("{engine}_{}", placement.name()), size);
                if let Some((own, other_us)) = of("sinew").zip(of(other)) {
                    let name = format!("sinew_to_{other}_{}_{size}", placement.name());
                    values.push(Value::new(name, own / other_us, "ratio of p50"));
                }
            }
        }
    }
    let of = |engine: &str, size: usize| p50(&format!("{engine}_same_core"), size);
    if let Some((own, floor)) = of("sinew", 64).zip(of("futex", 64)) {
        targets.push(Target {
            aim: "64 B, same core: p50 with two wait words at most 1.3 × the bare futex pair's".into(),
            measured: format!("{} / {} µs = {:.2}", figure(own), figure(floor), own / floor),
            reached: own <= 1.3 * floor,
        });
    }
    for size in [64, 3 * 1024] {
        if let Some((own, peer)) = of("sinew", size).zip(of("iceoryx2", size)) {
            targets.push(Target {
                aim: format!("{}, same core: p50 below iceoryx2's", super::report::size(size)),
                measured: format!("{} against {} µs", figure(own), figure(peer)),
                reached: own < peer,
            });
        }
    }
    if let Some(publish) = p50("publish_64", 64) {
        targets.push(Target {
            aim: "64 B: publish without a waiting reader at most 1 µs (p50)".into(),
            measured: format!("{} µs", figure(publish)),
            reached: publish <= 1.0,
        });
    }
    (values, targets)
}

fn notes() -> Vec<String> {
    let mut notes = vec![
        "A round trip is: payload written, other process woken, payload copied out there, answer of the same size back. \
         Each side sleeps in the kernel until it is woken. sinew waits on two words (trigger and control), futex on one, \
         futex_waitv on two of which one is idle. CALM leaves out what a stall witness saw held up (HELD UP); MAX is what \
         one run happened to see. Times of publish, latest and clock include one reading of the clock (row clock)."
            .to_owned(),
        "What sinew needs beyond futex_waitv at 64 B is nearly all the kernel's: a reader maps its ring read-only, and to \
         find a futex word behind a read-only page of a file takes the kernel two tries. At 230 KiB and more the copies \
         decide: sinew moves words, not cache lines, because a reader may look at a sample while its writer overwrites it, \
         and a ring goes through all its slots while the others use the same memory again."
            .to_owned(),
    ];
    if cfg!(not(feature = "iceoryx2")) {
        notes.push("iceoryx2 is not built in: `cargo run --release --features iceoryx2 -- bench channel`.".into());
    }
    notes
}
