//! One field of a message by its name: `velocity.linear_x_m_s`, `pose_covariance[0]`, `tail[3].range_m`; without an
//! index the field of all elements, as in `tail.range_m`.

use runtime::robot::nearest_advice;
use serde_json::Value;

/// The value that `field` names in `message`, or why there is none.
pub fn select(message: &Value, field: &str) -> Result<Value, String> {
    let dotted = field.replace('[', ".").replace(']', "");
    let parts: Vec<&str> = dotted.split('.').filter(|part| !part.is_empty()).collect();
    if parts.is_empty() {
        return Err(format!("\"{field}\" names no field; {}", known("", message)));
    }
    descend(message, &parts, field)
}

fn descend(value: &Value, parts: &[&str], field: &str) -> Result<Value, String> {
    let Some((part, rest)) = parts.split_first() else { return Ok(value.clone()) };
    match value {
        Value::Object(object) => match object.get(*part) {
            Some(inner) => descend(inner, rest, field),
            None => Err(format!("there is no field \"{field}\"; {}", known(part, value))),
        },
        Value::Array(items) => match part.parse::<usize>() {
            Ok(index) => match items.get(index) {
                Some(item) => descend(item, rest, field),
                None => Err(format!("\"{field}\": there are {} elements, counted from 0", items.len())),
            },
            Err(_) => {
                let all: Result<Vec<Value>, String> = items.iter().map(|item| descend(item, parts, field)).collect();
                all.map(Value::Array)
            }
        },
        _ => Err(format!("\"{field}\": there is nothing below a number")),
    }
}

fn known(part: &str, message: &Value) -> String {
    let names: Vec<&str> = message.as_object().map(|o| o.keys().map(String::as_str).collect()).unwrap_or_default();
    match part {
        "" => format!("fields are {}", names.join(", ")),
        part => nearest_advice(part, &names),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn message() -> Value {
        json!({"x_m": 1.5, "velocity": {"linear_x_m_s": 0.3}, "cov": [1, 2, 3], "tail": [{"range_m": 4}, {"range_m": 5}]})
    }

    #[test]
    fn dots_and_indices_lead_to_the_field() {
        let at = |field: &str| select(&message(), field).unwrap();
        assert_eq!(at("x_m"), json!(1.5));
        assert_eq!(at("velocity.linear_x_m_s"), json!(0.3));
        assert_eq!(at("cov[1]"), json!(2));
        assert_eq!(at("tail[1].range_m"), json!(5));
        assert_eq!(at("tail.range_m"), json!([4, 5]));
    }

    #[test]
    fn a_wrong_field_says_what_was_meant() {
        let reason = select(&message(), "velocity.linear_x").unwrap_err();
        assert!(reason.contains("did you mean \"linear_x_m_s\"?"), "{reason}");
        assert!(select(&message(), "cov[9]").unwrap_err().contains("3 elements"));
        assert!(select(&message(), "x_m.y").unwrap_err().contains("nothing below a number"));
        assert!(select(&message(), "").unwrap_err().contains("x_m"));
    }
}
