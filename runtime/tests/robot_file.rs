//! What a robot file's reader accepts, and what it says about everything else: where, why, what to do.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{Ranges, Twist};
use runtime::robot::{Override, Resources, Robot, json_schema};
use runtime::{Fault, Layer, Node, NodeType, OpenError, Ports, Reader, Set, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SenseConfig {
    range_m: f64,
}

impl Default for SenseConfig {
    fn default() -> Self {
        SenseConfig { range_m: 3.0 }
    }
}

struct Sense(#[allow(dead_code)] Writer<Ranges>);

impl Node for Sense {
    const TYPE: &'static str = "sense";
    const LAYER: Layer = Layer::Drivers;
    type Config = SenseConfig;

    fn open(ports: &mut Ports, config: SenseConfig) -> Result<Self, OpenError> {
        if config.range_m <= 0.0 {
            return Err(OpenError::config(format!("range_m is {}: it must be above 0", config.range_m)));
        }
        Ok(Sense(ports.writer_with_tail("ranges", 16)?))
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        Ok(())
    }
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct NoConfig {}

struct Act(#[allow(dead_code)] Reader<Ranges>, #[allow(dead_code)] Writer<Twist>);

impl Node for Act {
    const TYPE: &'static str = "act";
    const LAYER: Layer = Layer::Actions;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Act(ports.reader("ranges")?, ports.writer("velocity")?))
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        Ok(())
    }
}

struct Join(#[allow(dead_code)] Set<Twist>);

impl Node for Join {
    const TYPE: &'static str = "join";
    const LAYER: Layer = Layer::Coordinator;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Join(ports.set("velocities")?))
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        Ok(())
    }
}

const TYPES: &[NodeType] = &[NodeType::of::<Sense>(), NodeType::of::<Act>(), NodeType::of::<Join>()];

const GOOD: &str = r#"
[robot]
name = "toy"

[nodes.eye]
type = "sense"
period_ms = 100
depth.ranges = 32
config = { range_m = 2.0 }

[nodes.turn]
type = "act"
trigger = "ranges"
reads.ranges = { from = ["/drivers/eye/ranges"], max_age_ms = 200 }

[nodes.all]
type = "join"
period_ms = 50
reads.velocities = "/actions/*/velocity"
"#;

fn parse(text: &str) -> Result<Robot, Vec<runtime::robot::RobotError>> {
    Robot::parse(text, "toy.toml", Resources::Folder(".".into()), TYPES)
}

/// The errors of a file that differs from the good one in `old` → `new`, as a person sees them.
fn complaint(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "the good file has no {old:?}");
    let errors = match parse(&GOOD.replacen(old, new, 1)) {
        Err(errors) => errors,
        Ok(robot) => robot.graph().expect_err("the file should be refused"),
    };
    errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_good_file_becomes_nodes_in_flow_order_with_typed_wires() {
    let robot = parse(GOOD).unwrap();
    let order: Vec<String> = robot.nodes.iter().map(|node| node.path()).collect();
    assert_eq!(order, ["/drivers/eye", "/actions/turn", "/coordinator/all"]);
    let graph = robot.graph().unwrap();
    let wires: Vec<(usize, usize, &str, bool)> =
        graph.edges.iter().map(|e| (e.from, e.to, e.path.as_str(), e.triggers)).collect();
    assert_eq!(wires, [(0, 1, "/drivers/eye/ranges", true), (1, 2, "/actions/turn/velocity", false)]);
    assert_eq!(graph.nodes[0].writes[0].geometry.depth, 32);
}

#[test]
fn an_unknown_key_is_refused_with_its_place_and_the_nearest_valid_one() {
    let said = complaint("period_ms = 100", "perido_ms = 100");
    assert!(said.contains("toy.toml:7:1: unknown key \"perido_ms\""), "{said}");
    assert!(said.contains("did you mean \"period_ms\"?"), "{said}");
    assert!(said.contains("7 | perido_ms = 100"), "{said}");
}

#[test]
fn an_unknown_setting_of_a_node_is_refused_with_its_place_and_the_nearest_valid_one() {
    let said = complaint("range_m = 2.0", "rnage_m = 2.0");
    assert!(said.contains("toy.toml:9:12: unknown key \"rnage_m\""), "{said}");
    assert!(said.contains("did you mean \"range_m\"?"), "{said}");
}

#[test]
fn a_setting_of_another_kind_is_refused_with_its_place() {
    let said = complaint("range_m = 2.0", "range_m = \"far\"");
    assert!(said.contains("toy.toml:9:22: invalid type: string \"far\", expected f64"), "{said}");
}

#[test]
fn a_setting_out_of_bounds_is_refused_by_the_node_itself() {
    let said = complaint("range_m = 2.0", "range_m = -1");
    assert!(said.contains("toy.toml:9:") && said.contains("range_m is -1: it must be above 0"), "{said}");
}

#[test]
fn an_unknown_node_type_names_the_nearest() {
    let said = complaint("type = \"sense\"", "type = \"sens\"");
    assert!(said.contains("toy.toml:6:8: there is no node type \"sens\""), "{said}");
    assert!(said.contains("did you mean \"sense\"?"), "{said}");
}

#[test]
fn a_path_that_nobody_writes_names_the_nearest() {
    let said = complaint("from = [\"/drivers/eye/ranges\"]", "from = \"/drivers/eyes/ranges\"");
    assert!(said.contains("no node of this robot writes /drivers/eyes/ranges"), "{said}");
    assert!(said.contains("did you mean \"/drivers/eye/ranges\"?"), "{said}");
}

#[test]
fn a_path_of_another_type_names_both_types_and_their_hashes() {
    let said = complaint("from = [\"/drivers/eye/ranges\"]", "from = \"/actions/turn/velocity\"");
    assert!(said.contains("port \"ranges\" reads Ranges (") && said.contains("carries Twist ("), "{said}");
}

#[test]
fn a_path_that_is_none_says_what_a_path_is() {
    let said = complaint("\"/drivers/eye/ranges\"", "\"drivers/eye/ranges\"");
    assert!(said.contains("must begin with '/'"), "{said}");
    let said = complaint("\"/actions/*/velocity\"", "\"/action/*/velocity\"");
    assert!(said.contains("\"action\", which is no layer; layers are"), "{said}");
}

#[test]
fn a_port_that_the_type_does_not_have_is_refused() {
    let said = complaint("reads.ranges = {", "reads.rangs = \"/drivers/eye/ranges\"\nreads.ranges = {");
    assert!(said.contains("node type \"act\" reads no port \"rangs\""), "{said}");
    assert!(said.contains("did you mean \"ranges\"?"), "{said}");
    let said = complaint("depth.ranges", "depth.rangs");
    assert!(said.contains("node type \"sense\" writes no port \"rangs\""), "{said}");
    let said = complaint("trigger = \"ranges\"", "trigger = \"range\"");
    assert!(said.contains("has no read port \"range\" to be triggered by"), "{said}");
}

#[test]
fn a_port_that_is_not_wired_says_how_to_wire_it() {
    let said = complaint("reads.velocities = \"/actions/*/velocity\"", "");
    assert!(said.contains("port \"velocities\": is not wired: add `reads.velocities"), "{said}");
}

#[test]
fn a_node_that_would_never_step_is_refused() {
    let said = complaint("period_ms = 100", "");
    assert!(said.contains("node \"eye\" would never step"), "{said}");
}

#[test]
fn numbers_out_of_range_are_refused_with_the_range() {
    assert!(complaint("period_ms = 100", "period_ms = 0").contains("period_ms is 0: it must lie between 0.05"));
    assert!(complaint("period_ms = 100", "period_ms = nan").contains("period_ms is NaN"));
    assert!(complaint("period_ms = 100", "period_ms = 100\npriority = 99").contains("it must lie between 1 and 89"));
    assert!(complaint("depth.ranges = 32", "depth.ranges = 0").contains("depth is 0"));
    assert!(complaint("name = \"toy\"", "name = \"../etc\"").contains("is no name"));
}

#[test]
fn text_that_is_no_toml_says_where() {
    let said = complaint("[nodes.eye]", "[nodes.eye");
    assert!(said.starts_with("toy.toml:5:"), "{said}");
}

#[test]
fn all_errors_of_a_file_are_reported_at_once() {
    let text = GOOD.replace("type = \"sense\"", "type = \"sens\"").replace("type = \"act\"", "type = \"acct\"");
    assert_eq!(parse(&text).unwrap_err().len(), 2);
}

#[test]
fn an_override_replaces_one_value_and_is_checked_like_the_rest() {
    let robot = parse(GOOD).unwrap();
    let change =
        |key: &str, value: &str| robot.with_overrides(&[Override { key: key.into(), value: value.into() }], TYPES);
    assert_eq!(change("nodes.eye.period_ms", "20").unwrap().nodes[0].period_ns, Some(20_000_000));
    assert_eq!(change("robot.name", "other").unwrap().name, "other");
    let refused = change("nodes.eye.perid_ms", "20").unwrap_err();
    assert!(refused[0].to_string().contains("did you mean \"period_ms\"?"), "{}", refused[0]);
}

#[test]
fn the_json_schema_knows_every_type_and_its_settings() {
    let schema = json_schema(TYPES);
    let node = &schema["$defs"]["NodeTable"];
    assert_eq!(node["properties"]["type"]["enum"], serde_json::json!(["sense", "act", "join"]));
    assert!(schema.to_string().contains("range_m"));
    assert_eq!(schema["additionalProperties"], serde_json::json!(false));
}

proptest::proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "\\PC*", cut in 0..400_usize) {
        let _ = parse(&text);
        let cut = GOOD.char_indices().map(|(i, _)| i).nth(cut).unwrap_or(0);
        let _ = parse(&GOOD[..cut]);
    }
}

