//! A message for people: a line per field with name, value and unit, and its tail as a table.

use super::number::number;
use super::paint::{Paint, Tone};
use super::table::{Align, Cell, Table};
use messages::{Field, Kind, Schema};
use serde_json::Value;

/// Numbers of an array that are shown.
const SHOWN: usize = 16;
/// Elements of a tail that are shown.
const TAIL_SHOWN: usize = 64;

/// One field as text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldLine {
    /// Dotted name.
    pub name: String,
    /// Value, formatted.
    pub value: String,
    /// Unit; empty where there is none.
    pub unit: String,
}

impl FieldLine {
    /// The value, with a place of its own for a number's sign, so that digits stand below digits.
    fn signed(&self) -> String {
        match self.value.starts_with(|c: char| c.is_ascii_digit()) {
            true => format!(" {}", self.value),
            false => self.value.clone(),
        }
    }
}

/// The fields of `message` (as [`Schema::to_json`] makes it), structs taken apart.
pub fn field_lines(schema: &Schema, message: &Value) -> Vec<FieldLine> {
    let mut lines = Vec::new();
    push(&mut lines, "", schema, message);
    lines
}

fn push(lines: &mut Vec<FieldLine>, prefix: &str, schema: &Schema, message: &Value) {
    for field in &schema.fields {
        let name = format!("{prefix}{}", field.name);
        let value = &message[field.name.as_str()];
        match (&field.kind, value) {
            (Kind::Struct(inner), Value::Array(items)) => {
                for (index, item) in items.iter().enumerate() {
                    push(lines, &format!("{name}[{index}]."), inner, item);
                }
            }
            (Kind::Struct(inner), item) => push(lines, &format!("{name}."), inner, item),
            _ => lines.push(FieldLine { name, value: text(value), unit: field.unit.clone().unwrap_or_default() }),
        }
    }
}

/// A number, a name, or several numbers.
fn text(value: &Value) -> String {
    match value {
        Value::Number(n) if n.is_f64() => number(n.as_f64().unwrap_or(f64::NAN)),
        Value::String(word) => word.clone(),
        Value::Array(items) if items.len() > 1 && items.iter().all(|item| item == &items[0]) => {
            format!("{} × {}", items.len(), text(&items[0]))
        }
        Value::Array(items) => {
            let mut all: Vec<String> = items.iter().take(SHOWN).map(text).collect();
            if items.len() > SHOWN {
                all.push(format!("… {} more", items.len() - SHOWN));
            }
            format!("[{}]", all.join("  "))
        }
        other => other.to_string(),
    }
}

/// All of a message: its fields, aligned, then its tail as a table.
pub fn message_lines(schema: &Schema, message: &Value, paint: Paint) -> Vec<String> {
    let fields = field_lines(schema, message);
    let name_width = fields.iter().map(|line| line.name.chars().count()).max().unwrap_or(0);
    let single = fields.iter().map(FieldLine::signed).filter(|value| !value.starts_with('['));
    let value_width = single.map(|value| value.chars().count()).max().unwrap_or(0);
    let mut lines: Vec<String> = fields
        .iter()
        .map(|line| {
            let (name, value) = (format!("{:<name_width$}", line.name), line.signed());
            // Arrays run over: they must not push the units of all others out of sight.
            match line.unit.as_str() {
                "" => format!("  {}  {value}", paint.tone(Tone::Name, name)),
                unit => format!("  {}  {value:<value_width$}  {}", paint.tone(Tone::Name, name), paint.dim(unit)),
            }
        })
        .collect();
    if let Some(element) = &schema.tail {
        let items = message["tail"].as_array().map_or(&[][..], Vec::as_slice);
        match &element.kind {
            Kind::Struct(inner) if element.count.is_none() => lines.extend(tail_table(inner, items, paint)),
            _ => lines.push(format!("  {}  {}", paint.tone(Tone::Name, "tail"), text(&Value::Array(items.to_vec())))),
        }
    }
    lines
}

