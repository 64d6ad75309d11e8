//! `sinew cat`: the samples of a channel, for people and for programs. It polls the ring; the writer never notices.

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::live::{Seen, Tap, Which};
use crate::output::{Out, message_lines, number, parse_seconds, select};
use runtime::{Time, clock};
use serde_json::{Value, json};

/// Prints the samples of a channel as they come
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The channel, as in /drivers/base/sonar; the end of it will do where only one path ends so
    path: String,
    /// Prints the newest sample and ends; waits for the first one if there is none
    #[arg(long)]
    once: bool,
    /// Prints the newest N samples that the ring still holds, and ends
    #[arg(long, value_name = "N", conflicts_with = "once")]
    history: Option<u64>,
    /// Goes on with new samples after --history
    #[arg(long, short, requires = "history")]
    follow: bool,
    /// Prints this field alone, as in velocity.linear_x_m_s or tail[3].range_m; may be given several times
    #[arg(long, value_name = "FIELD")]
    field: Vec<String>,
    /// Prints at most this many samples a second, the newest each time
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Gives up when no sample has come for this long
    #[arg(long, value_name = "TIME")]
    timeout: Option<String>,
    /// Prints a JSON object per line
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// How often the ring is looked at [s].
const POLL_S: f64 = 0.02;
/// `--once` waits so long for a first sample where nothing else is said [s].
const FIRST_S: f64 = 5.0;

/// Prints samples.
pub fn run(args: Args) -> Result<(), Failure> {
    let timeout_s = args.timeout.as_deref().map(parse_seconds).transpose().map_err(|e| Failure::new(USAGE, e))?;
    if args.rate.is_some_and(|hz| !(hz > 0.0 && hz.is_finite())) {
        return Err(Failure::new(USAGE, "--rate takes a number above 0, in samples per second"));
    }
    let robot = args.which.find()?;
    let mut tap = robot.tap(&args.path)?;
    let mut printer = Printer::new(&args);
    if let Some(samples) = args.history {
        tap.rewind(samples);
        while let Some(sample) = tap.next_unread() {
            printer.print(&tap, &sample)?;
        }
        printer.out.flush()?;
        if !args.follow {
            return Ok(());
        }
    } else {
        tap.rewind(1);
    }
    let patience_s = timeout_s.or(args.once.then_some(FIRST_S));
    let mut heard = clock::now();
    let mut printed: Option<Time> = None;
    loop {
        let now = clock::now();
        if args.rate.is_none_or(|hz| printed.is_none_or(|last| now.since(last) * hz >= 1.0)) {
            if args.rate.is_some() || printer.paints_in_place() {
                tap.skip_to_newest();
            }
            while let Some(sample) = tap.next_unread() {
                printer.print(&tap, &sample)?;
                if args.once {
                    return printer.out.flush();
                }
                (heard, printed) = (now, Some(now));
            }
        }
        printer.out.flush()?;
        if patience_s.is_some_and(|patience_s| now.since(heard) > patience_s) {
            let text = format!("no sample on {} for {:.1} s: {}", tap.path(), now.since(heard), silence(&tap));
            return Err(Failure::new(NOT_RUNNING, text));
        }
        if !tap.follow()? {
            let text = format!("channel {} is gone: the robot was stopped", tap.path());
            return Err(Failure::new(NOT_RUNNING, text));
        }
        clock::sleep_s(POLL_S);
    }
}

/// Why a channel may be silent.
fn silence(tap: &Tap) -> String {
    match tap.ring().writer_pid() {
        Some(pid) if crate::live::is_alive(pid) => format!("its writer, process {pid}, lives but writes nothing"),
        Some(pid) => format!("its writer, process {pid}, is dead (`sinew logs` may say why)"),
        None => "it has no writer".into(),
    }
}

/// Prints samples one way or another.
struct Printer<'a> {
    out: Out,
    args: &'a Args,
    generation: Option<u64>,
    /// Lines of the sample before, which the next one is painted over.
    painted: usize,
}