/// Errors of the good robot with this added to its end.
fn care_errors(addition: &str) -> String {
    let text = format!("{GOOD}\n{addition}\n");
    match Robot::parse(&text, "robot.toml", Resources::Folder(".".into()), TYPES) {
        Ok(_) => String::new(),
        Err(errors) => errors.iter().map(|e| format!("{e}\n")).collect(),
    }
}

#[test]
fn care_that_contradicts_itself_is_refused_with_where_why_and_what_to_do() {
    let limp = "[limp]\nactions = [\"turn\"]\nmax_speed_m_s = 0.1\n";
    for (addition, why) in [
        ("[nodes.turn.care]\nloss = \"limp\"", "asks for limp mode, which this robot has not"),
        ("[nodes.turn.care]\nloss = \"stop\"\nclear = \"recovered\"", "never ends by itself"),
        ("[nodes.turn.care]\nmissed_low = 5\nmissed_high = 3", "comes no sooner than"),
        ("[nodes.turn.care]\nrestart_when_silent = true", "nothing says when the node is silent"),
        ("[nodes.turn.care]\nfresh_ms = { velocity = 0.0 }", "must lie between 1 and"),
        ("[nodes.turn.care]\nlosss = \"hold\"", "unknown key"),
        ("[limp]\nactions = [\"fly\"]\nmax_speed_m_s = 0.1", "there is no node \"fly\""),
        ("[limp]\nactions = []\nmax_speed_m_s = 9.0", "not slower than the body's"),
        ("[[supervision.groups]]\nnodes = [\"turn\"]\nstrategy = \"one_for_all\"", "fewer than two nodes"),
        ("[[supervision.groups]]\nnodes = [\"turn\", \"turn\"]\nstrategy = \"one_for_all\"", "named twice"),
        (
            "[[supervision.reactions]]\nwhen = \"death\"\ndo = [\"notify\"]\notherwise = [{ restart = \"turn\" }]",
            "a fallback restarts nothing",
        ),
        ("[[supervision.reactions]]\nwhen = \"death\"\ncode = 3\ndo = [\"notify\"]", "does not wait for a raised one"),
        ("[[supervision.reactions]]\nwhen = \"death\"\ndo = []", "does nothing"),
    ] {
        let errors = care_errors(addition);
        assert!(errors.contains(why), "{addition}\n{errors}");
    }
    let sound = "[nodes.turn.care]\nloss = \"limp\"\nstandby = true\nfresh_ms = { velocity = 300 }\n[[supervision.reactions]]\n\
        node = \"turn\"\nwhen = \"missed_low\"\ndo = [\"heal\", { wait_ms = 5.0 }, { execute = [\"true\"] }, { rung = \"hold\" }]\nclear = \"reset\"";
    assert_eq!(care_errors(&format!("{limp}{sound}")), "");
}

#[test]
fn an_elastic_period_has_two_bounds_in_order() {
    let period = |written: &str| {
        let text = GOOD.replacen("period_ms = 100", &format!("period_ms = {written}"), 1);
        assert_ne!(text, GOOD);
        Robot::parse(&text, "robot.toml", Resources::Folder(".".into()), TYPES)
    };
    let robot = period("{ min = 50, max = 200 }").unwrap();
    assert!(robot.nodes.iter().any(|n| (n.period_ns, n.longest_period_ns) == (Some(50_000_000), Some(200_000_000))));
    assert!(period("{ min = 200, max = 50 }").unwrap_err()[0].to_string().contains("swap min and max"));
    assert!(period("{ min = 200, most = 50 }").unwrap_err()[0].to_string().contains("most"));
}
