//! The words of a Stage world file: tokens, and the tree that they make.
//!
//! ```text
//! file   = { include "NAME" | define NAME BASE ( body ) | entry }
//! entry  = WORD value...            a property: numbers, strings, [ lists ]
//!        | WORD ( body )            a thing
//! ```
//!
//! `#` begins a comment. Includes are looked for beside the file that has them, then beside the world file.

use crate::world::build::{Loader, beside};
use crate::world::error::WorldError;
use std::rc::Rc;

/// Files within one another at most.
const DEPTH: usize = 8;
/// A world file and all that it includes at most: a guard against files that include each other over and over.
const MAX_TOKENS: usize = 4_000_000;

/// Where a word stands.
#[derive(Debug, Clone)]
pub(super) struct Place {
    source: Rc<(String, String)>,
    offset: usize,
}

impl Place {
    pub fn fault(&self, reason: impl Into<String>, remedy: impl Into<String>) -> WorldError {
        WorldError::at(&self.source.0, &self.source.1, self.offset, reason, remedy)
    }

    /// `FILE:LINE:COLUMN: what`.
    pub fn note(&self, what: &str) -> String {
        let error = self.fault(what, "");
        error.to_string().trim_end_matches("; ").to_owned()
    }

    pub fn file(&self) -> &str {
        &self.source.0
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Word(String),
    Number(f64),
    Text(String),
    Mark(char),
}

/// What a property says.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Number(f64),
    Text(String),
    List(Vec<f64>),
}

/// A property or a thing.
#[derive(Debug, Clone)]
pub(super) enum Entry {
    Property { word: String, value: Value, place: Place },
    Thing { kind: String, body: Vec<Entry>, place: Place },
}

/// What the file defines and what it holds.
#[derive(Debug, Default)]
pub(super) struct Words {
    /// Name, what it is based on, and what it adds.
    pub defined: Vec<(String, String, Vec<Entry>)>,
    pub entries: Vec<Entry>,
}

/// Reads a world file with all that it includes.
pub(super) fn read(file: &str, bytes: &[u8], load: &mut Loader) -> Result<Words, WorldError> {
    let mut tokens = Vec::new();
    tokenize(file, bytes, file, load, 0, &mut tokens)?;
    let mut parser = Parser { tokens, at: 0 };
    let mut words = Words::default();
    while let Some((token, place)) = parser.next() {
        match token {
            Token::Word(word) if word == "define" => {
                let name = parser.word(&place)?;
                let base = parser.word(&place)?;
                parser.mark('(', &place)?;
                let body = parser.body(&place)?;
                words.defined.push((name, base, body));
            }
            Token::Word(word) => words.entries.push(parser.entry(word, place)?),
            other => return Err(place.fault(format!("{} begins nothing", said(&other)), "a word belongs here")),
        }
    }
    Ok(words)
}

fn said(token: &Token) -> String {
    match token {
        Token::Word(word) => format!("`{word}`"),
        Token::Number(number) => format!("the number {number}"),
        Token::Text(text) => format!("the string \"{text}\""),
        Token::Mark(mark) => format!("`{mark}`"),
    }
}

