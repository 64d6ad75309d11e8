//! `sinew hz`.

use crate::place::{Channel, Place, Said};
use messages::Twist;
use runtime::clock;

#[test]
fn the_ring_answers_at_once_with_rate_and_jitter() {
    let place = Place::new("hz-ring");
    let mut channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 32, 0);
    let now = clock::now().nanos();
    for k in 0..32_u64 {
        let late = if k == 20 { 7_000_000 } else { 0 };
        channel.write(now - 50_000_000 * (31 - k) + late, &Twist::default(), &[]);
    }
    let said = place.sinew(&["hz", "command", "--json"]);
    let value = &said.json()[0];
    assert_eq!((value["rate_hz"].as_f64(), value["samples"].as_u64()), (Some(20.0), Some(32)), "{said:?}");
    let ms = |key: &str, part: &str| (value[key][part].as_f64().unwrap() * 1e3).round();
    assert_eq!((ms("spacing_s", "p50"), ms("spacing_s", "max"), ms("jitter_s", "max")), (50.0, 57.0, 7.0), "{said:?}");
    let said = place.sinew(&["hz", "command"]);
    assert!(said.out.contains("/motion/drive/command  20.0 Hz") && said.out.contains("jitter"), "{said:?}");
}

#[test]
fn a_window_counts_what_comes_while_it_watches() {
    let place = Place::new("hz-window");
    let mut channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 32, 0);
    let child = place.start(&["hz", "command", "--window", "0.5", "--json"]);
    // Stamps are a hundred a second however unevenly this machine lets the test write.
    let mut stamp_ns = 1_000_000_000;
    let said = Said::during(child, || {
        channel.write(stamp_ns, &Twist::default(), &[]);
        stamp_ns += 10_000_000;
        clock::sleep_s(0.002);
    });
    assert_eq!(said.json()[0]["rate_hz"].as_f64().unwrap().round(), 100.0, "{said:?}");
}

#[test]
fn a_channel_without_samples_has_no_rate() {
    let place = Place::new("hz-none");
    let _channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 32, 0);
    let said = place.sinew(&["hz", "command", "--window", "0.05"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("no sample came"), "{said:?}");
    assert_eq!(place.sinew(&["hz", "command", "--window", "0"]).code, Some(2));
}
