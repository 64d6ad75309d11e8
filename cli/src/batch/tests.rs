use super::table::{heading, line};
use super::*;
use crate::simulation::{Run, TrackPoint};
use messages::Truth;
use simulator::world::World;

fn mission(seed: u64, failure: &str, distance_m: f64) -> Mission {
    let cost = |path: &str, cpu| NodeCost { path: path.into(), cpu, missed_deadlines: seed };
    let nodes = vec![cost("/drivers/base", 0.0125), cost("/motion/drive", 0.003)];
    Mission { seed, failure: failure.into(), distance_m, hash: format!("{seed:x}"), nodes, ..Mission::default() }
}

/// A run along x at 0.5 m/s for 20 s.
fn straight(contacts: [u64; 3]) -> Run {
    let track: Vec<TrackPoint> = (0..=200)
        .map(|k| {
            let time_s = f64::from(k) * 0.1;
            let mut truth = Truth { x_m: 0.5 * time_s, clearance_m: 1.0, contacts, ..Truth::default() };
            truth.velocity.linear_x_m_s = 0.5;
            TrackPoint { time_s, truth }
        })
        .collect();
    let mut run = Run::of_track(7, track);
    run.result.contacts_caused = contacts[0] + contacts[1];
    run.result.contacts_suffered = contacts[2];
    run.result.distance_m = 10.0;
    run
}

fn scenario(text: &str) -> Result<Scenario, String> {
    let world = World::load("rooms:1", &mut |_| Err("no file".into())).unwrap();
    Scenario::parse(text, Some(&world), 0.5).map_err(|e| e.to_string())
}

#[test]
fn a_scenario_that_can_never_end_is_refused_with_the_reason() {
    let refused = |text: &str| scenario(text).unwrap_err();
    for endless in ["timeout_s = inf", "timeout_s = 0.0", "timeout_s = -1.0", "timeout_s = nan", "timeout_s = 1e9"] {
        assert!(refused(endless).contains("can never end; write a time"), "{}", refused(endless));
    }
    assert!(refused("").contains("timeout_s"), "a mission needs a timeout");
    let goal = |words: &str| format!("timeout_s = 60.0\n[[goal]]\n{words}");
    assert!(
        refused(&goal("x_m = 99.0\ny_m = 1.0\nwithin_m = 0.5")).contains("goal 1 at (99, 1) lies outside the world")
    );
    assert!(refused(&goal("x_m = 2.0\ny_m = 1.0\nwithin_m = 0.0")).contains("within_m above zero"));
    assert!(refused(&goal("x_m = nan\ny_m = 1.0\nwithin_m = 0.5")).contains("is no place"));
    let far = "timeout_s = 5.0\n[[goal]]\nx_m = 1.0\ny_m = 1.0\nwithin_m = 0.5\n[[goal]]\nx_m = 20.0\ny_m = 1.0\nwithin_m = 0.5";
    assert!(refused(far).contains("5 s are too short"), "{}", refused(far));
    assert!(refused("timeout_s = 5.0\n[success]\nmin_distance_m = 90.0").contains("no mission can meet it"));
    assert!(refused("timeout_s = 5.0\nspeed = 1").contains("unknown field"));
}

#[test]
fn a_mission_is_judged_by_its_goals_in_order_and_by_its_conditions() {
    let judge = |text: &str, contacts: [u64; 3]| Mission::judge(&scenario(text).unwrap(), &straight(contacts));
    let two = "timeout_s = 20.0\n[[goal]]\nx_m = 2.0\ny_m = 0.3\nwithin_m = 0.5\n[[goal]]\nx_m = 6.0\ny_m = 0.3\nwithin_m = 0.5";
    let good = judge(two, [0, 0, 1]);
    assert!(good.succeeded(), "{}", good.failure);
    assert_eq!(good.goals, 2);
    assert!((good.time_s - 11.2).abs() < 0.11, "there at 5.6 m: {} s", good.time_s);
    let late = judge(&format!("{two}\ntimeout_s = 3.0"), [0, 0, 0]);
    assert_eq!((late.failure.as_str(), late.goals), ("goal 2 not reached in time", 1));
    let order = "timeout_s = 20.0\n[[goal]]\nx_m = 6.0\ny_m = 0.3\nwithin_m = 0.5\n[[goal]]\nx_m = 2.0\ny_m = 0.3\nwithin_m = 0.5";
    assert_eq!(judge(order, [0; 3]).failure, "goal 2 not reached in time");
    assert_eq!(judge("timeout_s = 20.0", [1, 1, 0]).failure, "2 contacts caused");
    assert_eq!(
        judge("timeout_s = 20.0\n[success]\nmax_contacts_suffered = 0", [0, 0, 3]).failure,
        "3 contacts suffered"
    );
    // 20 s of rolling at 0.5 m/s: c·m·g·v·t.
    assert!((good.energy_j - 0.03 * 9.0 * 9.81 * 10.0).abs() < 1e-6, "{}", good.energy_j);
    assert!(good.jerk_m_s3 < 1e-9 && good.speed_m_s[1] == 0.5);
}

