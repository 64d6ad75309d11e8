use std::fs;

use runtime::clock;
use rustix::process::Signal;
use supervisor::{Backoff, Intensity, Restart, StopCause};

use crate::bench::{Local, Place, READY, Told, kill, line_from, node};

#[test]
fn a_killed_node_is_started_again_and_the_observer_is_told() {
    let place = Place::new();
    let run = Local::run(place.plan(vec![node("base", "echo going up; echo >&3; exec 3>&-; exec sleep 60")]));
    let first = run.until_ready("base");
    kill(first, Signal::KILL);
    let died = run.until_incident("died");
    assert_eq!((died.signal, died.pid), (Some(9), Some(first)));
    assert_eq!(died.last_lines, ["going up"], "the last words are kept with the incident");
    assert!(died.message.starts_with("killed by SIGKILL"), "{}", died.message);
    run.until_incident("recovered");
    let outcome = run.end().unwrap();
    assert_eq!((outcome.restarts, outcome.stopped_by, outcome.lost.len()), (1, StopCause::Program, 0));
    let journal = fs::read_to_string(place.logs().join("incidents.jsonl")).unwrap();
    let events: Vec<String> =
        journal.lines().map(|line| serde_json::from_str::<supervisor::Record>(line).unwrap().event).collect();
    assert_eq!(events, ["died", "restarted", "recovered"]);
    place.assert_nothing_left();
}

#[test]
fn a_crash_loop_ends_in_giving_up_and_the_rest_goes_on() {
    let place = Place::new();
    let mut crasher = node("crasher", "echo no device; exit 3");
    crasher.rule.backoff = Backoff { step_s: 0.01, ..Backoff::default() };
    crasher.rule.intensity = Intensity { restarts: 4, window_s: 60.0 };
    let run = Local::run(place.plan(vec![crasher, node("base", READY)]));
    let mut deaths = Vec::new();
    run.until(|told| match told {
        Told::Incident(record) if record.event == "died" => {
            deaths.push(record.clone());
            record.message.contains("given up").then_some(())
        }
        _ => None,
    });
    assert_eq!(deaths.len(), 5, "the first process and four restarts");
    assert!(deaths.iter().all(|death| death.code == Some(3) && death.last_lines == ["no device"]));
    run.until(|told| matches!(told, Told::Robot(state) if state == "degraded").then_some(()));
    let status: supervisor::Status =
        serde_json::from_str(&supervisor::ask(&place.root(), "status", 10.0).unwrap()).unwrap();
    let states: Vec<&str> = status.nodes.iter().map(|node| node.state.as_str()).collect();
    assert_eq!((states[0], status.nodes[0].restarts), ("given up", 4));
    assert!(matches!(states[1], "starting" | "running"));
    assert_eq!(run.end().unwrap().lost, ["crasher"]);
    place.assert_nothing_left();
}

#[test]
fn a_run_ends_by_itself_when_all_work_is_done() {
    let place = Place::new();
    let mut task = node("task", "exit 0");
    task.rule.restart = Restart::OnFailure;
    let outcome = Local::run(place.plan(vec![task])).join().unwrap();
    assert_eq!(outcome.stopped_by, StopCause::NothingLeft);
    place.assert_nothing_left();
}

#[test]
fn a_program_that_does_not_exist_is_named_before_anything_is_started() {
    let place = Place::new();
    let mut missing = node("base", "");
    missing.argv = vec!["/no/such/program".into()];
    let error = Local::run(place.plan(vec![node("other", READY), missing])).join().unwrap_err();
    assert_eq!(error.to_string(), "node `base`: no program /no/such/program");
    place.assert_nothing_left();
}

#[test]
fn a_node_is_the_leader_of_a_session_with_four_descriptors_and_knows_its_place() {
    let place = Place::new();
    let told = place.base.join("told");
    let script = format!(
        "(ls -m /proc/$$/fd > {told}.fds); echo $(cut -d' ' -f1,6,7 /proc/$$/stat) $(readlink /proc/$$/fd/0) \
         $SINEW_ROBOT $SINEW_NODE $SINEW_ROOT $SINEW_SUPERVISOR_PID $SINEW_READY_FD $SINEW_RESTARTS > {told}; {READY}",
        told = told.display()
    );
    // Such a descriptor, which some parent of this process had open, must stop here.
    let stray = rustix::io::dup(rustix::stdio::stdin()).unwrap();
    let run = Local::run(place.plan(vec![node("/drivers/base", &script)]));
    let pid = run.until_ready("/drivers/base");
    drop(stray);
    // Process, session, terminal (none).
    let (own, root) = (std::process::id(), place.root());
    let expected = format!("{pid} {pid} 0 /dev/null robot /drivers/base {} {own} 3 0\n", root.display());
    assert_eq!(line_from(&told), expected);
    assert_eq!(line_from(&told.with_extension("fds")), "0, 1, 2, 3\n");
    assert!(place.logs().join("drivers.base.log").exists());
    run.end().unwrap();
}