fn tokenize(
    file: &str,
    bytes: &[u8],
    top: &str,
    load: &mut Loader,
    depth: usize,
    tokens: &mut Vec<(Token, Place)>,
) -> Result<(), WorldError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| WorldError::of_file(file, "it is not UTF-8 text", "save it as UTF-8"))?;
    let source = Rc::new((file.to_owned(), text.to_owned()));
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let place = Place { source: source.clone(), offset: text.len() - rest.len() };
        let length_while = |holds: &dyn Fn(char) -> bool| rest.find(|c: char| !holds(c)).unwrap_or(rest.len());
        let length = match first {
            '#' => rest.find('\n').unwrap_or(rest.len()),
            c if c.is_whitespace() => c.len_utf8(),
            '(' | ')' | '[' | ']' => {
                tokens.push((Token::Mark(first), place));
                1
            }
            '"' => {
                let end = rest[1..].find(['"', '\n']).map(|end| end + 1).filter(|end| rest[*end..].starts_with('"'));
                let end = end.ok_or_else(|| place.fault("a string is not closed", "close it with \" in its line"))?;
                tokens.push((Token::Text(rest[1..end].to_owned()), place));
                end + 1
            }
            '+' | '-' | '.' | '0'..='9' => {
                let length = length_while(&|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'));
                let number = rest[..length].parse().ok().filter(|number: &f64| number.is_finite());
                let number = number.ok_or_else(|| {
                    place.fault(format!("`{}` is no number", &rest[..length]), "write for example 0.25")
                })?;
                tokens.push((Token::Number(number), place));
                length
            }
            c if c.is_ascii_alphabetic() || c == '_' => {
                let length = length_while(&|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_' | '[' | ']'));
                tokens.push((Token::Word(rest[..length].to_owned()), place));
                length
            }
            c => return Err(place.fault(format!("`{c}` means nothing here"), "remove it")),
        };
        rest = &rest[length..];
        if let [.., (Token::Word(word), place), (Token::Text(name), _)] = &tokens[..]
            && word == "include"
        {
            let (name, place) = (name.clone(), place.clone());
            tokens.truncate(tokens.len() - 2);
            if depth + 1 == DEPTH {
                return Err(place.fault(format!("files include one another {DEPTH} deep"), "break the circle"));
            }
            let (near, far) = (beside(file, &name), beside(top, &name));
            let (found, bytes) = match load(&near) {
                Ok(bytes) => (near, bytes),
                Err(why) if near == far => return Err(missing(&place, &near, &why)),
                Err(why) => (far.clone(), load(&far).map_err(|_| missing(&place, &near, &why))?),
            };
            tokenize(&found, &bytes, top, load, depth + 1, tokens)?;
        }
        if tokens.len() > MAX_TOKENS {
            return Err(WorldError::of_file(file, "it is too long with all that it includes", "include less"));
        }
    }
    Ok(())
}

fn missing(place: &Place, name: &str, why: &str) -> WorldError {
    place.fault(format!("cannot read {name}: {why}"), "put the file there, or remove the include")
}

struct Parser {
    tokens: Vec<(Token, Place)>,
    at: usize,
}

impl Parser {
    fn next(&mut self) -> Option<(Token, Place)> {
        let found = self.tokens.get(self.at).cloned();
        self.at += usize::from(found.is_some());
        found
    }

    fn word(&mut self, after: &Place) -> Result<String, WorldError> {
        match self.next() {
            Some((Token::Word(word), _)) => Ok(word),
            _ => Err(after.fault("`define` needs a name and what it is based on", "write define NAME BASE ( ... )")),
        }
    }

    fn mark(&mut self, mark: char, after: &Place) -> Result<(), WorldError> {
        match self.next() {
            Some((Token::Mark(found), _)) if found == mark => Ok(()),
            _ => Err(after.fault(format!("`{mark}` is missing after this"), "add it")),
        }
    }

    /// What is within brackets; the opening one has been read.
    fn body(&mut self, opened: &Place) -> Result<Vec<Entry>, WorldError> {
        let mut entries = Vec::new();
        loop {
            match self.next() {
                None => return Err(opened.fault("`(` is never closed", "add `)`")),
                Some((Token::Mark(')'), _)) => return Ok(entries),
                Some((Token::Word(word), place)) => entries.push(self.entry(word, place)?),
                Some((other, place)) => {
                    return Err(place.fault(format!("{} begins nothing", said(&other)), "a word belongs here"));
                }
            }
        }
    }

    fn entry(&mut self, word: String, place: Place) -> Result<Entry, WorldError> {
        match self.next() {
            Some((Token::Mark('('), _)) => {
                let body = self.body(&place)?;
                Ok(Entry::Thing { kind: word, body, place })
            }
            Some((Token::Mark('['), opened)) => {
                let mut list = Vec::new();
                loop {
                    match self.next() {
                        Some((Token::Number(number), _)) => list.push(number),
                        // Colours are lists of words in some files: no numbers are wanted of them.
                        Some((Token::Text(_), _)) => {}
                        Some((Token::Mark(']'), _)) => break,
                        Some((other, place)) => {
                            return Err(place.fault(format!("{} in a list", said(&other)), "lists hold numbers"));
                        }
                        None => return Err(opened.fault("`[` is never closed", "add `]`")),
                    }
                }
                Ok(Entry::Property { word, value: Value::List(list), place })
            }
            Some((Token::Number(number), _)) => Ok(Entry::Property { word, value: Value::Number(number), place }),
            Some((Token::Text(text), _)) => Ok(Entry::Property { word, value: Value::Text(text), place }),
            Some((other @ (Token::Mark(_) | Token::Word(_)), _)) => {
                Err(place.fault(format!("`{word}` has no value but {}", said(&other)), "give it one"))
            }
            None => Err(place.fault(format!("`{word}` has no value"), "give it one")),
        }
    }
}
