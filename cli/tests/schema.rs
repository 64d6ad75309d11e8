//! The published JSON Schema of the robot file is the one that this program has.
#![allow(clippy::unwrap_used, reason = "tests")]

#[test]
fn the_published_schema_is_not_stale() {
    let types = sinew::built_in::node_types(&[]);
    let now = runtime::robot::json_schema(&types);
    let published: serde_json::Value =
        serde_json::from_str(include_str!("../../docs/robot.schema.json")).expect("docs/robot.schema.json is JSON");
    assert!(
        now == published,
        "docs/robot.schema.json is stale: write it anew with `sinew schema > docs/robot.schema.json`"
    );
}

#[test]
fn every_robot_that_ships_is_sound() {
    let types = sinew::built_in::node_types(&[]);
    let robots = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("robots");
    let mut checked = 0;
    for entry in std::fs::read_dir(robots).unwrap().flatten() {
        let file = entry.path().join("robot.toml");
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        let resources = runtime::robot::Resources::Folder(entry.path());
        let robot = runtime::robot::Robot::parse(&text, &file.display().to_string(), resources, &types);
        let robot = robot.unwrap_or_else(|errors| panic!("{}", errors[0]));
        robot.graph().unwrap_or_else(|errors| panic!("{}", errors[0]));
        checked += 1;
    }
    assert!(checked >= 1);
}