fn tail_table(schema: &Schema, items: &[Value], paint: Paint) -> Vec<String> {
    let title = |field: &Field| match &field.unit {
        Some(unit) => format!("{} [{unit}]", field.name),
        None => field.name.clone(),
    };
    let titles: Vec<String> = schema.fields.iter().map(title).collect();
    let mut columns = vec![("  tail", Align::Right)];
    columns.extend(titles.iter().map(|title| (title.as_str(), Align::Right)));
    let mut table = Table::new(&columns);
    for (index, item) in items.iter().take(TAIL_SHOWN).enumerate() {
        let mut row = vec![Cell::toned(Tone::Dim, index.to_string())];
        row.extend(schema.fields.iter().map(|field| Cell::from(text(&item[field.name.as_str()]))));
        table.row(row);
    }
    let mut lines = table.lines(paint, None);
    if items.len() > TAIL_SHOWN {
        lines.push(paint.dim(format!("  … {} more; --json shows all", items.len() - TAIL_SHOWN)));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{BaseState, Beam, Message, MotionState, Odometry, Ranges, Twist, to_json_value};

    #[test]
    fn structs_are_taken_apart_and_every_number_has_its_unit() {
        let odometry = Odometry {
            x_m: 1.25,
            velocity: Twist { linear_x_m_s: -0.3, ..Twist::default() },
            pose_covariance: [0.0; 9],
            ..Odometry::default()
        };
        let lines = field_lines(&Odometry::schema(), &to_json_value(&odometry, &[]));
        let line = |name: &str| lines.iter().find(|line| line.name == name).unwrap().clone();
        assert_eq!((line("x_m").value.as_str(), line("x_m").unit.as_str()), ("1.2500", "m"));
        assert_eq!(line("velocity.linear_x_m_s").value, "-0.3000");
        assert_eq!(line("velocity.linear_x_m_s").unit, "m/s");
        assert_eq!(line("pose_covariance").value, "9 × 0");
    }

    #[test]
    fn a_long_array_leaves_the_other_units_where_they_are() {
        let odometry =
            Odometry { pose_covariance: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], ..Odometry::default() };
        let lines = message_lines(&Odometry::schema(), &to_json_value(&odometry, &[]), Paint::OFF);
        assert!(lines[0].starts_with("  x_m ") && lines[0].ends_with("  m"), "{}", lines[0]);
        assert!(lines[0].chars().count() < 50, "{}", lines[0]);
    }

    #[test]
    fn choices_print_their_names() {
        let state = MotionState { stop: 4, ..MotionState::default() };
        let lines = field_lines(&MotionState::schema(), &to_json_value(&state, &[]));
        assert!(lines.iter().any(|line| line.name == "stop" && line.value == "bumper"), "{lines:?}");
    }

    #[test]
    fn digits_stand_below_digits() {
        let twist = Twist { linear_x_m_s: 0.5, linear_y_m_s: -0.5, angular_z_rad_s: 0.0 };
        let lines = message_lines(&Twist::schema(), &to_json_value(&twist, &[]), Paint::OFF);
        assert_eq!(
            lines,
            ["  linear_x_m_s      0.5000  m/s", "  linear_y_m_s     -0.5000  m/s", "  angular_z_rad_s   0       rad/s"]
        );
    }

    #[test]
    fn a_tail_of_structs_is_a_table() {
        let beams = [Beam { range_m: 1.5, echo: 1, ..Beam::default() }, Beam { echo: 2, ..Beam::default() }];
        let lines = message_lines(&Ranges::schema(), &to_json_value(&Ranges::default(), &beams), Paint::OFF);
        let heading = lines.iter().find(|line| line.contains("range_m [m]")).unwrap();
        assert!(heading.contains("bearing_rad [rad]"), "{heading}");
        assert!(lines.last().unwrap().ends_with("clear"), "{lines:?}");
        assert!(lines[lines.len() - 2].contains("1.5000"), "{lines:?}");
    }

    #[test]
    fn not_a_number_is_shown_as_such() {
        let state = BaseState { battery_v: f64::NAN, ..BaseState::default() };
        let lines = message_lines(&BaseState::schema(), &to_json_value(&state, &[]), Paint::OFF);
        assert!(lines[0].contains("nan"), "{}", lines[0]);
    }
}
