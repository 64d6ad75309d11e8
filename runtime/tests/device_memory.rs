//! Memory links: the line's rate on virtual time, faults, and who is at the other end.

#![allow(clippy::unwrap_used, reason = "tests")]

use proptest::prelude::*;
use runtime::device::{DeviceError, DeviceLink, Direction, MemoryLinks, WhyClosed};
use runtime::{Device, Time};

/// Time of one byte at 9600 baud, 8N1 [ns].
const BYTE_NS: u64 = 1_041_666;

fn pair(baud: Option<u32>) -> (MemoryLinks, Device, Device) {
    let links = MemoryLinks::new();
    let (client, server) = (links.client("base", baud), links.server("base", baud));
    (links, client, server)
}

fn all(device: &mut Device) -> Vec<u8> {
    let mut buffer = [0; 32 * 1024];
    let count = device.receive(&mut buffer);
    buffer[..count].to_vec()
}

fn open(generation: u64) -> DeviceLink {
    DeviceLink::Open { generation }
}

fn closed(why: WhyClosed) -> DeviceLink {
    DeviceLink::Closed { why }
}

#[test]
fn without_a_rate_bytes_arrive_at_once() {
    let (_, mut client, mut server) = pair(None);
    client.send(b"pulse").unwrap();
    server.send(b"sip").unwrap();
    assert_eq!((all(&mut server), all(&mut client)), (b"pulse".to_vec(), b"sip".to_vec()));
}

#[test]
fn at_9600_baud_a_byte_arrives_every_1_04_ms() {
    let (links, mut client, mut server) = pair(Some(9600));
    links.set_now(Time::from_seconds(1.0));
    client.send(b"abc").unwrap();
    assert_eq!(server.receive(&mut [0; 8]), 0);
    for byte in 1..=3 {
        let arrival = Time::from_seconds(1.0).after_ns(byte * BYTE_NS);
        links.set_now(Time::from_nanos(arrival.nanos() - 1));
        assert_eq!(all(&mut server), b"");
        links.set_now(arrival);
        assert_eq!(all(&mut server), [b'a' + byte as u8 - 1]);
        assert_eq!(server.arrived(), arrival);
    }
}

#[test]
fn a_busy_line_sends_one_after_the_other_and_both_ways_at_once() {
    let (links, mut client, mut server) = pair(Some(9600));
    client.send(b"ab").unwrap();
    client.send(b"c").unwrap();
    server.send(b"x").unwrap();
    assert_eq!(client.next_arrival(Time::ZERO), Some(Time::from_nanos(BYTE_NS)));
    // A trigger waits for the end of a packet, not for each byte.
    assert_eq!(server.next_arrival(Time::ZERO), Some(Time::from_nanos(2 * BYTE_NS)));
    assert_eq!(server.next_arrival(Time::from_nanos(2 * BYTE_NS)), Some(Time::from_nanos(3 * BYTE_NS)));
    links.set_now(Time::from_nanos(2 * BYTE_NS));
    assert_eq!((all(&mut server), all(&mut client)), (b"ab".to_vec(), b"x".to_vec()));
    // After a pause the line begins anew.
    links.set_now(Time::from_seconds(5.0));
    all(&mut server);
    client.send(b"d").unwrap();
    assert_eq!(server.next_arrival(Time::ZERO), Some(Time::from_seconds(5.0).after_ns(BYTE_NS)));
}

#[test]
fn ends_at_different_rates_receive_garbage_until_they_agree() {
    let (links, mut client, mut server) = pair(Some(9600));
    client.set_baud(115_200);
    client.send(b"pulse").unwrap();
    links.set_now(Time::from_seconds(1.0));
    let garbage = all(&mut server);
    assert_eq!(garbage.len(), 5);
    assert!(garbage.iter().zip(b"pulse").all(|(found, sent)| found != sent));
    server.set_baud(115_200);
    client.send(b"pulse").unwrap();
    links.set_now(Time::from_seconds(2.0));
    assert_eq!(all(&mut server), b"pulse");
}

#[test]
fn every_byte_is_another_one_at_a_wrong_rate() {
    let (links, mut client, mut server) = pair(Some(9600));
    client.set_baud(19_200);
    let bytes: Vec<u8> = (0..=255).collect();
    client.send(&bytes).unwrap();
    links.set_now(Time::from_seconds(9.0));
    assert!(all(&mut server).iter().zip(&bytes).all(|(found, sent)| found != sent));
}

#[test]
fn each_end_says_why_the_other_is_not_there() {
    let links = MemoryLinks::new();
    let mut client = links.client("base", None);
    assert_eq!(client.link(), closed(WhyClosed::NoSuchPort));
    assert_eq!(client.send(b"x"), Err(DeviceError::Closed(WhyClosed::NoSuchPort)));
    let server = links.server("base", None);
    assert_eq!((client.link(), server.link()), (open(1), open(1)));
    drop(client);
    assert_eq!(server.link(), closed(WhyClosed::NoClient));
    let client = links.client("base", None);
    assert_eq!((client.link(), server.link()), (open(2), open(2)));
    assert_eq!(client.refused_sends(), 0);
}