#[test]
fn a_table_reads_back_what_was_written_and_loses_only_a_line_cut_in_two() {
    let missions = [mission(3, "", 1.25), mission(4, "2 contacts caused", 0.1)];
    let mut text = heading();
    missions.iter().for_each(|mission| text += &line(mission, "abc"));
    let table = parse(&text).unwrap();
    assert_eq!((table.missions.as_slice(), table.setup.as_str()), (missions.as_slice(), "abc"));
    for cut in 0..text.len() {
        let table = parse(&text[..cut]).unwrap_or_else(|e| panic!("cut at {cut}: {e}"));
        let again = parse(&text[..table.whole]).unwrap();
        assert_eq!(again, table, "cut at {cut}");
    }
    assert_eq!(parse("a,b\n"), Err(TableError::Heading));
    assert_eq!(parse(&format!("{text}{}", line(&missions[0], "other"))), Err(TableError::Mixed { line: 4 }));
    let damaged = parse(&format!("{}1,x\n", heading())).unwrap_err().to_string();
    assert!(damaged.starts_with("line 2 is no mission"), "{damaged}");
}

#[test]
fn a_batch_that_is_interrupted_keeps_what_it_has_whatever_the_threads() {
    let seeds: Vec<u64> = (0..50).collect();
    let run = |jobs: usize, most: usize| {
        let mut seen = 0;
        let mut done = |_: &Mission| {
            seen += 1;
            seen < most
        };
        work::<String>(&seeds, jobs, &|seed| Ok(mission(seed, "", seed as f64)), &mut done)
    };
    let (all, error) = run(1, 1000);
    assert_eq!((all.len(), error), (50, None));
    assert_eq!(run(3, 1000).0, all, "in the order of the seeds");
    assert_eq!(run(1, 7).0.len(), 7);
    let part = run(3, 7).0.len();
    assert!((7..10).contains(&part), "what was under way is finished: {part}");
    let (kept, error) =
        work(&seeds, 1, &|seed| if seed == 5 { Err("no") } else { Ok(mission(seed, "", 0.0)) }, &mut |_| true);
    assert_eq!((kept.len(), error), (5, Some("no")));
}

#[test]
fn a_comparison_pairs_by_seed_and_says_how_sure_it_is() {
    let batch = |more_m: f64, bad: u64| -> Vec<Mission> {
        let failure = |seed: u64| if seed < bad { "2 contacts caused" } else { "" };
        (0..40).map(|seed| mission(seed, failure(seed), 10.0 + (seed % 7) as f64 + more_m)).collect()
    };
    let same = compare(&batch(0.0, 3), &batch(0.0, 3));
    assert_eq!((same.seeds, same.identical, same.p), (40, 40, 1.0));
    assert!(same.metrics.iter().all(|metric| !metric.significant));
    let other = compare(&batch(0.0, 9), &batch(0.5, 1)[..30]);
    assert_eq!((other.seeds, other.unpaired), (30, 10));
    let distance = other.metrics.iter().find(|metric| metric.metric == "distance_m").unwrap();
    assert!((distance.difference - 0.5).abs() < 1e-9 && distance.significant, "{distance:?}");
    assert_eq!((other.only[0].len(), other.only[1].clone()), (0, (1..9).collect::<Vec<u64>>()));
    assert!(other.p < 0.01, "{}", other.p);
}

#[test]
fn the_report_stands_alone_and_names_every_failure_with_its_command() {
    let missions: Vec<Mission> =
        (0..30).map(|seed| mission(seed, if seed == 4 { "1 contacts <caused>" } else { "" }, seed as f64)).collect();
    let frame =
        Frame { robot: "a & b".into(), facts: vec![("world".into(), "cave:1".into())], command: "sinew x".into() };
    let failed =
        Failed { seed: 4, picture: Some("<svg id=\"t\"/>".into()), command: "sinew simulate --seeds 4..5".into() };
    let text = html(&frame, &missions, &[failed]);
    for wanted in [
        "a &amp; b: 29 of 30 missions succeeded",
        "Seed 4:",
        "1 contacts &lt;caused&gt;",
        "sinew simulate --seeds 4..5",
        "<svg id=\"t\"/>",
        "distance <span class=\"unit\">m</span></figcaption><svg",
        "#b3261e\"><title>1</title>",
        "cave:1",
        "/motion/drive",
    ] {
        assert!(text.contains(wanted), "{wanted}");
    }
    assert!(!text.contains("<script") && !text.contains("http"), "nothing from elsewhere");
}