impl Printer<'_> {
    fn new(args: &Args) -> Printer<'_> {
        Printer { out: Out::stdout(), args, generation: None, painted: 0 }
    }

    /// On a terminal a stream of whole messages stands still and changes, as people read it best.
    fn paints_in_place(&self) -> bool {
        let args = self.args;
        self.out.is_terminal() && !args.json && !args.once && args.history.is_none() && args.field.is_empty()
    }

    fn print(&mut self, tap: &Tap, sample: &Seen) -> Result<(), Failure> {
        let values: Result<Vec<Value>, String> =
            self.args.field.iter().map(|field| select(&sample.message, field)).collect();
        let values = values.map_err(|reason| Failure::new(USAGE, format!("{}: {reason}", tap.path())))?;
        let lines = match (self.args.json, self.args.field.is_empty()) {
            (true, whole) => vec![json_line(tap.path(), sample, (!whole).then_some(values)).to_string()],
            (false, false) => vec![values.iter().map(bare).collect::<Vec<_>>().join("\t")],
            (false, true) => {
                let mut lines = vec![self.heading(tap, sample)];
                lines.extend(message_lines(tap.schema(), &sample.message, self.out.paint));
                lines
            }
        };
        if self.generation.is_some_and(|before| before != sample.generation) && !self.args.json {
            eprintln!("{}: its writer was restarted (life {})", tap.path(), sample.generation);
        }
        self.generation = Some(sample.generation);
        match self.paints_in_place() {
            true => self.repaint(&lines),
            false => lines.iter().try_for_each(|line| self.out.line(line)),
        }
    }

    /// One line over a sample: number, time, age, losses.
    fn heading(&self, tap: &Tap, sample: &Seen) -> String {
        let paint = self.out.paint;
        let age_ms = clock::now().since(sample.stamp) * 1e3;
        let lost = match sample.dropped {
            0 => String::new(),
            dropped => format!("  dropped {dropped}"),
        };
        let life = if sample.generation > 1 { format!("  life {}", sample.generation) } else { String::new() };
        let facts = format!("#{}  {:.3} s  age {age_ms:.0} ms{life}{lost}", sample.sequence, sample.stamp.seconds());
        format!("{} {}  {}", paint.strong(tap.path()), tap.schema().name, paint.dim(facts))
    }

    fn repaint(&mut self, lines: &[String]) -> Result<(), Failure> {
        let rows = self.out.size().map_or(usize::MAX, |(_, rows)| rows.saturating_sub(1));
        if self.painted > 0 {
            self.out.raw(&format!("\x1b[{}A", self.painted))?;
        }
        let cut = lines.len() > rows;
        let whole = if cut { rows.saturating_sub(1) } else { lines.len() };
        let more = cut.then(|| self.out.paint.dim(format!("  … {} more lines; --once shows all", lines.len() - whole)));
        self.painted = 0;
        for line in lines[..whole].iter().chain(&more) {
            // No wrapping, so that a line is a line; then clear what the line before had more.
            self.out.raw(&format!("\x1b[?7l{line}\x1b[?7h\x1b[K\n"))?;
            self.painted += 1;
        }
        self.out.raw("\x1b[J")
    }
}

/// A sample for programs.
fn json_line(path: &str, sample: &Seen, values: Option<Vec<Value>>) -> Value {
    let mut line = json!({
        "path": path,
        "stamp_ns": sample.stamp.nanos(),
        "sequence": sample.sequence,
        "generation": sample.generation,
        "dropped": sample.dropped,
    });
    match values {
        Some(values) => line["values"] = Value::Array(values),
        None => line["message"] = sample.message.clone(),
    }
    line
}

/// A value alone, for shells: no quotes, all digits.
fn bare(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Array(items) => items.iter().map(bare).collect::<Vec<_>>().join(" "),
        Value::Number(n) if n.is_f64() && n.as_f64().is_some_and(|f| f.abs() >= 1e15) => {
            number(n.as_f64().unwrap_or(0.0))
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Seen {
        Seen {
            stamp: Time::from_nanos(1_500_000_000),
            sequence: 42,
            generation: 2,
            dropped: 3,
            message: json!({"x_m": 0.25, "stop": "none"}),
        }
    }

    #[test]
    fn a_line_of_json_tells_where_when_and_what_was_lost() {
        assert_eq!(
            json_line("/a/b/c", &sample(), None).to_string(),
            r#"{"path":"/a/b/c","stamp_ns":1500000000,"sequence":42,"generation":2,"dropped":3,"message":{"x_m":0.25,"stop":"none"}}"#
        );
        let values = Some(vec![json!(0.25)]);
        assert!(json_line("/a/b/c", &sample(), values).to_string().ends_with(r#""dropped":3,"values":[0.25]}"#));
    }

    #[test]
    fn fields_alone_are_bare_for_shells() {
        assert_eq!(bare(&json!("none")), "none");
        assert_eq!(bare(&json!(0.1)), "0.1");
        assert_eq!(bare(&json!([1, 2.5, "up"])), "1 2.5 up");
    }
}
