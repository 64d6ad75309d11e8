use std::fs;

use rustix::process::Signal;
use supervisor::{Report, StopCause};

use crate::bench::{DEAF, Local, Place, READY, Remote, Told, node};

#[test]
fn ctrl_c_leaves_no_process_and_no_file() {
    let place = Place::new();
    let mut run = Remote::run(&place, &[("base", READY), ("arbiter", READY)], 2.0);
    run.until_ready(&["base", "arbiter"]);
    assert_eq!(place.processes().len(), 2);
    fs::create_dir_all(place.root().join("drivers/base")).unwrap();
    fs::write(place.root().join("drivers/base/sonar"), [0; 4096]).unwrap();
    run.signal(Signal::INT);
    assert_eq!(run.until("ended by "), "SIGINT");
    place.assert_nothing_left();
    run.ended();
}

#[test]
fn termination_and_hang_up_stop_in_order_too() {
    for (signal, name) in [(Signal::TERM, "SIGTERM"), (Signal::HUP, "SIGHUP")] {
        let place = Place::new();
        let mut run = Remote::run(&place, &[("base", READY)], 2.0);
        run.until("ready base");
        run.signal(signal);
        assert_eq!(run.until("ended by "), name);
        place.assert_nothing_left();
    }
}

#[test]
fn a_second_ctrl_c_does_not_wait_for_anybody() {
    let place = Place::new();
    // A grace longer than the test program's own limit: only the second request can end it.
    let mut run = Remote::run(&place, &[("base", DEAF)], 600.0);
    run.until("ready base");
    run.signal(Signal::INT);
    run.until("robot stopping");
    run.signal(Signal::INT);
    assert_eq!(run.until("ended by "), "SIGINT");
    place.assert_nothing_left();
}

#[test]
fn a_supervisor_cannot_be_suspended() {
    let place = Place::new();
    let mut run = Remote::run(&place, &[("base", READY)], 2.0);
    run.until("ready base");
    run.signal(Signal::TSTP);
    assert!(run.until("note ").starts_with("not suspended"));
    run.signal(Signal::INT);
    run.until("ended by ");
}

#[test]
fn a_node_that_ignores_sigterm_is_killed_after_its_grace() {
    let place = Place::new();
    let mut deaf = node("base", DEAF);
    deaf.rule.grace_s = 0.2;
    let run = Local::run(place.plan(vec![deaf]));
    run.until_ready("base");
    let outcome = run.end().unwrap();
    let killed: Vec<_> = outcome.incidents.iter().filter(|record| record.event == "killed").collect();
    assert_eq!(killed[0].message, "did not stop within 0.2 s and was killed");
    place.assert_nothing_left();
}

#[test]
fn a_stopped_node_can_still_be_asked_to_end() {
    let place = Place::new();
    let mut base = node("base", READY);
    base.rule.grace_s = 10.0;
    let run = Local::run(place.plan(vec![base]));
    let pid = run.until_ready("base");
    crate::bench::kill(pid, Signal::STOP);
    while !fs::read_to_string(format!("/proc/{pid}/stat")).unwrap().contains(") T ") {
        std::thread::yield_now();
    }
    let outcome = run.end().unwrap();
    assert!(outcome.incidents.iter().all(|record| record.event != "killed"), "{:?}", outcome.incidents);
    place.assert_nothing_left();
}

#[test]
fn the_simulator_is_still_there_while_the_driver_says_its_last_word() {
    let place = Place::new();
    let order = place.base.join("order");
    let script = |name: &str| {
        // The wait returns as soon as the signal comes; the trap does the rest.
        format!(
            "trap 'sleep 0.05; echo {name} >> {}; exit 0' TERM; echo >&3; exec 3>&-; sleep 60 & wait",
            order.display()
        )
    };
    let groups = [("world", 2), ("base", 1), ("drive", 0), ("forward", 0)];
    let nodes = groups.map(|(name, group)| {
        let mut node = node(name, &script(name));
        node.rule.stop_group = group;
        node
    });
    let run = Local::run(place.plan(nodes.to_vec()));
    let mut ready = 0;
    run.until(|told| {
        ready += u32::from(matches!(told, Told::Ready { .. }));
        (ready == 4).then_some(())
    });
    run.end().unwrap();
    let order = fs::read_to_string(order).unwrap();
    let lines: Vec<&str> = order.lines().collect();
    assert_eq!(lines[2..], ["base", "world"], "{lines:?}");
    place.assert_nothing_left();
}

#[test]
fn down_returns_when_nothing_is_left() {
    let place = Place::new();
    let run = Local::run(place.plan(vec![node("base", "trap 'sleep 0.1; exit 0' TERM; echo >&3; sleep 60 & wait")]));
    run.until_ready("base");
    supervisor::down(&place.root(), 30.0).unwrap();
    place.assert_nothing_left();
    assert_eq!(run.join().unwrap().stopped_by, StopCause::Down);
    let error = supervisor::down(&place.root(), 1.0).unwrap_err();
    assert!(error.to_string().contains("no robot is running"), "{error}");
}

#[test]
fn an_unknown_request_is_answered_and_changes_nothing() {
    let place = Place::new();
    let run = Local::run(place.plan(vec![node("base", READY)]));
    run.until_ready("base");
    assert!(supervisor::ask(&place.root(), "explode", 10.0).unwrap().contains("known are: down, status"));
    let status = supervisor::ask(&place.root(), "status", 10.0).unwrap();
    let status: supervisor::Status = serde_json::from_str(&status).unwrap();
    assert_eq!((status.state.as_str(), status.nodes[0].state.as_str()), ("running", "running"));
    run.end().unwrap();
}

#[test]
fn what_a_node_put_into_a_session_of_its_own_is_found_at_the_end() {
    let place = Place::new();
    let away = place.base.join("away");
    let script = format!(
        "setsid sh -c 'touch {0}; exec sleep 60' & for n in $(seq 3000); do [ -e {0} ] && break; sleep 0.01; done; {READY}",
        away.display()
    );
    let run = Local::run(place.plan(vec![node("base", &script)]));
    run.until_ready("base");
    let outcome = run.end().unwrap();
    place.assert_nothing_left();
    assert!(outcome.incidents.iter().any(|record| record.message.contains("left behind")));
}

#[test]
fn an_observer_that_panics_ends_the_run_in_order() {
    let place = Place::new();
    let last_word = place.base.join("last");
    let script =
        format!("trap 'echo stop > {}; exit 0' TERM; echo >&3; exec 3>&-; sleep 60 & wait", last_word.display());
    let plan = place.plan(vec![node("base", &script)]);
    let mut observer = |report: Report<'_>| assert!(!matches!(report, Report::Ready { .. }), "nobody reads this");
    let run = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| supervisor::run(plan, &mut observer)));
    let panic = run.unwrap_err();
    assert_eq!(panic.downcast_ref::<&str>(), Some(&"nobody reads this"));
    assert_eq!(crate::bench::line_from(&last_word), "stop\n", "the driver had its last word");
    place.assert_nothing_left();
}
