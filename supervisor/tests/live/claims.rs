use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::process::Signal;

use crate::bench::{DEAF, Local, Place, READY, Remote, node};

#[test]
fn a_second_start_says_who_is_there_and_what_to_do() {
    let place = Place::new();
    let mut first = Remote::run(&place, &[("base", READY)], 2.0);
    first.until("ready base");
    let mut second = Remote::run(&place, &[("base", READY)], 2.0);
    let refused = second.until("refused ");
    for part in ["robot `robot` is already running", &first.process.id().to_string(), "sinew down robot", "--name"] {
        assert!(refused.contains(part), "`{part}` is missing in: {refused}");
    }
    second.ended();
    assert_eq!(place.processes().len(), 1, "the first goes on undisturbed");
    first.signal(Signal::INT);
    first.until("ended by ");
    place.assert_nothing_left();
}

#[test]
fn a_second_start_within_the_same_program_is_refused_too() {
    let place = Place::new();
    let run = Local::run(place.plan(vec![node("base", READY)]));
    run.until_ready("base");
    let error = Local::run(place.plan(vec![node("base", READY)])).join().unwrap_err();
    assert!(error.to_string().contains("already running"), "{error}");
    assert_eq!(supervisor::owners(&place.shm()).len(), 1);
    run.end().unwrap();
    assert_eq!(supervisor::owners(&place.shm()), []);
}

#[test]
fn what_a_killed_supervisor_left_is_cleared_by_the_next_one() {
    let place = Place::new();
    let mut first = Remote::run(&place, &[("base", READY), ("deaf", DEAF)], 2.0);
    first.until_ready(&["base", "deaf"]);
    first.signal(Signal::KILL);
    first.ended();
    let left = place.processes();
    assert!(left.len() >= 2, "nodes that do not watch their supervisor outlive it");
    fs::write(place.root().join("sonar"), "samples").unwrap();

    let mut second = Remote::run(&place, &[("base", READY)], 2.0);
    let leftovers = second.until("leftovers ");
    assert!(leftovers.contains("ended without cleaning up: stopped") && leftovers.contains("killed"), "{leftovers}");
    second.until("ready base");
    assert!(place.processes().iter().all(|pid| !left.contains(pid)));
    assert!(!place.root().join("sonar").exists());
    second.signal(Signal::INT);
    second.until("ended by ");
    place.assert_nothing_left();
}

#[test]
fn a_recycled_pid_is_never_killed() {
    let place = Place::new();
    let mut stranger = Command::new("sleep").arg("60").process_group(0).spawn().unwrap();
    let run = place.root().join(".run");
    fs::create_dir_all(&run).unwrap();
    fs::set_permissions(&run, fs::Permissions::from_mode(0o700)).unwrap();
    fs::write(run.join("supervisor.lock"), "").unwrap();
    let owner = r#"{"robot":"robot","pid":1,"start_ticks":1,"since_unix_s":0,"run":"1-1-1"}"#;
    fs::write(run.join("supervisor.json"), owner).unwrap();
    fs::write(run.join("base.pid"), format!("{} 1\n", stranger.id())).unwrap();
    fs::write(run.join("torn.pid"), "12").unwrap();
    let next = Local::run(place.plan(vec![node("base", READY)]));
    let leftovers = next.until_incident("leftovers");
    assert!(leftovers.message.contains("stopped 0 processes"), "{}", leftovers.message);
    assert!(stranger.try_wait().unwrap().is_none(), "the stranger lives");
    next.end().unwrap();
    stranger.kill().unwrap();
    stranger.wait().unwrap();
}

#[test]
fn files_of_others_are_never_removed() {
    let place = Place::new();
    fs::create_dir_all(place.root()).unwrap();
    fs::write(place.root().join("thesis.tex"), "years of work").unwrap();
    let error = Local::run(place.plan(vec![node("base", READY)])).join().unwrap_err();
    assert!(error.to_string().contains("holds files that are not Sinew's"), "{error}");
    assert!(place.root().join("thesis.tex").exists());
}

#[test]
fn a_link_in_place_of_the_folder_is_refused() {
    let place = Place::new();
    let elsewhere = place.base.join("elsewhere");
    fs::create_dir_all(&elsewhere).unwrap();
    fs::create_dir_all(place.shm()).unwrap();
    symlink(&elsewhere, place.root()).unwrap();
    let error = Local::run(place.plan(vec![node("base", READY)])).join().unwrap_err();
    assert!(error.to_string().contains("is a symbolic link"), "{error}");
    assert_eq!(fs::read_dir(elsewhere).unwrap().count(), 0);
}

#[test]
fn a_folder_that_others_may_write_to_is_refused() {
    let place = Place::new();
    fs::create_dir_all(place.shm()).unwrap();
    fs::set_permissions(place.shm(), fs::Permissions::from_mode(0o777)).unwrap();
    let error = Local::run(place.plan(vec![node("base", READY)])).join().unwrap_err();
    assert!(error.to_string().contains("others may exchange files in it"), "{error}");
}

#[test]
fn a_name_is_free_again_as_soon_as_down_returns() {
    let place = Place::new();
    for _ in 0..10 {
        let run = Local::run(place.plan(vec![node("base", READY)]));
        run.until_ready("base");
        supervisor::down(&place.root(), 30.0).unwrap();
        run.join().unwrap();
    }
    place.assert_nothing_left();
}
