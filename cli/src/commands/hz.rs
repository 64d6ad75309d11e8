//! `sinew hz`: how often a channel's writer writes, and how evenly; by stamps and sequence numbers, so that a slow
//! reader cannot spoil the figure.

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::live::{Tap, Which};
use crate::output::{Out, Paint, rate, span};
use runtime::channel::RawSample;
use runtime::{Time, clock};
use serde::Serialize;

/// Measures the rate and evenness of a channel
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The channel, as in /drivers/base/odometry
    path: String,
    /// Watches for this long; without it the samples in the ring answer at once
    #[arg(long, value_name = "SECONDS")]
    window: Option<f64>,
    /// Goes on: a line per window (1 s where none is given)
    #[arg(long, short)]
    follow: bool,
    /// Prints a JSON object per line
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// How often the ring is looked at while watching [s].
const POLL_S: f64 = 0.005;
/// With less than this in the ring it is watched for a moment more.
const FEW: usize = 3;
/// That moment [s].
const MOMENT_S: f64 = 3.0;

/// Median, 99th percentile and greatest of some spans.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Spread {
    p50: f64,
    p99: f64,
    max: f64,
}

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Measured {
    path: String,
    rate_hz: f64,
    samples: usize,
    span_s: f64,
    spacing_s: Spread,
    jitter_s: Spread,
    /// Samples that this reader missed.
    dropped: u64,
    generation: u64,
    age_s: f64,
}

/// Prints the measurement.
pub fn run(args: Args) -> Result<(), Failure> {
    if args.window.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
        return Err(Failure::new(USAGE, "--window takes a number of seconds above 0"));
    }
    let robot = args.which.find()?;
    let mut tap = robot.tap(&args.path)?;
    let mut out = Out::stdout();
    let window_s = args.window.or(args.follow.then_some(1.0));
    loop {
        let samples = match window_s {
            Some(window_s) => watch(&mut tap, window_s, usize::MAX)?,
            None => from_ring(&mut tap)?,
        };
        match measure(tap.path(), &samples, tap.dropped(), clock::now()) {
            Some(measured) if args.json => out.json(&serde_json::to_value(&measured)?)?,
            Some(measured) if args.follow => out.line(one_line(&measured))?,
            Some(measured) => lines(&measured, out.paint).iter().try_for_each(|line| out.line(line))?,
            None if args.follow => eprintln!("{}: {}", tap.path(), too_few(&samples)),
            None => return Err(Failure::new(NOT_RUNNING, format!("{}: {}", tap.path(), too_few(&samples)))),
        }
        out.flush()?;
        if !args.follow {
            return Ok(());
        }
    }
}

fn too_few(samples: &[RawSample]) -> String {
    match samples.len() {
        0 => "no sample came".into(),
        _ => "a single sample came: a rate needs two".into(),
    }
}

/// The samples in the ring; where it holds next to none, those of the next moment too.
fn from_ring(tap: &mut Tap) -> Result<Vec<RawSample>, Failure> {
    tap.rewind(u64::MAX);
    let mut samples: Vec<RawSample> = std::iter::from_fn(|| tap.next_stamp()).collect();
    if samples.len() < FEW {
        samples.extend(watch(tap, MOMENT_S, FEW - samples.len())?);
    }
    Ok(samples)
}

/// The samples that come within `window_s`, at most `enough`.
fn watch(tap: &mut Tap, window_s: f64, enough: usize) -> Result<Vec<RawSample>, Failure> {
    let until = clock::now().after_s(window_s);
    let mut samples = Vec::new();
    while samples.len() < enough && clock::now() < until {
        samples.extend(std::iter::from_fn(|| tap.next_stamp()));
        if !tap.follow()? {
            let text = format!("channel {} is gone: the robot was stopped", tap.path());
            return Err(Failure::new(NOT_RUNNING, text));
        }
        clock::sleep_s(POLL_S.min(until.since(clock::now())));
    }
    Ok(samples)
}

/// The figures of `samples`, of which there must be two.
fn measure(path: &str, samples: &[RawSample], dropped: u64, now: Time) -> Option<Measured> {
    let (first, last) = (samples.first()?, samples.last()?);
    let span_s = seconds(first, last);
    if last.sequence <= first.sequence || span_s <= 0.0 {
        return None;
    }
    // Only neighbours say how evenly the writer writes.
    let neighbours = samples.windows(2).filter(|pair| pair[1].sequence == pair[0].sequence + 1);
    let mut spacing: Vec<f64> = neighbours.map(|pair| seconds(&pair[0], &pair[1])).collect();
    let spacing_s = spread(&mut spacing);
    let mut jitter: Vec<f64> = spacing.iter().map(|s| (s - spacing_s.p50).abs()).collect();
    Some(Measured {
        path: path.to_owned(),
        rate_hz: (last.sequence - first.sequence) as f64 / span_s,
        samples: samples.len(),
        span_s,
        spacing_s,
        jitter_s: spread(&mut jitter),
        dropped,
        generation: last.generation,
        age_s: now.since(Time::from_nanos(last.stamp_ns)),
    })
}