#[test]
fn what_a_node_forked_does_not_outlive_it() {
    let place = Place::new();
    let child = place.base.join("child");
    let script = format!("sleep 60 & echo $! > {}; {READY}", child.display());
    let run = Local::run(place.plan(vec![node("base", &script)]));
    let node = run.until_ready("base");
    let child: i32 = line_from(&child).trim().parse().unwrap();
    let death = rustix::process::Pid::from_raw(child).unwrap();
    let death = rustix::process::pidfd_open(death, rustix::process::PidfdFlags::empty()).unwrap();
    kill(node, Signal::KILL);
    run.until_ready("base");
    // It was killed before the successor was started; left alone it would live three times as long as this waits.
    let mut watched = [rustix::event::PollFd::new(&death, rustix::event::PollFlags::IN)];
    let patience = rustix::event::Timespec { tv_sec: 20, tv_nsec: 0 };
    assert_eq!(rustix::event::poll(&mut watched, Some(&patience)), Ok(1), "the child lives on");
    run.end().unwrap();
    place.assert_nothing_left();
}

#[test]
fn the_others_wait_until_what_feeds_them_is_ready() {
    let place = Place::new();
    let go = place.base.join("go");
    let wait = format!("for n in $(seq 3000); do [ -e {} ] && break; sleep 0.01; done; {READY}", go.display());
    let mut world = node("world", &wait);
    (world.rule.stop_group, world.rule.ready_within_s) = (1, 60.0);
    let run = Local::run(place.plan(vec![node("base", READY), world]));
    let started = |told: &Told| match told {
        Told::Started { instance, .. } => Some(instance.clone()),
        Told::Ready { instance, .. } => Some(format!("{instance} ready")),
        _ => None,
    };
    assert_eq!(run.until(started), "world");
    fs::write(go, "").unwrap();
    assert_eq!([run.until(started), run.until(started)], ["world ready", "base"]);
    run.end().unwrap();
}

#[test]
fn a_robot_whose_logs_cannot_be_kept_runs_without_them() {
    let place = Place::new();
    let mut plan = place.plan(vec![node("base", READY)]);
    fs::write(place.base.join("file"), "").unwrap();
    plan.log_folder = Some(place.base.join("file/robot"));
    let run = Local::run(plan);
    let note = run.until(|told| if let Told::Note(line) = told { Some(line.clone()) } else { None });
    assert!(note.starts_with("no logs are kept") && note.contains("SINEW_STATE"), "{note}");
    run.until_ready("base");
    run.end().unwrap();
}

/// Prints, and does not judge, how long it takes from kill(2) to the next process and to its first word.
#[test]
fn the_time_from_kill_to_respawn_is_printed() {
    const KILLS: usize = 60;
    let place = Place::new();
    let mut base = node("base", READY);
    base.rule.backoff.healthy_s = 0.0;
    base.rule.intensity.restarts = KILLS as u32;
    let run = Local::run(place.plan(vec![base]));
    let mut pid = run.until_ready("base");
    let (mut respawn_ms, mut ready_ms) = (Vec::new(), Vec::new());
    for _ in 0..KILLS {
        let killed = clock::now();
        kill(pid, Signal::KILL);
        run.until(|told| match told {
            Told::Started { pid: new, at, .. } => {
                pid = *new;
                respawn_ms.push(at.since(killed) * 1e3);
                None
            }
            Told::Ready { at, .. } => {
                ready_ms.push(at.since(killed) * 1e3);
                Some(())
            }
            _ => None,
        });
    }
    run.end().unwrap();
    for (what, mut ms) in [("next process started", respawn_ms), ("its first word (sh)", ready_ms)] {
        assert_eq!(ms.len(), KILLS);
        ms.sort_by(f64::total_cmp);
        let at = |share: f64| ms[(share * (KILLS - 1) as f64) as usize];
        println!("SIGKILL to {what}: p50 {:.2} ms, p90 {:.2} ms, max {:.2} ms, n {KILLS}", at(0.5), at(0.9), at(1.0));
    }
}

#[test]
fn what_the_robots_folder_is_filled_with_is_there_before_the_first_node_and_gone_after_the_last() {
    let place = Place::new();
    let seen = place.base.join("seen");
    let script = format!("cat $SINEW_ROOT/drivers/launch > {}", seen.display());
    let mut plan = place.plan(vec![node("task", &script)]);
    plan.programs[0].rule.restart = Restart::Never;
    let fill = |root: &std::path::Path| {
        fs::create_dir(root.join("drivers")).map_err(|error| error.to_string())?;
        fs::write(root.join("drivers/launch"), "seed 7\n").map_err(|error| error.to_string())
    };
    let outcome = supervisor::run_prepared(plan, fill, &mut |_: supervisor::Report<'_>| {}).unwrap();
    assert_eq!(outcome.lost, Vec::<String>::new());
    assert_eq!(line_from(&seen), "seed 7\n");
    place.assert_nothing_left();
}

#[test]
fn a_folder_that_cannot_be_filled_starts_nothing_and_leaves_nothing() {
    let place = Place::new();
    let plan = place.plan(vec![node("base", READY)]);
    let fill = |root: &std::path::Path| {
        fs::write(root.join("half"), "").map_err(|error| error.to_string())?;
        Err("no room for /drivers/base/sonar".to_owned())
    };
    let error = supervisor::run_prepared(plan, fill, &mut |_: supervisor::Report<'_>| {}).unwrap_err();
    assert_eq!(error.to_string(), "no room for /drivers/base/sonar");
    place.assert_nothing_left();
}
