//! Bytes to JSON and back, by the schema alone: any tool can show and make messages whose type it was not built with.
//!
//! - A struct is an object of its fields; an array is an array; the tail is an array under the key `tail`.
//! - Integers are exact. A float prints as the shortest decimal that reads back as the same bits; what JSON has no number
//!   for is a string: `"nan"` (every NaN becomes the canonical one), `"inf"`, `"-inf"`.
//! - A field with named values prints the name, or the number where it has none; both are read.

use serde_json::{Map, Number, Value};

use super::json_error::{describe, expectation, nearest};
use super::{Field, JsonError, JsonProblem, Kind, Schema};
use crate::Message;

/// A message and its tail as JSON; see [`Schema::to_json`].
pub fn to_json_value<M: Message>(message: &M, tail: &[M::Tail]) -> Value {
    M::schema().to_json(bytemuck::bytes_of(message), bytemuck::cast_slice(tail))
}

/// A message and its tail from JSON; see [`Schema::from_json`].
pub fn from_json_value<M: Message>(value: &Value) -> Result<(M, Vec<M::Tail>), JsonError> {
    let (fixed, tail) = M::schema().from_json(value)?;
    let elements = tail.chunks_exact(size_of::<M::Tail>()).map(bytemuck::pod_read_unaligned).collect();
    Ok((bytemuck::pod_read_unaligned(&fixed), elements))
}

impl Schema {
    /// The message in `fixed` and the elements in `tail` as a JSON object.
    ///
    /// A message cut short prints `null` for what is missing; bytes of an unfinished last element of the tail, and those of
    /// a tail that the message should not have, are not shown.
    pub fn to_json(&self, fixed: &[u8], tail: &[u8]) -> Value {
        let mut object = fields_to_json(self, fixed);
        if let Some(element) = &self.tail {
            let size = element.size().max(1);
            let items = tail.chunks_exact(size).map(|bytes| all_to_json(&element.kind, element.count, &[], bytes));
            object.insert("tail".to_owned(), Value::Array(items.collect()));
        }
        Value::Object(object)
    }

    /// The bytes of the fixed part and of the tail for a JSON object as [`to_json`](Schema::to_json) makes it.
    ///
    /// Every field must be there, and a `tail` if the message has one. Errors name the field, say what is wrong and what
    /// would be right.
    pub fn from_json(&self, value: &Value) -> Result<(Vec<u8>, Vec<u8>), JsonError> {
        let mut fixed = Vec::with_capacity(self.size);
        let mut tail = Vec::new();
        self.push(value, &mut fixed, &mut tail)
            .map_err(|problem| JsonError { message: self.name.clone(), ..problem })?;
        Ok((fixed, tail))
    }

    fn push(&self, value: &Value, fixed: &mut Vec<u8>, tail: &mut Vec<u8>) -> Result<(), JsonError> {
        push_fields(self, value, fixed)?;
        let Some(element) = &self.tail else { return Ok(()) };
        let expected = || format!("an array, each element {}", expectation(&element.kind, element.count, None, &[]));
        let items = match value.get("tail") {
            Some(Value::Array(items)) => items,
            Some(other) => {
                return Err(JsonError::at("tail", JsonProblem::Wrong { found: describe(other), expected: expected() }));
            }
            None => return Err(JsonError::at("tail", JsonProblem::Missing { expected: expected() })),
        };
        let anonymous =
            Field { kind: element.kind.clone(), count: element.count, ..Field::of::<u8>("", 0, None, &[], "") };
        for (index, item) in items.iter().enumerate() {
            push_all(&anonymous, item, tail).map_err(|error| error.within(&format!("[{index}]")).within("tail"))?;
        }
        Ok(())
    }
}

fn fields_to_json(schema: &Schema, bytes: &[u8]) -> Map<String, Value> {
    let field = |field: &Field| {
        let bytes = bytes.get(field.offset..).and_then(|rest| rest.get(..field.size()));
        let value = bytes.map_or(Value::Null, |bytes| all_to_json(&field.kind, field.count, &field.values, bytes));
        (field.name.clone(), value)
    };
    schema.fields.iter().map(field).collect()
}

/// A single value, or the array that `count` makes of it.
fn all_to_json(kind: &Kind, count: Option<usize>, values: &[String], bytes: &[u8]) -> Value {
    match count {
        None => one_to_json(kind, values, bytes),
        Some(_) => bytes.chunks_exact(kind.size().max(1)).map(|bytes| one_to_json(kind, values, bytes)).collect(),
    }
}

fn one_to_json(kind: &Kind, values: &[String], bytes: &[u8]) -> Value {
    match kind {
        Kind::Struct(schema) => Value::Object(fields_to_json(schema, bytes)),
        Kind::I8 => Value::from(i8::from_le_bytes(fit(bytes))),
        Kind::I16 => Value::from(i16::from_le_bytes(fit(bytes))),
        Kind::I32 => Value::from(i32::from_le_bytes(fit(bytes))),
        Kind::I64 => Value::from(i64::from_le_bytes(fit(bytes))),
        Kind::F32 => f32_to_json(f32::from_le_bytes(fit(bytes))),
        Kind::F64 => f64_to_json(f64::from_le_bytes(fit(bytes))),
        Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 => {
            let number = u64::from_le_bytes(fit(bytes));
            let name = usize::try_from(number).ok().and_then(|index| values.get(index));
            name.map_or(Value::from(number), |name| Value::from(name.as_str()))
        }
    }
}

