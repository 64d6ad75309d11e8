//! Colours, only where a person looks: on a terminal, and not when `NO_COLOR` is set; `CLICOLOR_FORCE` insists.

use std::fmt::Display;
use std::io::IsTerminal;

/// How a text is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// As it is.
    #[default]
    Plain,
    /// Less important.
    Dim,
    /// A heading or the main thing.
    Strong,
    /// A name that can be typed.
    Name,
    /// All is well.
    Good,
    /// Look here.
    Warn,
    /// Something is wrong.
    Bad,
}

/// Paints texts, or leaves them as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Paint {
    on: bool,
}

impl Paint {
    /// No colours.
    pub const OFF: Paint = Paint { on: false };
    /// Colours.
    pub const ON: Paint = Paint { on: true };

    /// Colours for standard error.
    pub fn stderr() -> Paint {
        Paint::wanted_on(std::io::stderr().is_terminal())
    }

    /// Colours for a stream that is a terminal or not.
    pub fn wanted_on(terminal: bool) -> Paint {
        let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let forced = std::env::var_os("CLICOLOR_FORCE").is_some_and(|value| !value.is_empty() && value != "0");
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        Paint { on: !set("NO_COLOR") && (forced || terminal && !dumb) }
    }

    /// `text` in `tone`.
    pub fn tone(self, tone: Tone, text: impl Display) -> String {
        let code = match tone {
            _ if !self.on => return text.to_string(),
            Tone::Plain => return text.to_string(),
            Tone::Dim => "2",
            Tone::Strong => "1",
            Tone::Name => "36",
            Tone::Good => "32",
            Tone::Warn => "33",
            Tone::Bad => "31",
        };
        format!("\x1b[{code}m{text}\x1b[0m")
    }

    /// `text` in one of the six colours that tell lines apart.
    pub fn colour(self, number: usize, text: impl Display) -> String {
        match self.on {
            true => format!("\x1b[3{}m{text}\x1b[0m", 1 + number % 6),
            false => text.to_string(),
        }
    }

    /// Less important.
    pub fn dim(self, text: impl Display) -> String {
        self.tone(Tone::Dim, text)
    }

    /// The main thing.
    pub fn strong(self, text: impl Display) -> String {
        self.tone(Tone::Strong, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_person_the_text_stays_as_it_is() {
        assert_eq!(Paint::OFF.tone(Tone::Bad, "no"), "no");
        assert_eq!(Paint::ON.tone(Tone::Bad, "no"), "\x1b[31mno\x1b[0m");
        assert_eq!(Paint::ON.tone(Tone::Plain, "yes"), "yes");
    }
}
