//! A request message from words of the command line.

use crate::exit::{Failure, USAGE};
use messages::{Field, Kind, Schema};
use serde_json::{Map, Value, json};

/// The bytes of the message that `words` say.
pub fn body(schema: &Schema, words: &[String], node: &str, command: &str) -> Result<Vec<u8>, Failure> {
    let usage = |reason: String| {
        let example = example(schema);
        Failure::new(USAGE, format!("{reason}\nWrite for example: sinew call {node} {command} {example}"))
    };
    let value = value(schema, words).map_err(usage)?;
    let (fixed, _) = schema.from_json(&value).map_err(|e| usage(e.to_string()))?;
    Ok(fixed)
}

/// Whether a field is there only because a message has at least one.
pub fn is_filler(field: &Field) -> bool {
    ["_", "unused", "reserved"].iter().any(|start| field.name.starts_with(start))
}

fn value(schema: &Schema, words: &[String]) -> Result<Value, String> {
    let asked: Vec<&Field> = schema.fields.iter().filter(|field| !is_filler(field)).collect();
    let mut value = match words {
        [] if asked.is_empty() => json!({}),
        [] => return Err(format!("the message {} has {} to be given", schema.name, count(asked.len()))),
        [word] if word.trim_start().starts_with('{') => {
            serde_json::from_str(word).map_err(|e| format!("the message is no JSON: {e}"))?
        }
        words if words.iter().all(|word| word.contains('=')) => {
            let mut object = Map::new();
            for word in words {
                let (name, text) = word.split_once('=').unwrap_or((word, ""));
                put(&mut object, name, scalar(text));
            }
            Value::Object(object)
        }
        [word] if asked.len() == 1 => json!({ asked[0].name.as_str(): switched(asked[0], scalar(word)) }),
        _ => return Err("write the message as one JSON object, or FIELD=VALUE for each field".into()),
    };
    if let Some(object) = value.as_object_mut() {
        for field in schema.fields.iter().filter(|field| is_filler(field)) {
            object.entry(field.name.as_str()).or_insert_with(|| zero(field));
        }
    }
    Ok(in_numbers(value))
}

fn count(fields: usize) -> String {
    if fields == 1 { "one field".into() } else { format!("{fields} fields") }
}

/// Sets `a.b` to `value`.
fn put(object: &mut Map<String, Value>, name: &str, value: Value) {
    match name.split_once('.') {
        None => {
            object.insert(name.to_owned(), value);
        }
        Some((outer, inner)) => {
            let entry = object.entry(outer).or_insert_with(|| json!({}));
            if let Some(object) = entry.as_object_mut() {
                put(object, inner, value);
            }
        }
    }
}

/// A number, a truth value, an array; else a word.
fn scalar(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::from(text))
}

/// "on" and "off" for a field that takes a number.
fn switched(field: &Field, value: Value) -> Value {
    match value.as_str() {
        Some("on" | "yes") if field.values.is_empty() => Value::from(1),
        Some("off" | "no") if field.values.is_empty() => Value::from(0),
        _ => value,
    }
}

/// Messages know no truth values: 1 and 0 stand for them.
fn in_numbers(value: Value) -> Value {
    match value {
        Value::Bool(flag) => Value::from(u8::from(flag)),
        Value::Array(items) => items.into_iter().map(in_numbers).collect(),
        Value::Object(object) => object.into_iter().map(|(key, value)| (key, in_numbers(value))).collect(),
        other => other,
    }
}

fn zero(field: &Field) -> Value {
    let one = match (&field.kind, field.values.first()) {
        (_, Some(name)) => Value::from(name.as_str()),
        (Kind::F32 | Kind::F64, _) => json!(0.0),
        (Kind::Struct(inner), _) => inner.fields.iter().map(|field| (field.name.clone(), zero(field))).collect(),
        _ => json!(0),
    };
    match field.count {
        Some(count) => Value::Array(vec![one; count]),
        None => one,
    }
}

/// A message of this layout as one would type it.
fn example(schema: &Schema) -> String {
    let asked: Vec<&Field> = schema.fields.iter().filter(|field| !is_filler(field)).collect();
    let all: Value = asked.iter().map(|field| (field.name.clone(), zero(field))).collect();
    match asked.len() {
        0 => String::new(),
        _ => format!("'{all}'"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Message, Odometry, Switch, Trigger, Twist};

    fn said(words: &[&str]) -> Result<Twist, String> {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        let bytes = body(&Twist::schema(), &words, "/a/b", "go").map_err(|failure| failure.message)?;
        Ok(messages::bytemuck::pod_read_unaligned(&bytes))
    }

    #[test]
    fn json_and_assignments_say_the_same() {
        let wanted = Twist { linear_x_m_s: 0.5, linear_y_m_s: 0.0, angular_z_rad_s: -1.0 };
        assert_eq!(said(&[r#"{"linear_x_m_s":0.5,"linear_y_m_s":0,"angular_z_rad_s":-1}"#]), Ok(wanted));
        assert_eq!(said(&["linear_x_m_s=0.5", "linear_y_m_s=0", "angular_z_rad_s=-1"]), Ok(wanted));
    }

    #[test]
    fn a_missing_message_shows_how_to_write_it() {
        let reason = said(&[]).unwrap_err();
        assert!(reason.contains("3 fields"), "{reason}");
        assert!(reason.contains(r#"sinew call /a/b go '{"linear_x_m_s":0.0,"#), "{reason}");
    }

    #[test]
    fn a_wrong_message_says_where() {
        assert!(said(&["{\"linear_x\": 1}"]).unwrap_err().contains("linear_x"), "{:?}", said(&["{\"linear_x\": 1}"]));
        assert!(said(&["{nonsense"]).unwrap_err().contains("no JSON"));
        assert!(said(&["1", "2"]).unwrap_err().contains("FIELD=VALUE"));
    }

    #[test]
    fn dots_reach_into_structs_and_truth_values_are_numbers() {
        let mut object = Map::new();
        put(&mut object, "velocity.linear_x_m_s", scalar("0.5"));
        put(&mut object, "velocity.linear_y_m_s", scalar("true"));
        assert_eq!(in_numbers(Value::Object(object)), json!({"velocity": {"linear_x_m_s": 0.5, "linear_y_m_s": 1}}));
        assert_eq!(in_numbers(json!([true, false])), json!([1, 0]));
    }

    #[test]
    fn a_single_field_takes_the_bare_value_and_a_filler_none() {
        let bytes = |schema: &Schema, words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            body(schema, &words, "/a/b", "go").map_err(|failure| failure.message)
        };
        assert_eq!(bytes(&Switch::schema(), &["on"]), Ok(vec![1, 0, 0, 0, 0, 0, 0, 0]));
        assert_eq!(bytes(&Switch::schema(), &["0"]), Ok(vec![0; 8]));
        assert_eq!(bytes(&Trigger::schema(), &[]), Ok(vec![0; 8]));
        assert!(bytes(&Switch::schema(), &[]).unwrap_err().contains("one field"));
    }

    #[test]
    fn an_example_has_every_field() {
        let text = example(&Odometry::schema());
        assert!(text.contains("\"velocity\":{\"linear_x_m_s\":0.0"), "{text}");
        assert!(text.contains("\"pose_covariance\":[0.0,"), "{text}");
    }
}
