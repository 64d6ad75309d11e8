//! What is wrong with a world file, where, and what to do about it.

use std::fmt;

/// A file that describes no world.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct WorldError {
    /// The file, as it was named.
    pub file: String,
    /// Line and column, counted from 1, when the fault has a place.
    pub place: Option<(usize, usize)>,
    /// What is wrong.
    pub reason: String,
    /// What to do about it.
    pub remedy: String,
}

impl fmt::Display for WorldError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.file)?;
        if let Some((line, column)) = self.place {
            write!(out, ":{line}:{column}")?;
        }
        write!(out, ": {}; {}", self.reason, self.remedy)
    }
}

impl WorldError {
    /// A fault of the whole file.
    pub fn of_file(file: &str, reason: impl Into<String>, remedy: impl Into<String>) -> WorldError {
        WorldError { file: file.to_owned(), place: None, reason: reason.into(), remedy: remedy.into() }
    }

    /// A fault at byte `offset` of `text`.
    pub fn at(
        file: &str,
        text: &str,
        offset: usize,
        reason: impl Into<String>,
        remedy: impl Into<String>,
    ) -> WorldError {
        let mut before = offset.min(text.len());
        while !text.is_char_boundary(before) {
            before -= 1;
        }
        let head = &text[..before];
        let line = head.matches('\n').count() + 1;
        let column = head.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
        WorldError { file: file.to_owned(), place: Some((line, column)), reason: reason.into(), remedy: remedy.into() }
    }
}

/// The known word nearest to `word`, if one is near enough to be what was meant.
pub(crate) fn nearest_word<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    known
        .map(|candidate| (strsim::damerau_levenshtein(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= 2 + candidate.len() / 4)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_names_file_line_column_reason_and_remedy() {
        let text = "a = 1\nblé = x";
        let error = WorldError::at("w.toml", text, text.find('x').unwrap(), "x is no number", "write one");
        assert_eq!(error.to_string(), "w.toml:2:7: x is no number; write one");
        assert_eq!(WorldError::of_file("w.toml", "it is empty", "fill it").to_string(), "w.toml: it is empty; fill it");
    }

    #[test]
    fn the_nearest_word_is_offered_only_when_it_is_near() {
        assert_eq!(nearest_word("radius", ["radius_m", "centre_m"].into_iter()), Some("radius_m"));
        assert_eq!(nearest_word("colour", ["radius_m", "at_m"].into_iter()), None);
    }
}
