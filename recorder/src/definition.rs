//! The ROS 2 message definition (`.msg`) of a channel's samples, generated from the channel's own schema.
//!
//! `sinew_msgs/msg/<Type>Stamped` holds the sample's stamp, number and writer, the message, and the tail. The nested
//! types follow after lines of eighty `=`, as MCAP's `ros2msg` wants them. A field's unit stands behind it as a comment,
//! a choice's names stand before it as constants.

use crate::exact::Layout;
use messages::{Element, Field, Kind, Schema};
use runtime::channel::Geometry;
use std::fmt::Write;

/// Package of all generated types.
const PACKAGE: &str = "sinew_msgs";

/// Name of the generated type, for example `sinew_msgs/msg/RangesStamped`.
pub fn topic_type(type_name: &str) -> String {
    format!("{PACKAGE}/msg/{type_name}Stamped")
}

/// Elements that CDR counts per element of the tail.
pub(crate) fn parts_per_element(schema: &Schema) -> usize {
    schema.tail.as_ref().and_then(|tail| tail.count).unwrap_or(1)
}

/// The definition of the samples of a channel with this schema.
pub fn definition(schema: &Schema, geometry: &Geometry) -> String {
    let layout = Layout::new(geometry, parts_per_element(schema));
    let mut nested = Nested::default();
    let mut text = format!("# {}\n", one_line(&schema.doc));
    let _ = writeln!(text, "{PACKAGE}/SampleInfo sample");
    if schema.size > 0 {
        let name = nested.name_of(schema);
        let _ = writeln!(text, "{PACKAGE}/{name} message");
    }
    if let Some(tail) = &schema.tail {
        if layout.has_reserved() {
            let _ = writeln!(text, "uint32 reserved");
        }
        let _ = writeln!(text, "{}[] tail{}", nested.type_of(&tail.kind), rows(tail));
    }
    nested.add("SampleInfo", SAMPLE_INFO.to_owned());
    for (name, body) in nested.types {
        let _ = write!(text, "{}\nMSG: {PACKAGE}/{name}\n{body}", "=".repeat(80));
    }
    text
}

const SAMPLE_INFO: &str = "# What a channel says about each of its samples
uint64 stamp_ns # on the robot's clock [ns]
uint64 sequence # number in the channel, from 1
uint64 generation # counts the writer's restarts
";

fn rows(tail: &Element) -> String {
    tail.count.map_or_else(String::new, |count| format!(" # rows of {count}"))
}

/// Nested types, each once, in the order in which they are needed.
#[derive(Default)]
struct Nested {
    types: Vec<(String, String)>,
}

impl Nested {
    fn add(&mut self, name: &str, body: String) -> String {
        let mut own = name.to_owned();
        // A type of the same name and other fields (a user's Twist beside ours) gets another name.
        while let Some((_, known)) = self.types.iter().find(|(known, _)| *known == own) {
            if *known == body {
                return own;
            }
            own.push('X');
        }
        self.types.push((own.clone(), body));
        own
    }

    fn name_of(&mut self, schema: &Schema) -> String {
        let mut body = format!("# {}\n", one_line(&schema.doc));
        for field in &schema.fields {
            self.push_field(&mut body, field);
        }
        self.add(&schema.name, body)
    }

    fn push_field(&mut self, body: &mut String, field: &Field) {
        let kind = self.type_of(&field.kind);
        for (value, name) in field.values.iter().enumerate() {
            let _ = writeln!(body, "{kind} {}_{}={value}", field.name.to_uppercase(), name.to_uppercase());
        }
        let array = field.count.map_or_else(String::new, |count| format!("[{count}]"));
        let unit = field.unit.as_ref().map_or_else(String::new, |unit| format!(" # [{unit}]"));
        let _ = writeln!(body, "{kind}{array} {}{unit}", field.name);
    }

    fn type_of(&mut self, kind: &Kind) -> String {
        match kind {
            Kind::U8 => "uint8".into(),
            Kind::U16 => "uint16".into(),
            Kind::U32 => "uint32".into(),
            Kind::U64 => "uint64".into(),
            Kind::I8 => "int8".into(),
            Kind::I16 => "int16".into(),
            Kind::I32 => "int32".into(),
            Kind::I64 => "int64".into(),
            Kind::F32 => "float32".into(),
            Kind::F64 => "float64".into(),
            Kind::Struct(schema) => format!("{PACKAGE}/{}", self.name_of(schema)),
        }
    }
}

fn one_line(doc: &str) -> String {
    doc.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Message, Ranges};

    #[test]
    fn ranges_have_their_beams_their_units_and_the_names_of_their_echoes() {
        let schema = Ranges::schema();
        let geometry = Geometry {
            type_name: schema.name.clone(),
            layout_hash: schema.hash(),
            schema: schema.to_text(),
            fixed_bytes: schema.size,
            tail_element_bytes: 24,
            tail_capacity: 16,
            depth: 4,
        };
        let text = definition(&schema, &geometry);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[1..5],
            ["sinew_msgs/SampleInfo sample", "sinew_msgs/Ranges message", "uint32 reserved", "sinew_msgs/Beam[] tail"]
        );
        assert!(text.contains("MSG: sinew_msgs/Beam\n"), "{text}");
        assert!(text.contains("uint32 ECHO_NONE=0\n") && text.contains("float32 range_m # [m]\n"), "{text}");
        assert_eq!(text.matches("MSG: ").count(), 3);
    }
}
