//! Commands about robot files, arguments, and the machine.

use crate::place::Place;

fn robot_file(place: &Place, name: &str, text: &str) -> String {
    std::fs::create_dir_all(&place.root).unwrap();
    let file = place.root.join(name);
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}

#[test]
fn the_built_in_robot_is_sound() {
    let place = Place::new("check");
    let said = place.sinew(&["check"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("/drivers/base") && said.out.contains("ok: pioneer"), "{said:?}");
    let value = &place.sinew(&["check", "--json"]).json()[0];
    assert_eq!((value["ok"].as_bool(), value["robot"].as_str()), (Some(true), Some("pioneer")));
}

#[test]
fn an_error_in_a_robot_file_has_its_place_and_the_nearest_word() {
    let place = Place::new("check-error");
    let file = robot_file(
        &place,
        "robot.toml",
        "[robot]\nname = \"x\"\n[nodes.f]\ntype = \"forward\"\ntrigger = \"rangs\"\nreads.ranges = \"/drivers/base/sonar\"\n",
    );
    let said = place.sinew(&["check", &file]);
    assert_eq!((said.code, said.out.as_str()), (Some(4), ""), "{said:?}");
    assert!(said.err.contains(&format!("{file}:5:")), "{said:?}");
    assert!(said.err.contains("did you mean \"ranges\"?"), "{said:?}");
    let said = place.sinew(&["check", &file, "--json"]);
    let value = &said.json()[0];
    assert_eq!(
        (said.code, value["ok"].as_bool(), value["errors"][0]["line"].as_u64()),
        (Some(4), Some(false), Some(5))
    );
}

#[test]
fn a_pattern_that_matches_nothing_is_allowed_and_named() {
    let place = Place::new("check-warning");
    let text = "[robot]\nname = \"x\"\n[nodes.a]\ntype = \"arbiter\"\nperiod_ms = 100\nreads.proposals = \"/actions/*/propsal\"\n";
    let file = robot_file(&place, "robot.toml", text);
    let said = place.sinew(&["check", &file]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains(&format!("warning: {file}:6:")) && said.out.contains("/actions/*/propsal"), "{said:?}");
    assert_eq!(place.sinew(&["check", &file, "--json"]).json()[0]["warnings"][0]["line"].as_u64(), Some(6));
}

#[test]
fn a_rule_of_a_mode_that_nobody_has_is_refused_with_the_modes_that_there_are() {
    let place = Place::new("check-governor");
    let arbiter = "[robot]\nname = \"x\"\n[nodes.a]\ntype = \"arbiter\"\nperiod_ms = 100\nreads.proposals = \"/actions/*/proposal\"\n\
                   config.modes = [{ name = \"wander\" }, { name = \"avoid\" }]\n";
    let governor = "[nodes.g]\ntype = \"governor\"\nperiod_ms = 100\n\
                    config.rules = [{ when = \"limp >= 1\", mode = \"crawl\" }, { when = \"always\", mode = \"wander\" }]\n";
    let follow = "reads.governor = \"/coordinator/g/state\"\n";
    let file = robot_file(&place, "robot.toml", &format!("{arbiter}{follow}{governor}"));
    let said = place.sinew(&["check", &file]);
    assert_eq!(said.code, Some(4), "{said:?}");
    let why = "[nodes.g] config.rules[0].mode: [nodes.a] has no mode \"crawl\"; its modes are wander, avoid";
    assert!(said.err.contains(&file) && said.err.contains(why), "{said:?}");
    let file = robot_file(&place, "alone.toml", &format!("{arbiter}{governor}"));
    let said = place.sinew(&["check", &file]);
    assert!(said.code == Some(4) && said.err.contains("nobody follows [nodes.g]: add reads.governor"), "{said:?}");
    let file = robot_file(&place, "good.toml", &format!("{arbiter}{follow}{}", governor.replace("crawl", "avoid")));
    assert_eq!(place.sinew(&["check", &file]).code, Some(0));
}

#[test]
fn a_missing_robot_says_what_to_give() {
    let place = Place::new("check-missing");
    let said = place.sinew(&["check", "nowhere/at/all"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("cannot read nowhere/at/all") && said.err.contains("robot's folder"), "{said:?}");
}

#[test]
fn the_graph_is_drawn_and_written_for_graphviz_and_programs() {
    let place = Place::new("graph");
    let drawn = place.sinew(&["graph"]).out;
    assert!(drawn.contains("drivers\n  base  p2os") && drawn.contains("◄─"), "{drawn}");
    let dot = place.sinew(&["graph", "--dot"]).out;
    assert!(dot.starts_with("digraph \"pioneer\" {") && dot.contains("\"/drivers/base\" -> "), "{dot}");
    assert_eq!(dot.matches('{').count(), dot.matches('}').count());
    let value = &place.sinew(&["graph", "--json"]).json()[0];
    let velocity = value["edges"].as_array().unwrap().iter().find(|edge| edge["port"] == "velocity").unwrap();
    assert_eq!((velocity["from"].as_str(), velocity["triggers"].as_bool()), (Some("/coordinator/arbiter"), Some(true)));
}

#[test]
fn the_schema_knows_every_node_type() {
    let place = Place::new("schema");
    let schema: serde_json::Value = serde_json::from_str(&place.sinew(&["schema"]).out).unwrap();
    let listed = place.sinew(&["check", "--types", "--json"]).json();
    let types = schema["$defs"]["NodeTable"]["properties"]["type"]["enum"].as_array().unwrap();
    assert_eq!(types.len(), listed[0].as_array().unwrap().len());
    assert!(types.iter().any(|kind| kind == "p2os"), "{types:?}");
}

#[test]
fn the_doctor_names_what_it_looked_at_and_its_json_has_a_verdict() {
    let place = Place::new("doctor");
    let said = place.sinew(&["doctor", "--json"]);
    let value = &said.json()[0];
    let names: Vec<&str> = value["findings"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
    for name in
        ["waiting on channels", "preemption", "SCHED_FIFO", "locked memory", "room for channels", "ModemManager"]
    {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    let failed = value["verdict"] == "fail";
    assert_eq!(said.code, Some(if failed { 4 } else { 0 }), "{said:?}");
}

#[test]
fn wrong_arguments_end_with_two_and_help_with_zero() {
    let place = Place::new("usage");
    for arguments in
        [&["lss"][..], &["cat"], &["ls", "--jsno"], &["cat", "x", "--history", "many"], &["hz", "x", "--window", "-1"]]
    {
        let said = place.sinew(arguments);
        assert_eq!((said.code, said.out.as_str()), (Some(2), ""), "{arguments:?} {said:?}");
        assert!(!said.err.is_empty());
    }
    let said = place.sinew(&["--help"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("Look at a running robot") && said.out.contains("Exit codes"), "{said:?}");
    assert!(!said.out.contains('\u{1b}'), "colours outside a terminal: {said:?}");
    assert!(place.sinew(&["--version"]).out.starts_with("sinew "));
}

#[test]
fn driving_needs_a_terminal() {
    let said = Place::new("drive-pipe").sinew(&["drive"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("drive needs a terminal"), "{said:?}");
}

#[test]
fn a_user_that_does_not_exist_is_refused_with_its_place_and_what_to_do() {
    let place = Place::new("check-user");
    let text = "[robot]\nname = \"x\"\n[nodes.a]\ntype = \"arbiter\"\nperiod_ms = 100\nreads.proposals = \"/actions/*/proposal\"\n\
                isolate = \"strict\"\nuser = \"no_such_user\"\n";
    let file = robot_file(&place, "robot.toml", text);
    for command in ["check", "run"] {
        let said = place.sinew(&[command, &file]);
        assert_eq!(said.code, Some(4), "{said:?}");
        assert!(said.err.contains(&format!("{file}:8:")), "{said:?}");
        assert!(said.err.contains("there is no user \"no_such_user\" on this machine"), "{said:?}");
        assert!(said.err.contains("leave `user` out") && said.err.contains("useradd --system"), "{said:?}");
    }
}

#[test]
fn nodes_of_one_process_are_isolated_alike() {
    let place = Place::new("check-process");
    let node = |name: &str, isolate: &str| {
        format!(
            "[nodes.{name}]\ntype = \"arbiter\"\nperiod_ms = 100\nreads.proposals = \"/actions/*/proposal\"\n\
             process = \"both\"\nisolate = \"{isolate}\"\n"
        )
    };
    let text = format!("[robot]\nname = \"x\"\n{}{}", node("a", "strict"), node("b", "none"));
    let said = place.sinew(&["check", &robot_file(&place, "robot.toml", &text)]);
    assert_eq!(said.code, Some(4), "{said:?}");
    assert!(said.err.contains("one process has one user"), "{said:?}");
}
