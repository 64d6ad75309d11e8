//! What is wrong with a JSON value that should become a message: where, why, and what would be right.

use serde_json::Value;

use super::Kind;

/// Why a JSON value is not a message of the expected type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: {problem}", place(.message, .path))]
pub struct JsonError {
    /// The message's type, for example `Odometry`.
    pub message: String,
    /// The field, for example `velocity.linear_x_m_s` or `tail[2].echo`; empty for the whole message.
    pub path: String,
    /// What is wrong there.
    pub problem: JsonProblem,
}

/// What is wrong with a part of a JSON value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JsonProblem {
    /// A field is not there.
    #[error("missing; give {expected}")]
    Missing {
        /// What the field takes.
        expected: String,
    },
    /// A key names no field.
    #[error("no such field; {}", advice(.nearest, .known))]
    UnknownKey {
        /// The field that was probably meant.
        nearest: Option<String>,
        /// All fields.
        known: Vec<String>,
    },
    /// A value has another type, another length, or does not fit.
    #[error("is {found}, but must be {expected}")]
    Wrong {
        /// What is there.
        found: String,
        /// What the field takes.
        expected: String,
    },
    /// A string names none of the field's values.
    #[error("\"{found}\" is none of its values; {}", advice(.nearest, .known))]
    UnknownValue {
        /// What is there.
        found: String,
        /// The value that was probably meant.
        nearest: Option<String>,
        /// All values.
        known: Vec<String>,
    },
}

impl JsonError {
    pub(super) fn at(path: &str, problem: JsonProblem) -> JsonError {
        JsonError { message: String::new(), path: path.to_owned(), problem }
    }

    /// The same error as seen from the struct or array around it.
    pub(super) fn within(mut self, outer: &str) -> JsonError {
        let dot = if self.path.is_empty() || self.path.starts_with('[') { "" } else { "." };
        self.path = format!("{outer}{dot}{}", self.path);
        self
    }
}

/// The candidate that a mistyped word probably means.
pub(super) fn nearest(word: &str, candidates: &[String]) -> Option<String> {
    let alike = |candidate: &&String| strsim::jaro_winkler(word, candidate);
    candidates.iter().max_by(|a, b| alike(a).total_cmp(&alike(b))).filter(|best| alike(best) > 0.7).cloned()
}

/// What a field takes, as the end of a sentence.
pub(super) fn expectation(kind: &Kind, count: Option<usize>, unit: Option<&str>, values: &[String]) -> String {
    let one = match kind {
        _ if !values.is_empty() => format!("one of {}", values.join(", ")),
        Kind::Struct(schema) => {
            let fields: Vec<&str> = schema.fields.iter().map(|field| field.name.as_str()).collect();
            format!("an object, {} {{{}}}", schema.name, fields.join(", "))
        }
        Kind::F32 => "a number of at most ±3.4e38, \"nan\", \"inf\" or \"-inf\"".to_owned(),
        Kind::F64 => "a number, \"nan\", \"inf\" or \"-inf\"".to_owned(),
        Kind::U8 => format!("an integer from 0 to {}", u8::MAX),
        Kind::U16 => format!("an integer from 0 to {}", u16::MAX),
        Kind::U32 => format!("an integer from 0 to {}", u32::MAX),
        Kind::U64 => format!("an integer from 0 to {}", u64::MAX),
        Kind::I8 => format!("an integer from {} to {}", i8::MIN, i8::MAX),
        Kind::I16 => format!("an integer from {} to {}", i16::MIN, i16::MAX),
        Kind::I32 => format!("an integer from {} to {}", i32::MIN, i32::MAX),
        Kind::I64 => format!("an integer from {} to {}", i64::MIN, i64::MAX),
    };
    let unit = unit.map_or(String::new(), |unit| format!(" [{unit}]"));
    match count {
        Some(count) => format!("an array of exactly {count}, each {one}{unit}"),
        None => format!("{one}{unit}"),
    }
}

/// A value as an error shows it: whole when short.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(flag) => format!("{flag}"),
        Value::Number(number) => format!("{number}"),
        Value::String(text) if text.chars().count() <= 40 => format!("the string {text:?}"),
        Value::String(text) => format!("the string {:?}…", text.chars().take(40).collect::<String>()),
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".to_owned(),
    }
}

fn place(message: &str, path: &str) -> String {
    if path.is_empty() { message.to_owned() } else { format!("`{path}` of {message}") }
}

fn advice(nearest: &Option<String>, known: &[String]) -> String {
    let known = if known.is_empty() { "there are none".to_owned() } else { known.join(", ") };
    match nearest {
        Some(nearest) => format!("did you mean `{nearest}`? (known: {known})"),
        None => format!("known: {known}"),
    }
}
