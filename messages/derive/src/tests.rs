//! What the derive itself refuses, word by word; the compiler's part is in the documentation's `compile_fail` cases.

use crate::expand;

fn expanded(input: &str) -> String {
    expand(input.parse().unwrap()).to_string()
}

fn refused(input: &str, why: &str) {
    let output = expanded(input);
    assert!(output.starts_with(":: core :: compile_error !"), "was accepted: {output}");
    // The message is a string literal within the output, so its quotation marks are escaped there.
    assert!(output.replace('\\', "").contains(why), "expected {why:?} in {output}");
}

#[test]
fn a_struct_without_repr_c_is_refused() {
    refused("struct Speed { forward_m_s: f64 }", "a message needs `#[repr(C)]`");
    refused("#[repr(transparent)] struct Speed { forward_m_s: f64 }", "a message is `repr(C)`");
    refused("#[repr(C, packed)] struct Speed { forward_m_s: f64 }", "a message is `repr(C)`");
}

#[test]
fn an_enum_a_union_and_a_tuple_struct_are_refused_with_what_to_do() {
    refused("#[repr(u32)] enum Motor { Off }", "`#[message(values = \"first second\")]`");
    refused("#[repr(C)] union Motor { a: u8, b: i8 }", "nothing says which field is valid");
    refused("#[repr(C)] struct Speed(f64);", "fields need names");
}

#[test]
fn type_parameters_are_refused() {
    refused("#[repr(C)] struct Pair<T> { first: T }", "cannot be generic");
    refused("#[repr(C)] struct Borrowed<'a> { first: &'a u8 }", "cannot be generic");
    refused("#[repr(C)] struct Many<const N: usize> { first: [u8; N] }", "cannot be generic");
}

#[test]
fn unknown_options_are_refused_with_the_known_ones() {
    refused("#[repr(C)] #[message(tale = u8)] struct Image { rows: u32 }", "known here: `tail = Type`");
    refused("#[repr(C)] struct Image { #[message(units = \"m\")] rows: u32 }", "known here: `unit = \"m/s\"`");
}

#[test]
fn names_of_values_are_checked() {
    let motor = |ty, values| format!("#[repr(C)] struct Motor {{ #[message(values = \"{values}\")] state: {ty} }}");
    refused(&motor("f32", "off on"), "only u8, u16, u32 and u64 fields");
    refused(&motor("i32", "off on"), "only u8, u16, u32 and u64 fields");
    refused(&motor("u32", ""), "give 1 to 4096 names");
    refused(&motor("u32", "off on off"), "`off` is there twice");
    refused(&motor("[u32; 2]", "off, on"), "`off,` is no name of a value");
}

#[test]
fn a_unit_that_cannot_be_printed_on_one_line_is_refused() {
    refused("#[repr(C)] struct Speed { #[message(unit = \"\")] a: f64 }", "a unit is 1 to 128 bytes");
    refused("#[repr(C)] struct Speed { #[message(unit = \"m\\ns\")] a: f64 }", "a unit is 1 to 128 bytes");
}

#[test]
fn a_name_that_other_languages_cannot_read_is_refused() {
    refused("#[repr(C)] struct Pose { höhe_m: f64 }", "names in messages are ASCII");
}

#[test]
fn a_field_named_tail_is_refused_only_beside_a_tail() {
    refused("#[repr(C)] #[message(tail = u8)] struct Plane { tail: f64 }", "the name `tail` is taken");
    assert!(!expanded("#[repr(C)] struct Plane { tail: f64 }").contains("compile_error"));
}
