//! Finds the place of a key or value in a robot file's text.

use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// The bytes of the value under `keys`, or of the deepest key that exists.
pub fn locate(text: &str, keys: &[&str]) -> Option<Range<usize>> {
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref();
    let mut found = None;
    for key in keys {
        let Some((name, value)) = table.iter().find(|(name, _)| name.get_ref() == key) else { break };
        found = Some(name.span());
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => {
                found = Some(value.span());
                break;
            }
        }
    }
    found
}

/// The value under `keys`, ready for serde with its place in the text.
pub fn value_at<'t>(text: &'t str, keys: &[&str]) -> Option<toml::de::ValueDeserializer<'t>> {
    let mut table = DeTable::parse(text).ok()?.into_inner();
    let (last, path) = keys.split_last()?;
    for key in path {
        let (_, value) = remove(&mut table, key)?;
        match value.into_inner() {
            DeValue::Table(inner) => table = inner,
            _ => return None,
        }
    }
    remove(&mut table, last).map(|(_, value)| toml::de::ValueDeserializer::from(value))
}

type Entry<'t> = (toml::Spanned<std::borrow::Cow<'t, str>>, toml::Spanned<DeValue<'t>>);

fn remove<'t>(table: &mut DeTable<'t>, key: &str) -> Option<Entry<'t>> {
    let name = table.keys().find(|name| name.get_ref() == key)?.clone();
    table.remove_entry(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_values_in_tables_written_in_any_form() {
        let text = "[nodes.base]\ntype = \"p2os\"\nconfig = { device = \"x\" }\nreads.command = \"/a/b/c\"\n";
        let at = |keys: &[&str]| locate(text, keys).map(|span| &text[span]);
        assert_eq!(at(&["nodes", "base", "type"]), Some("\"p2os\""));
        assert_eq!(at(&["nodes", "base", "config", "device"]), Some("\"x\""));
        assert_eq!(at(&["nodes", "base", "reads", "command"]), Some("\"/a/b/c\""));
        assert_eq!(at(&["nodes", "base", "missing"]), Some("base"));
    }
}
