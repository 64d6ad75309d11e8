//! Reads a schema's text. The text may come from anybody: every claim is checked before it is believed.

use std::collections::HashSet;

use serde_json::Value;

use super::{Element, Field, Kind, Schema};

/// Longest schema text that is read [byte].
const MAX_TEXT_BYTES: usize = 256 << 10;
/// Largest fixed part and tail element [byte].
const MAX_SIZE_BYTES: usize = 1 << 30;
/// Structs within structs.
const MAX_DEPTH: usize = 16;
/// Longest name, unit or value name [byte].
const MAX_WORD_BYTES: usize = 128;

/// Why a text is not a schema.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The text is longer than any schema.
    #[error("the schema text has {bytes} bytes; no schema has more than {MAX_TEXT_BYTES}: this is something else")]
    TooLong {
        /// Length of the text.
        bytes: usize,
    },
    /// The text is not JSON.
    #[error("the schema text is not JSON (line {line}, column {column}: {why}); write it with Schema::to_text")]
    NotJson {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the JSON parser said.
        why: String,
    },
    /// The text is JSON, but not a schema.
    #[error("the schema text is wrong at `{place}`: {why}")]
    Malformed {
        /// Where, for example `fields[2].type`.
        place: String,
        /// What is wrong there, and what should be.
        why: String,
    },
}

impl Schema {
    /// Reads what [`to_text`](Schema::to_text) writes.
    ///
    /// Safe for hostile text: bounded in length, depth and sizes; names are ASCII identifiers, so that they can be printed
    /// on a terminal; fields must follow one another without gaps and fill the struct.
    pub fn from_text(text: &str) -> Result<Schema, SchemaError> {
        if text.len() > MAX_TEXT_BYTES {
            return Err(SchemaError::TooLong { bytes: text.len() });
        }
        let value: Value = serde_json::from_str(text).map_err(|error| SchemaError::NotJson {
            line: error.line(),
            column: error.column(),
            why: error.to_string(),
        })?;
        read_schema(&Place::root(&value), 0)
    }
}

/// A JSON value and where it stands in the text.
struct Place<'a> {
    value: &'a Value,
    path: String,
}

impl<'a> Place<'a> {
    fn root(value: &'a Value) -> Place<'a> {
        Place { value, path: String::new() }
    }

    /// The value under `key`, if any.
    fn get(&self, key: &str) -> Option<Place<'a>> {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        self.value.get(key).map(|value| Place { value, path })
    }

    fn need(&self, key: &str) -> Result<Place<'a>, SchemaError> {
        self.get(key).ok_or_else(|| self.wrong(format!("there is no \"{key}\"")))
    }

    fn items(&self) -> Result<Vec<Place<'a>>, SchemaError> {
        let array = self.value.as_array().ok_or_else(|| self.wrong("must be an array"))?;
        Ok(array
            .iter()
            .enumerate()
            .map(|(index, value)| Place { value, path: format!("{}[{index}]", self.path) })
            .collect())
    }

    /// A number of bytes or elements.
    fn number(&self) -> Result<usize, SchemaError> {
        let number = self.value.as_u64().and_then(|number| usize::try_from(number).ok());
        number
            .filter(|&number| number <= MAX_SIZE_BYTES)
            .ok_or_else(|| self.wrong(format!("must be an integer from 0 to {MAX_SIZE_BYTES}")))
    }

    /// A name that is an ASCII identifier.
    fn name(&self) -> Result<String, SchemaError> {
        let name = self.value.as_str().unwrap_or_default();
        let letters = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        if name.is_empty() || name.len() > MAX_WORD_BYTES || !letters {
            return Err(self.wrong(format!("must be a name of 1 to {MAX_WORD_BYTES} of the characters a-z A-Z 0-9 _")));
        }
        Ok(name.to_owned())
    }

    /// Any text that can be printed on one line.
    fn line(&self) -> Result<String, SchemaError> {
        let line = self.value.as_str().ok_or_else(|| self.wrong("must be a string"))?;
        if line.chars().any(char::is_control) {
            return Err(self.wrong("must be one line without control characters"));
        }
        Ok(line.to_owned())
    }

    fn wrong(&self, why: impl Into<String>) -> SchemaError {
        let place = if self.path.is_empty() { "the whole".to_owned() } else { self.path.clone() };
        SchemaError::Malformed { place, why: why.into() }
    }
}