fn seconds(from: &RawSample, to: &RawSample) -> f64 {
    Time::from_nanos(to.stamp_ns).since(Time::from_nanos(from.stamp_ns))
}

fn spread(values: &mut [f64]) -> Spread {
    values.sort_by(f64::total_cmp);
    let at = |q: f64| {
        let index = (q * values.len() as f64).ceil() as usize;
        values.get(index.saturating_sub(1).min(values.len().saturating_sub(1))).copied().unwrap_or(0.0)
    };
    Spread { p50: at(0.5), p99: at(0.99), max: at(1.0) }
}

fn lines(measured: &Measured, paint: Paint) -> Vec<String> {
    let three = |s: Spread| format!("p50 {:>9}   p99 {:>9}   max {:>9}", span(s.p50), span(s.p99), span(s.max));
    let silent = measured.age_s > 1.0 && measured.age_s * measured.rate_hz > 5.0;
    let mut lines = vec![
        format!("{}  {}", paint.strong(&measured.path), paint.strong(rate(measured.rate_hz))),
        format!("  spacing  {}", three(measured.spacing_s)),
        format!("  jitter   {}", three(measured.jitter_s)),
        paint.dim(format!(
            "  {} samples over {}, newest {} old, dropped {}",
            measured.samples,
            span(measured.span_s),
            span(measured.age_s),
            measured.dropped
        )),
    ];
    if silent {
        let tone = crate::output::Tone::Warn;
        lines.push(paint.tone(tone, format!("  silent: the newest sample is {} old", span(measured.age_s))));
    }
    lines
}

fn one_line(measured: &Measured) -> String {
    format!(
        "{:>10}   spacing p50 {} max {}   jitter p99 {}   {} samples   dropped {}",
        rate(measured.rate_hz),
        span(measured.spacing_s.p50),
        span(measured.spacing_s.max),
        span(measured.jitter_s.p99),
        measured.samples,
        measured.dropped
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(sequence: u64, ms: f64) -> RawSample {
        RawSample { sequence, stamp_ns: (ms * 1e6) as u64, generation: 1, tail_bytes: 0 }
    }

    #[test]
    fn the_rate_comes_from_numbers_and_stamps_and_not_from_what_was_seen() {
        // Half of the samples were lost to this reader: the writer's rate stays what it is.
        let samples: Vec<RawSample> = (0..10).map(|k| sample(1 + 2 * k, 200.0 * k as f64)).collect();
        let measured = measure("/a/b/c", &samples, 9, Time::from_seconds(2.0)).unwrap();
        assert!((measured.rate_hz - 10.0).abs() < 1e-9, "{measured:?}");
        assert_eq!(measured.dropped, 9);
        assert!((measured.age_s - 0.2).abs() < 1e-9);
    }

    #[test]
    fn one_late_sample_shows_in_the_greatest_spacing_and_not_in_the_median() {
        let late = |k: u64| if k == 50 { 30.0 } else { 0.0 };
        let samples: Vec<RawSample> = (1..=100).map(|k| sample(k, 100.0 * k as f64 + late(k))).collect();
        let measured = measure("/a/b/c", &samples, 0, Time::ZERO).unwrap();
        assert!((measured.spacing_s.p50 - 0.1).abs() < 1e-9, "{measured:?}");
        assert!((measured.spacing_s.max - 0.13).abs() < 1e-9, "{measured:?}");
        assert!((measured.jitter_s.max - 0.03).abs() < 1e-9, "{measured:?}");
        assert!(measured.jitter_s.p50 < 1e-9, "{measured:?}");
    }

    #[test]
    fn a_single_sample_has_no_rate() {
        assert_eq!(measure("/a/b/c", &[sample(1, 5.0)], 0, Time::ZERO), None);
        assert_eq!(measure("/a/b/c", &[], 0, Time::ZERO), None);
        assert_eq!(measure("/a/b/c", &[sample(1, 5.0), sample(2, 5.0)], 0, Time::ZERO), None);
    }

    #[test]
    fn the_report_reads_well() {
        let samples: Vec<RawSample> = (1..=64).map(|k| sample(k, 100.0 * k as f64)).collect();
        let measured = measure("/drivers/base/sonar", &samples, 0, Time::from_seconds(6.45)).unwrap();
        assert_eq!(
            lines(&measured, Paint::OFF),
            [
                "/drivers/base/sonar  10.0 Hz",
                "  spacing  p50    100 ms   p99    100 ms   max    100 ms",
                "  jitter   p50       0 s   p99       0 s   max       0 s",
                "  64 samples over 6.3 s, newest 50.0 ms old, dropped 0",
            ]
        );
    }
}
