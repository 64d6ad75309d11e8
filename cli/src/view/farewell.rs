//! The last words of a run: how far, how fast, what happened, what ended it.

use super::json;
use super::line::clock;
use super::{Face, Seen};
use crate::exit::Failure;
use crate::output::{Out, Paint, Tone, count};
use std::path::Path;
use supervisor::{Outcome, StopCause};

/// Says how the run went; `picture` is where its drawing was put.
pub fn farewell(face: Face, outcome: &Outcome, seen: &Seen, picture: &Path) -> Result<(), Failure> {
    let mut out = Out::stdout();
    match face {
        Face::Json => out.json(&json::of_end(outcome, seen))?,
        Face::Lines | Face::Screen => {
            let drawn = seen.track.len() > 1 && picture.as_os_str() != "none";
            let picture = drawn.then(|| picture.display().to_string());
            sentences(outcome, seen, picture, out.paint).iter().try_for_each(|line| out.line(line))?;
        }
    }
    out.flush()
}

fn sentences(outcome: &Outcome, seen: &Seen, picture: Option<String>, paint: Paint) -> Vec<String> {
    let mut lines = vec![format!(
        "{} {}, {:.1} m at {:.2} m/s{}",
        paint.strong("ran"),
        clock(outcome.ran_s).trim_start(),
        seen.distance_m,
        seen.mean_speed_m_s,
        ended_by(outcome.stopped_by)
    )];
    if let Some([drove, reversed, suffered]) = seen.contacts {
        let caused = drove + reversed;
        let tone = if caused == 0 { Tone::Good } else { Tone::Bad };
        let verdict = paint.tone(tone, format!("{} caused", count(caused as usize, "contact")));
        lines.push(format!("{verdict}, {suffered} suffered, least clearance {:.2} m", seen.least_clearance_m));
    }
    if outcome.restarts > 0 {
        lines.push(format!("{}; `sinew logs` tells more", count(outcome.restarts as usize, "restart")));
    }
    if let Some(picture) = picture {
        lines.push(format!("drawn in {picture}"));
    }
    lines
}

/// What ended the run, where it was not the person's own key or time limit.
fn ended_by(cause: StopCause) -> String {
    match cause {
        StopCause::Program => String::new(),
        StopCause::NothingLeft => "; ended because no node was left".into(),
        cause => format!("; ended by {cause}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_words_say_what_matters() {
        let outcome = Outcome {
            stopped_by: StopCause::Signal(2),
            ran_s: 62.0,
            lost: Vec::new(),
            restarts: 3,
            incidents: Vec::new(),
        };
        let seen = Seen {
            contacts: Some([0, 0, 1]),
            distance_m: 12.34,
            mean_speed_m_s: 0.21,
            least_clearance_m: 0.155,
            track: Vec::new(),
        };
        let lines = sentences(&outcome, &seen, Some("run.svg".into()), Paint::OFF);
        assert_eq!(
            lines,
            [
                "ran 1:02, 12.3 m at 0.21 m/s; ended by SIGINT",
                "0 contacts caused, 1 suffered, least clearance 0.15 m",
                "3 restarts; `sinew logs` tells more",
                "drawn in run.svg",
            ]
        );
    }
}
