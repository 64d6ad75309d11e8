//! Writes a schema as text: the line that stands in every channel file's header and in every recording.

use std::fmt::Write;

use super::{Kind, Schema};

impl Schema {
    /// The schema as one line of JSON, always written the same way, so that equal layouts have equal texts.
    ///
    /// ```text
    /// {"name":"Sonar","size":16,"doc":"…","fields":[FIELD,…],"tail":{"type":TYPE,"count":3}}
    /// FIELD  {"name":"range_m","offset":8,"type":TYPE,"count":2,"unit":"m","values":["none","value"],"doc":"…"}
    /// TYPE   "u8" "u16" "u32" "u64" "i8" "i16" "i32" "i64" "f32" "f64", or the schema of a struct (without a tail)
    /// ```
    ///
    /// - `size` and `offset` are bytes. Fields follow one another without gaps and fill `size`. Numbers are little-endian.
    /// - `count` is there for arrays only (arrays of arrays: all elements, row-major); `tail`, `unit`, `values` and `doc`
    ///   are left out when empty. Readers ignore keys that they do not know.
    /// - The tail begins at `size` rounded up to a multiple of 8 and holds as many elements as the sample's length says.
    /// - `values` names the numbers 0, 1, 2… of an unsigned field that stands for a choice.
    pub fn to_text(&self) -> String {
        write(self, true)
    }
}

/// The text, with or without documentation. Without it is what [`Schema::hash`] hashes: a change here changes all hashes.
pub(super) fn write(schema: &Schema, with_docs: bool) -> String {
    let mut text = String::new();
    push_schema(&mut text, schema, with_docs);
    text
}

fn push_schema(out: &mut String, schema: &Schema, with_docs: bool) {
    out.push_str("{\"name\":");
    push_string(out, &schema.name);
    push_number(out, ",\"size\":", schema.size);
    push_doc(out, &schema.doc, with_docs);
    out.push_str(",\"fields\":[");
    for (index, field) in schema.fields.iter().enumerate() {
        out.push_str(if index == 0 { "{\"name\":" } else { ",{\"name\":" });
        push_string(out, &field.name);
        push_number(out, ",\"offset\":", field.offset);
        push_type(out, ",\"type\":", &field.kind, field.count, with_docs);
        if let Some(unit) = &field.unit {
            out.push_str(",\"unit\":");
            push_string(out, unit);
        }
        if !field.values.is_empty() {
            out.push_str(",\"values\":[");
            for (index, value) in field.values.iter().enumerate() {
                if index > 0 {
                    out.push(',');
                }
                push_string(out, value);
            }
            out.push(']');
        }
        push_doc(out, &field.doc, with_docs);
        out.push('}');
    }
    out.push(']');
    if let Some(tail) = &schema.tail {
        push_type(out, ",\"tail\":{\"type\":", &tail.kind, tail.count, with_docs);
        out.push('}');
    }
    out.push('}');
}

fn push_type(out: &mut String, key: &str, kind: &Kind, count: Option<usize>, with_docs: bool) {
    out.push_str(key);
    match kind {
        Kind::Struct(schema) => push_schema(out, schema, with_docs),
        number => push_string(out, number.name()),
    }
    if let Some(count) = count {
        push_number(out, ",\"count\":", count);
    }
}

fn push_doc(out: &mut String, doc: &str, with_docs: bool) {
    if with_docs && !doc.is_empty() {
        out.push_str(",\"doc\":");
        push_string(out, doc);
    }
}

fn push_number(out: &mut String, key: &str, number: usize) {
    write!(out, "{key}{number}").expect("writing to a String does not fail");
}

/// A JSON string. Written here, so that no library's choice of escapes can change a layout's hash.
fn push_string(out: &mut String, string: &str) {
    out.push('"');
    for character in string.chars() {
        match character {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            control if u32::from(control) < 0x20 => {
                write!(out, "\\u{:04x}", u32::from(control)).expect("writing to a String does not fail");
            }
            plain => out.push(plain),
        }
    }
    out.push('"');
}
