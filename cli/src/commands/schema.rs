//! `sinew schema`: the robot file's JSON Schema, and the layouts of messages.

use crate::exit::Failure;
use crate::output::Out;
use messages::Message;
use runtime::NodeType;
use serde_json::{Map, Value, json};

/// Prints the robot file's JSON Schema, for editors
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Prints the layouts of all messages instead: fields, offsets, units, hashes
    #[arg(long)]
    messages: bool,
}

/// Prints the schema.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let schema = match args.messages {
        true => messages_schema(),
        false => runtime::robot::json_schema(types),
    };
    let mut out = Out::stdout();
    out.line(serde_json::to_string_pretty(&schema)?)?;
    out.flush()
}

fn messages_schema() -> Value {
    let mut all = Map::new();
    let mut add = |schema: messages::Schema| {
        let layout = serde_json::from_str(&schema.to_text()).unwrap_or(Value::Null);
        let hash = format!("{:016x}", schema.hash());
        all.insert(schema.name.clone(), json!({"layout_hash": hash, "layout": layout}));
    };
    add(messages::Ranges::schema());
    add(messages::Odometry::schema());
    add(messages::BaseState::schema());
    add(messages::Twist::schema());
    add(messages::Proposal::schema());
    add(messages::FreeSectors::schema());
    add(messages::CoordinatorState::schema());
    add(messages::MotionState::schema());
    add(messages::Command::schema());
    add(messages::Image::schema());
    add(messages::Truth::schema());
    add(messages::NodeStatistics::schema());
    add(messages::StepInputs::schema());
    add(messages::StepEvents::schema());
    add(messages::Switch::schema());
    add(messages::Trigger::schema());
    add(messages::Sound::schema());
    add(messages::Done::schema());
    Value::Object(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_carry_their_hash_and_their_fields() {
        let all = messages_schema();
        assert_eq!(all["Twist"]["layout_hash"], format!("{:016x}", messages::Twist::layout_hash()));
        assert_eq!(all["Twist"]["layout"]["fields"][0]["name"], "linear_x_m_s");
    }
}
