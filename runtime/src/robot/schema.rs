//! The robot file's JSON Schema, for editors.

use super::file::RobotFile;
use crate::node::NodeType;
use schemars::SchemaGenerator;
use serde_json::{Value, json};

/// JSON Schema of a robot file that may use `types`.
pub fn json_schema(types: &[NodeType]) -> Value {
    let mut generator = SchemaGenerator::default();
    let mut root = generator.root_schema_for::<RobotFile>().to_value();
    let mut cases = Vec::new();
    let mut definitions = serde_json::Map::new();
    for kind in types {
        let config = (kind.config_schema)(&mut generator).to_value();
        let name = format!("config_{}", kind.name);
        definitions.insert(name.clone(), config);
        cases.push(json!({
            "if": { "properties": { "type": { "const": kind.name } } },
            "then": { "properties": { "config": { "$ref": format!("#/$defs/{name}") } } },
        }));
    }
    let names: Vec<&str> = types.iter().map(|kind| kind.name).collect();
    let used = generator.take_definitions(true);
    if let Some(defs) = root.get_mut("$defs").and_then(Value::as_object_mut) {
        defs.extend(used);
        defs.extend(definitions);
        if let Some(node) = defs.get_mut("NodeTable") {
            node["properties"]["type"]["enum"] = json!(names);
            node["allOf"] = Value::Array(cases);
        }
    }
    root["title"] = json!("Sinew robot file");
    root
}