#[test]
fn a_successor_takes_a_link_over_from_one_that_died_without_a_word() {
    let (links, mut client, mut server) = pair(None);
    client.send(b"half a pack").unwrap();
    // A simulated death skips destructors.
    let mut successor = links.client("base", None);
    std::mem::forget(client);
    assert_eq!((server.link(), successor.link()), (open(2), open(2)));
    assert_eq!(all(&mut server), b"");
    successor.send(b"whole").unwrap();
    assert_eq!(all(&mut server), b"whole");
}

#[test]
fn an_older_end_can_neither_send_nor_receive_nor_reopen() {
    let (links, mut old, mut server) = pair(None);
    let mut new = links.client("base", None);
    server.send(b"for the new one").unwrap();
    assert_eq!(old.link(), closed(WhyClosed::HungUp));
    assert_eq!(old.send(b"x"), Err(DeviceError::Closed(WhyClosed::HungUp)));
    assert_eq!(all(&mut old), b"");
    old.reopen();
    drop(old);
    assert_eq!(new.link(), open(2));
    assert_eq!(all(&mut new), b"for the new one");
}

#[test]
fn an_unplugged_link_is_hung_up_and_what_was_under_way_is_lost() {
    let (links, mut client, mut server) = pair(Some(9600));
    client.send(b"lost").unwrap();
    let cable = links.link("base").unwrap();
    cable.set_up(false);
    assert_eq!((client.link(), server.link()), (closed(WhyClosed::HungUp), closed(WhyClosed::HungUp)));
    assert_eq!(client.send(b"x"), Err(DeviceError::Closed(WhyClosed::HungUp)));
    cable.set_up(true);
    links.set_now(Time::from_seconds(1.0));
    assert_eq!((client.link(), all(&mut server)), (open(2), Vec::new()));
    assert_eq!(links.names(), ["base"]);
}

#[test]
fn reopening_gives_both_ends_a_new_link() {
    let (_, mut client, server) = pair(None);
    client.reopen();
    assert_eq!((client.link(), server.link()), (open(2), open(2)));
}

#[test]
fn a_full_line_takes_nothing_of_what_does_not_fit() {
    let (links, mut client, mut server) = pair(Some(9600));
    // A line takes 16 KiB, in which a scan of a thousand beams has room.
    client.send(&[1; 16_300]).unwrap();
    assert_eq!(client.send(&[2; 200]), Err(DeviceError::Full));
    assert_eq!(client.refused_sends(), 1);
    links.set_now(Time::from_seconds(60.0));
    assert_eq!(all(&mut server), [1; 16_300]);
    client.send(&[2; 200]).unwrap();
}

#[test]
fn a_fault_changes_or_loses_what_it_likes_and_the_line_keeps_its_time() {
    let (links, mut client, mut server) = pair(Some(9600));
    let cable = links.link("base").unwrap();
    let mut count = 0;
    cable.set_fault(move |_, direction, byte| {
        assert_eq!(direction, Direction::ToServer);
        count += 1;
        match count % 3 {
            0 => None,
            1 => Some(byte),
            _ => Some(byte ^ 0x80),
        }
    });
    client.send(b"aaa").unwrap();
    // The last byte is lost: the packet ends with the one before.
    assert_eq!(server.next_arrival(Time::ZERO), Some(Time::from_nanos(2 * BYTE_NS)));
    cable.clear_fault();
    client.send(b"b").unwrap();
    links.set_now(Time::from_nanos(4 * BYTE_NS - 1));
    assert_eq!(all(&mut server), [b'a', b'a' ^ 0x80]);
    links.set_now(Time::from_nanos(4 * BYTE_NS));
    assert_eq!(all(&mut server), b"b");
}

proptest! {
    #[test]
    fn the_same_sends_arrive_the_same_way_twice(
        sends in prop::collection::vec((0u64..5_000_000, prop::collection::vec(any::<u8>(), 0..30)), 1..40),
        seed: u64,
    ) {
        let run = || {
            let (links, mut client, mut server) = pair(Some(9600));
            let mut noise = seed | 1;
            links.link("base").unwrap().set_fault(move |_, _, byte| {
                noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                match noise >> 60 {
                    0 => None,
                    1 => Some(!byte),
                    _ => Some(byte),
                }
            });
            let (mut now, mut history) = (Time::ZERO, Vec::new());
            for (pause_ns, bytes) in &sends {
                now = now.after_ns(*pause_ns);
                links.set_now(now);
                let sent = client.send(bytes);
                history.push((now, sent, all(&mut server), server.arrived(), server.next_arrival(now)));
            }
            history
        };
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn nothing_is_lost_or_reordered_however_the_time_passes(
        sends in prop::collection::vec((0u64..3_000_000, prop::collection::vec(any::<u8>(), 0..30)), 1..40),
    ) {
        let (links, mut client, mut server) = pair(Some(115_200));
        let (mut now, mut sent, mut arrived) = (Time::ZERO, Vec::new(), Vec::new());
        for (pause_ns, bytes) in &sends {
            now = now.after_ns(*pause_ns);
            links.set_now(now);
            client.send(bytes).unwrap();
            sent.extend_from_slice(bytes);
            arrived.extend(all(&mut server));
        }
        links.set_now(now.after_s(10.0));
        arrived.extend(all(&mut server));
        prop_assert_eq!(arrived, sent);
    }
}