fn read_schema(place: &Place, depth: usize) -> Result<Schema, SchemaError> {
    if depth > MAX_DEPTH {
        return Err(place.wrong(format!("structs nest deeper than {MAX_DEPTH}")));
    }
    let mut schema = Schema {
        name: place.need("name")?.name()?,
        size: place.need("size")?.number()?,
        fields: Vec::new(),
        tail: None,
        doc: place.get("doc").map_or(Ok(String::new()), |doc| doc.line())?,
    };
    let mut names = HashSet::new();
    let mut end = 0;
    for item in place.need("fields")?.items()? {
        let field = read_field(&item, depth)?;
        if field.offset != end {
            return Err(item.wrong(format!("offset is {}, but the fields before it end at {end}", field.offset)));
        }
        // Both are at most MAX_SIZE_BYTES: no overflow.
        end += field.size();
        if end > schema.size {
            return Err(item.wrong(format!("ends at {end}, beyond the struct's size {}", schema.size)));
        }
        if !names.insert(field.name.clone()) {
            return Err(item.wrong(format!("a second field has the name \"{}\"", field.name)));
        }
        schema.fields.push(field);
    }
    if end != schema.size {
        return Err(place.wrong(format!("the fields end at {end}, but the size is {}", schema.size)));
    }
    if let Some(tail) = place.get("tail") {
        if depth > 0 {
            return Err(tail.wrong("only the outermost struct may have a tail"));
        }
        if names.contains("tail") {
            return Err(tail.wrong("there is a field with the name \"tail\" too"));
        }
        let (kind, count) = read_type(&tail, depth)?;
        schema.tail = Some(Element { kind, count });
    }
    Ok(schema)
}

fn read_field(place: &Place, depth: usize) -> Result<Field, SchemaError> {
    let (kind, count) = read_type(place, depth)?;
    let mut values = Vec::new();
    if let Some(list) = place.get("values") {
        let mut names = HashSet::new();
        for item in list.items()? {
            let value = item.name()?;
            if !names.insert(value.clone()) {
                return Err(item.wrong(format!("\"{value}\" is there twice")));
            }
            values.push(value);
        }
        if !kind.is_unsigned() {
            return Err(
                list.wrong(format!("a {} cannot have named values: only u8, u16, u32 and u64 can", kind.name()))
            );
        }
        if kind == Kind::U8 && values.len() > 256 {
            return Err(list.wrong("a u8 cannot have more than 256 values"));
        }
    }
    let unit = place.get("unit").map(|unit| unit.line().map(|line| (unit, line))).transpose()?;
    if let Some((unit, line)) = &unit
        && (line.is_empty() || line.len() > MAX_WORD_BYTES)
    {
        return Err(unit.wrong(format!("must have 1 to {MAX_WORD_BYTES} bytes")));
    }
    Ok(Field {
        name: place.need("name")?.name()?,
        offset: place.need("offset")?.number()?,
        kind,
        count,
        unit: unit.map(|(_, line)| line),
        values,
        doc: place.get("doc").map_or(Ok(String::new()), |doc| doc.line())?,
    })
}

/// The `type` and `count` of a field or a tail; never empty, never larger than `MAX_SIZE_BYTES`.
fn read_type(place: &Place, depth: usize) -> Result<(Kind, Option<usize>), SchemaError> {
    let kind_place = place.need("type")?;
    let kind = match kind_place.value {
        Value::Object(_) => Kind::Struct(Box::new(read_schema(&kind_place, depth + 1)?)),
        Value::String(name) => Kind::NUMBERS
            .into_iter()
            .find_map(|(known, kind)| (known == name).then_some(kind))
            .ok_or_else(|| kind_place.wrong("must be one of u8 u16 u32 u64 i8 i16 i32 i64 f32 f64, or a struct"))?,
        _ => return Err(kind_place.wrong("must be the name of a number's type, or a struct")),
    };
    let count = place.get("count").map(|count| count.number()).transpose()?;
    let bytes = kind.size().saturating_mul(count.unwrap_or(1));
    if bytes == 0 || bytes > MAX_SIZE_BYTES {
        return Err(place.wrong(format!("takes {bytes} bytes; 1 to {MAX_SIZE_BYTES} are possible")));
    }
    Ok((kind, count))
}
