//! Errors in a robot file: where, why, what to do.

use std::fmt;
use std::ops::Range;

/// One error in a robot file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotError {
    /// The file, as the user named it.
    pub file: String,
    /// Line and column, from 1, where that is known.
    pub at: Option<(usize, usize)>,
    /// The line itself.
    pub excerpt: Option<String>,
    /// What is wrong.
    pub reason: String,
    /// What to do about it.
    pub advice: Option<String>,
}

impl RobotError {
    /// An error that belongs to no place in the text.
    pub fn plain(file: &str, reason: impl Into<String>) -> RobotError {
        RobotError { file: file.into(), at: None, excerpt: None, reason: reason.into(), advice: None }
    }

    /// An error at the bytes `span` of `text`.
    pub fn at(file: &str, text: &str, span: Option<Range<usize>>, reason: impl Into<String>) -> RobotError {
        let mut error = RobotError::plain(file, reason);
        if let Some(span) = span {
            let start = span.start.min(text.len());
            let before = text.get(..start).unwrap_or("");
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
            error.at = Some((line, column));
            error.excerpt = text.lines().nth(line - 1).map(str::to_owned);
        }
        error
    }

    /// The same error with advice.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> RobotError {
        self.advice = Some(advice.into());
        self
    }

    /// What serde and the TOML parser said, with the nearest valid key where a key is unknown.
    pub fn from_toml(file: &str, text: &str, error: &toml::de::Error) -> RobotError {
        let message = error.message();
        let built = RobotError::at(file, text, error.span(), tidy(message));
        match unknown_key(message) {
            Some((unknown, valid)) => built.advise(nearest_advice(&unknown, &valid)),
            None => built,
        }
    }
}

/// "did you mean …" for a word that is none of `valid`.
pub fn nearest_advice<S: AsRef<str>>(word: &str, valid: &[S]) -> String {
    let best = valid.iter().map(AsRef::as_ref).min_by_key(|name| strsim::damerau_levenshtein(word, name));
    let list = valid.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    match best {
        Some(name) if strsim::damerau_levenshtein(word, name) <= 3.max(word.len() / 2) => {
            format!("did you mean \"{name}\"? Valid here: {list}")
        }
        Some(_) => format!("valid here: {list}"),
        None => "nothing may stand here".into(),
    }
}

/// The unknown word and the valid ones out of serde's "unknown field" or "unknown variant" message.
fn unknown_key(message: &str) -> Option<(String, Vec<String>)> {
    if !message.starts_with("unknown field") && !message.starts_with("unknown variant") {
        return None;
    }
    let mut quoted = message.split('`').skip(1).step_by(2).map(str::to_owned);
    let unknown = quoted.next()?;
    Some((unknown, quoted.collect()))
}

/// The message without serde's list of valid keys, which the advice repeats.
fn tidy(message: &str) -> String {
    let head = message.split(", expected").next().unwrap_or(message);
    match message.starts_with("unknown field") {
        true => head.replace("unknown field", "unknown key").replace('`', "\""),
        false if message.starts_with("unknown variant") => {
            head.replace("unknown variant", "unknown word").replace('`', "\"")
        }
        false => message.trim_end().replace('`', "\""),
    }
}

impl fmt::Display for RobotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some((line, column)) = self.at {
            write!(f, ":{line}:{column}")?;
        }
        write!(f, ": {}", self.reason)?;
        if let (Some((line, column)), Some(excerpt)) = (self.at, &self.excerpt) {
            let number = line.to_string();
            write!(f, "\n{number} | {excerpt}\n{} | {}^", " ".repeat(number.len()), " ".repeat(column - 1))?;
        }
        match &self.advice {
            Some(advice) => write!(f, "\n{advice}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for RobotError {}