/// The first N bytes; zeros where there are none.
fn fit<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut fitted = [0; N];
    fitted.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
    fitted
}

fn f64_to_json(number: f64) -> Value {
    match Number::from_f64(number) {
        Some(finite) => Value::Number(finite),
        None if number.is_nan() => Value::from("nan"),
        None if number > 0.0 => Value::from("inf"),
        None => Value::from("-inf"),
    }
}

/// As `0.1`, not as the `0.10000000149011612` that the nearest f32 is as an f64.
fn f32_to_json(number: f32) -> Value {
    let short: f64 = number.to_string().parse().unwrap_or(f64::NAN);
    // Rounding twice may in principle end at a neighbour: then the long form, which is exact.
    f64_to_json(if (short as f32).to_bits() == number.to_bits() { short } else { f64::from(number) })
}

fn push_fields(schema: &Schema, value: &Value, out: &mut Vec<u8>) -> Result<(), JsonError> {
    let Value::Object(object) = value else {
        let expected = expectation(&Kind::Struct(Box::new(schema.clone())), None, None, &[]);
        return Err(JsonError::at("", JsonProblem::Wrong { found: describe(value), expected }));
    };
    let known = || schema.fields.iter().map(|field| field.name.as_str()).chain(schema.tail.as_ref().map(|_| "tail"));
    if let Some(key) = object.keys().find(|key| known().all(|name| name != *key)) {
        let known: Vec<String> = known().map(str::to_owned).collect();
        return Err(JsonError::at(key, JsonProblem::UnknownKey { nearest: nearest(key, &known), known }));
    }
    for field in &schema.fields {
        let value = object.get(&field.name).ok_or_else(|| {
            let expected = expectation(&field.kind, field.count, field.unit.as_deref(), &field.values);
            JsonError::at(&field.name, JsonProblem::Missing { expected })
        })?;
        push_all(field, value, out).map_err(|error| error.within(&field.name))?;
    }
    Ok(())
}

fn push_all(field: &Field, value: &Value, out: &mut Vec<u8>) -> Result<(), JsonError> {
    let Some(count) = field.count else { return push_one(field, value, out) };
    let wrong = |found| {
        JsonError::at(
            "",
            JsonProblem::Wrong { found, expected: expectation(&field.kind, Some(count), field.unit.as_deref(), &[]) },
        )
    };
    let items = value.as_array().ok_or_else(|| wrong(describe(value)))?;
    if items.len() != count {
        return Err(wrong(format!("an array of {}", items.len())));
    }
    items
        .iter()
        .enumerate()
        .try_for_each(|(index, item)| push_one(field, item, out).map_err(|error| error.within(&format!("[{index}]"))))
}

fn push_one(field: &Field, value: &Value, out: &mut Vec<u8>) -> Result<(), JsonError> {
    let wrong = || {
        let expected = expectation(&field.kind, None, field.unit.as_deref(), &field.values);
        JsonError::at("", JsonProblem::Wrong { found: describe(value), expected })
    };
    match &field.kind {
        Kind::Struct(schema) => return push_fields(schema, value, out),
        Kind::F64 => out.extend(float(value).ok_or_else(wrong)?.to_le_bytes()),
        Kind::F32 => {
            let wide = float(value).ok_or_else(wrong)?;
            let narrow = wide as f32;
            if narrow.is_infinite() && wide.is_finite() {
                return Err(wrong());
            }
            out.extend(narrow.to_le_bytes());
        }
        Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => {
            let number = value.as_i64().filter(|&number| fits_signed(number, field.kind.size())).ok_or_else(wrong)?;
            out.extend(number.to_le_bytes().iter().take(field.kind.size()));
        }
        Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 => {
            let number = match value.as_str() {
                None => value.as_u64(),
                Some(_) if field.values.is_empty() => return Err(wrong()),
                Some(name) => Some(named(name, &field.values)?),
            };
            let number = number.filter(|&number| fits_unsigned(number, field.kind.size())).ok_or_else(wrong)?;
            out.extend(number.to_le_bytes().iter().take(field.kind.size()));
        }
    }
    Ok(())
}

fn named(name: &str, values: &[String]) -> Result<u64, JsonError> {
    let index = values.iter().position(|value| value == name).and_then(|index| u64::try_from(index).ok());
    index.ok_or_else(|| {
        JsonError::at(
            "",
            JsonProblem::UnknownValue {
                found: name.to_owned(),
                nearest: nearest(name, values),
                known: values.to_vec(),
            },
        )
    })
}

fn float(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(word) => match word.as_str() {
            "nan" => Some(f64::NAN),
            "inf" => Some(f64::INFINITY),
            "-inf" => Some(f64::NEG_INFINITY),
            _ => None,
        },
        _ => None,
    }
}

fn fits_unsigned(number: u64, bytes: usize) -> bool {
    bytes >= 8 || number >> (8 * bytes) == 0
}

fn fits_signed(number: i64, bytes: usize) -> bool {
    // All bits above the sign bit must repeat it.
    bytes >= 8 || matches!(number >> (8 * bytes - 1), 0 | -1)
}
