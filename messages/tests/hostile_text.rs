//! Schema texts from anybody: refused with a reason, or harmless.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod shipped;

use messages::{Message, Schema};
use proptest::prelude::*;
use proptest::sample::Index;
use shipped::every_message;

fn text<M: Message>() -> String {
    M::schema().to_text()
}

/// Whatever is accepted can be written, hashed and used on any bytes.
fn use_it(schema: &Schema) {
    assert_eq!(Schema::from_text(&schema.to_text()).as_ref(), Ok(schema));
    schema.hash();
    if schema.size < 4096 {
        let shown = schema.to_json(&vec![0xff; schema.size], &[0x01; 100]);
        schema.from_json(&shown).unwrap();
        schema.to_json(&[], &[]);
    }
}

proptest! {
    #[test]
    fn garbage_never_panics(text in ".*") {
        let _ = Schema::from_text(&text);
    }

    #[test]
    fn broken_schemas_never_panic(which: Index, cut: Index, length in 0usize..4, insert in "[\\[\\]{}\":,0-9a-z]{0,3}") {
        let texts = every_message!(text);
        let mut text: Vec<char> = which.get(&texts).chars().collect();
        let from = cut.index(text.len());
        text.splice(from..text.len().min(from + length), insert.chars());
        if let Ok(schema) = Schema::from_text(&text.into_iter().collect::<String>()) {
            use_it(&schema);
        }
    }

    #[test]
    fn swapped_numbers_never_panic(which: Index, at: Index, number: u64) {
        let texts = every_message!(text);
        let text = which.get(&texts);
        let digits: Vec<usize> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(place, _)| place).collect();
        let place = *at.get(&digits);
        let text = format!("{}{number}{}", &text[..place], &text[place + 1..]);
        if let Ok(schema) = Schema::from_text(&text) {
            use_it(&schema);
        }
    }
}

fn refused(text: &str, place: &str, why: &str) {
    let error = Schema::from_text(text).unwrap_err().to_string();
    let expected = format!("the schema text is wrong at `{place}`: {why}");
    assert!(error.starts_with(&expected), "expected {expected:?}, not {error:?}");
}

/// A message of 8 bytes with one field, given as JSON without its braces.
fn with_field(field: &str) -> String {
    format!(r#"{{"name":"Probe","size":8,"fields":[{{"name":"a",{field}}}]}}"#)
}

#[test]
fn a_text_that_is_no_json_says_where() {
    let error = Schema::from_text("{\"name\":\n oops").unwrap_err().to_string();
    assert!(error.starts_with("the schema text is not JSON (line 2, column 2: "), "{error}");
    assert!(Schema::from_text(&" ".repeat(1 << 20)).unwrap_err().to_string().contains("has 1048576 bytes"));
}

#[test]
fn what_is_missing_or_of_the_wrong_type_is_named() {
    refused("[]", "the whole", "there is no \"name\"");
    refused(r#"{"name":"P","size":8}"#, "the whole", "there is no \"fields\"");
    refused(r#"{"name":"P","size":-1,"fields":[]}"#, "size", "must be an integer from 0 to 1073741824");
    refused(r#"{"name":"P","size":8,"fields":7}"#, "fields", "must be an array");
    refused(&with_field(r#""offset":0"#), "fields[0]", "there is no \"type\"");
    refused(&with_field(r#""offset":0,"type":"f16""#), "fields[0].type", "must be one of u8 u16");
    refused(&with_field(r#""offset":0,"type":8"#), "fields[0].type", "must be the name of a number's type");
}

#[test]
fn fields_lie_within_the_struct_and_leave_no_gap() {
    refused(&with_field(r#""offset":0,"type":"f32""#), "the whole", "the fields end at 4, but the size is 8");
    refused(&with_field(r#""offset":4,"type":"f32""#), "fields[0]", "offset is 4, but the fields before it end at 0");
    refused(&with_field(r#""offset":0,"type":"f64","count":2"#), "fields[0]", "ends at 16, beyond the struct's size 8");
    refused(&with_field(r#""offset":0,"type":"f64","count":0"#), "fields[0]", "takes 0 bytes");
    refused(&with_field(r#""offset":0,"type":"f64","count":1073741824"#), "fields[0]", "takes 8589934592 bytes");
    let empty = r#""offset":0,"type":{"name":"E","size":0,"fields":[]},"count":1000000"#;
    refused(&with_field(empty), "fields[0]", "takes 0 bytes");
}

#[test]
fn names_can_be_printed_on_a_terminal() {
    refused(r#"{"name":"\u001b[2J","size":0,"fields":[]}"#, "name", "must be a name of 1 to 128");
    refused(r#"{"name":"","size":0,"fields":[]}"#, "name", "must be a name of 1 to 128");
    refused(&with_field(r#""offset":0,"type":"f64","unit":"\u0007""#), "fields[0].unit", "must be one line");
    refused(&with_field(r#""offset":0,"type":"f64","doc":"a\nb""#), "fields[0].doc", "must be one line");
    refused(&with_field(r#""offset":0,"type":"u64","values":["a b"]"#), "fields[0].values[0]", "must be a name");
}

#[test]
fn names_are_unique_and_values_belong_to_unsigned_numbers() {
    let twice =
        r#"{"name":"P","size":2,"fields":[{"name":"a","offset":0,"type":"u8"},{"name":"a","offset":1,"type":"u8"}]}"#;
    refused(twice, "fields[1]", "a second field has the name \"a\"");
    refused(
        &with_field(r#""offset":0,"type":"u64","values":["a","a"]"#),
        "fields[0].values[1]",
        "\"a\" is there twice",
    );
    refused(
        &with_field(r#""offset":0,"type":"f64","values":["a"]"#),
        "fields[0].values",
        "a f64 cannot have named values",
    );
}

#[test]
fn only_the_outermost_struct_has_a_tail() {
    let inner = r#""offset":0,"type":{"name":"I","size":8,"fields":[{"name":"b","offset":0,"type":"f64"}],"tail":{"type":"u8"}}"#;
    refused(&with_field(inner), "fields[0].type.tail", "only the outermost struct may have a tail");
    let field = r#"{"name":"P","size":1,"fields":[{"name":"tail","offset":0,"type":"u8"}],"tail":{"type":"u8"}}"#;
    refused(field, "tail", "there is a field with the name \"tail\" too");
}

#[test]
fn structs_nest_only_so_deep() {
    let nested = |depth: usize| {
        let open = r#"{"name":"P","size":1,"fields":[{"name":"a","offset":0,"type":"#;
        format!("{}\"u8\"{}", open.repeat(depth), "}]}".repeat(depth))
    };
    use_it(&Schema::from_text(&nested(17)).unwrap());
    assert!(Schema::from_text(&nested(18)).unwrap_err().to_string().contains("structs nest deeper than 16"));
    assert!(Schema::from_text(&nested(4000)).unwrap_err().to_string().contains("is not JSON"));
}

#[test]
fn unknown_keys_are_left_to_later_versions() {
    let text = r#"{"name":"P","size":1,"fields":[{"name":"a","offset":0,"type":"u8","frame":"body"}],"version":2}"#;
    use_it(&Schema::from_text(text).unwrap());
}
