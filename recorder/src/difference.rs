//! The first difference between what a node did and what it does: where, how, and from which inputs.

use runtime::Time;
use runtime::replay::{self, RecordedStep, ReplayNode};
use serde::Serialize;
use serde_json::{Value, json};

use crate::replay::Channels;

/// The first difference of a node, with all that led to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstDifference {
    /// Number of the step.
    pub step: u64,
    /// When it was, on the robot's clock [s].
    pub at_s: f64,
    /// The path, or `device`, `calls` or `fault`.
    pub path: String,
    /// Number of the sample; 0 where it is none.
    pub sequence: u64,
    /// What differs, one line each: field, recorded, replayed.
    pub fields: Vec<FieldDifference>,
    /// What was recorded.
    pub recorded: Value,
    /// What the replay gives.
    pub replayed: Value,
    /// The samples that the step saw.
    pub inputs: Vec<Input>,
    /// What reached the step otherwise.
    pub events: Vec<String>,
}

/// One field that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldDifference {
    /// The field, as in `velocity.linear_x_m_s` or `tail[3].range_m`.
    pub field: String,
    /// What was recorded.
    pub recorded: Value,
    /// What the replay gives.
    pub replayed: Value,
}

/// One sample that a step saw: the newest of a source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Input {
    /// Its path.
    pub path: String,
    /// Its number.
    pub sequence: u64,
    /// Its stamp [s].
    pub stamp_s: f64,
    /// Its message.
    pub message: Value,
}

/// Fields listed at most.
const MOST_FIELDS: usize = 16;

impl FirstDifference {
    fn of(step: &RecordedStep<'_>, path: &str, sequence: u64) -> FirstDifference {
        FirstDifference {
            step: step.inputs.step,
            at_s: Time::from_nanos(step.inputs.now_ns).seconds(),
            path: path.into(),
            sequence,
            fields: Vec::new(),
            recorded: Value::Null,
            replayed: Value::Null,
            inputs: Vec::new(),
            events: Vec::new(),
        }
    }

    /// A sample that differs, or that was not written then.
    pub(crate) fn of_sample(
        channels: &Channels,
        step: &RecordedStep<'_>,
        path: &str,
        sequence: u64,
        stamp: Time,
        fixed: &[u8],
        tail: &[u8],
    ) -> FirstDifference {
        let mut first = FirstDifference::of(step, path, sequence);
        let Some(held) = channels.get(path) else { return first };
        let message = |stamp: Time, fixed: &[u8], tail: &[u8]| {
            let mut value = held.schema.to_json(fixed, tail);
            if let Some(fields) = value.as_object_mut() {
                fields.insert("stamp_ns".into(), json!(stamp.nanos()));
            }
            value
        };
        first.replayed = message(stamp, fixed, tail);
        if let Some((sample, fixed, tail)) = held.numbered(sequence) {
            first.recorded = message(Time::from_nanos(sample.stamp_ns), fixed, tail);
            differences("", &first.recorded, &first.replayed, &mut first.fields);
        }
        first
    }

    /// Other bytes to a device, other answers, or another fault.
    pub(crate) fn of_events(step: &RecordedStep<'_>, recorded: &[u8], replayed: &[u8], fault: bool) -> FirstDifference {
        let path = if recorded == replayed { "fault" } else { "device and calls" };
        let mut first = FirstDifference::of(step, path, 0);
        if recorded == replayed {
            (first.recorded, first.replayed) = (json!(step.inputs.fault != 0), json!(fault));
        } else {
            (first.recorded, first.replayed) = (json!(replay::describe(recorded)), json!(replay::describe(replayed)));
        }
        first
    }

    /// Adds what the step saw.
    pub(crate) fn with_inputs(
        mut self,
        channels: &Channels,
        again: &ReplayNode,
        step: &RecordedStep<'_>,
    ) -> FirstDifference {
        for cursor in step.cursors.iter().filter(|cursor| cursor.port < messages::WRITTEN && cursor.sequence > 0) {
            let Some(path) = again.source_path(cursor.source) else { continue };
            let Some((held, (sample, fixed, tail))) =
                channels.get(path).and_then(|held| Some((held, held.numbered(cursor.sequence)?)))
            else {
                continue;
            };
            self.inputs.push(Input {
                path: path.into(),
                sequence: sample.sequence,
                stamp_s: Time::from_nanos(sample.stamp_ns).seconds(),
                message: held.schema.to_json(fixed, tail),
            });
        }
        self.events = replay::describe(step.events);
        self
    }
}

/// Lists the fields in which two messages differ.
fn differences(name: &str, recorded: &Value, replayed: &Value, found: &mut Vec<FieldDifference>) {
    if recorded == replayed || found.len() >= MOST_FIELDS {
        return;
    }
    match (recorded, replayed) {
        (Value::Object(one), Value::Object(other)) => {
            for (key, value) in one {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                differences(&name, value, other.get(key).unwrap_or(&Value::Null), found);
            }
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            for (index, (value, other)) in one.iter().zip(other).enumerate() {
                differences(&format!("{name}[{index}]"), value, other, found);
            }
        }
        _ => found.push(FieldDifference { field: name.into(), recorded: recorded.clone(), replayed: replayed.clone() }),
    }
}
