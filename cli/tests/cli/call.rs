//! `sinew call`, with the test as the called node.

use crate::place::{Channel, Place, Said};
use messages::{Done, Odometry, Switch, Twist};
use runtime::calls::{CallPort, Order, OrderPort};
use runtime::clock;
use runtime::pump::{Pump, PumpBuilder};

/// A node that switches something and can be sent somewhere.
struct Node {
    place: Place,
    switch: CallPort<Switch, Done>,
    go: OrderPort<Twist, Odometry, Done>,
    _pump: Pump,
    _channel: Channel,
}

impl Node {
    fn new(name: &str) -> Node {
        let place = Place::new(name);
        let channel = Channel::make::<Odometry>(&place.tree("pioneer"), "/drivers/base/odometry", 8, 0);
        let (switch, go) = (CallPort::detached("enable"), OrderPort::detached("go"));
        let mut builder = PumpBuilder::new("/drivers/base");
        builder.attach(&switch);
        builder.attach(&go);
        let pump = builder.spawn(&place.root.join("pioneer")).unwrap();
        Node { place, switch, go, _pump: pump, _channel: channel }
    }

    /// Runs the command while the node does `each`.
    fn during(&mut self, arguments: &[&str], mut each: impl FnMut(&mut Node)) -> Said {
        Said::during(self.place.start(arguments), || each(self))
    }
}

#[test]
fn a_node_tells_its_commands_and_their_fields() {
    let node = Node::new("call-list");
    let said = node.place.sinew(&["call", "base"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.lines().any(|line| line.starts_with("enable") && line.contains("on")), "{said:?}");
    assert!(said.out.lines().any(|line| line.starts_with("go") && line.contains("long order")), "{said:?}");
    let value = &node.place.sinew(&["call", "base", "--json"]).json()[0];
    assert_eq!(
        (value["node"].as_str(), value["commands"][0]["name"].as_str()),
        (Some("/drivers/base"), Some("enable"))
    );
    assert_eq!(value["commands"][0]["request"]["fields"][0]["name"], "on");
}

#[test]
fn a_message_reaches_the_node_and_its_answer_comes_back() {
    let mut node = Node::new("call-give");
    let mut heard = Vec::new();
    for message in ["on", "{\"on\": true}", "on=0"] {
        let said = node.during(&["call", "/drivers/base", "enable", message, "--json"], |node| {
            if let Some(request) = node.switch.take() {
                heard.push((request.message.on, request.priority));
                node.switch.answer(request, &Done { at_ns: 77 });
            }
        });
        assert_eq!((said.code, said.json()[0]["answer"]["at_ns"].as_u64()), (Some(0), Some(77)), "{message} {said:?}");
    }
    assert_eq!(heard, [(1, 128), (1, 128), (0, 128)]);
}

#[test]
fn a_long_order_shows_how_far_it_is() {
    let mut node = Node::new("call-order");
    let mut order: Option<Order<Twist, Odometry, Done>> = None;
    let mut turns = 0_u64;
    let message = "{\"linear_x_m_s\":1,\"linear_y_m_s\":0,\"angular_z_rad_s\":0}";
    let said = node.during(&["call", "base", "go", message], |node| match &mut order {
        None => {
            order = node.go.take();
            if let Some(order) = &mut order {
                order.accept();
            }
        }
        Some(running) => {
            turns += 1;
            running.progress(&Odometry { x_m: turns as f64, ..Odometry::default() });
            clock::sleep_s(0.002);
            // Few enough for the pipe that nobody reads before the end.
            if turns == 50
                && let Some(order) = order.take()
            {
                order.done(&Done { at_ns: 5 });
            }
        }
    });
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.starts_with("accepted; Ctrl-C cancels\nprogress x_m "), "{said:?}");
    assert!(said.out.contains("done after") && said.out.ends_with("at_ns   5  ns\n"), "{said:?}");
}

#[test]
fn wrong_commands_and_messages_change_nothing_and_say_what_would_be_right() {
    let mut node = Node::new("call-wrong");
    let cases = [
        (&["call", "base", "enabel", "1"][..], 2, "did you mean \"enable\"?"),
        (&["call", "base", "enable"], 2, "sinew call /drivers/base enable '{\"on\":0}'"),
        (&["call", "base", "enable", "{\"of\": 1}"], 2, "known: on"),
        (&["call", "base", "enable", "often"], 2, "an integer from 0"),
        (&["call", "base", "ping", "1"], 2, "takes no message"),
        (&["call", "bose"], 3, "did you mean /drivers/base?"),
        (&["call", "base", "enable", "1", "--timeout", "soon"], 2, "is no time"),
    ];
    for (arguments, code, words) in cases {
        let said = node.place.sinew(arguments);
        assert_eq!((said.code, said.out.as_str()), (Some(code), ""), "{arguments:?} {said:?}");
        assert!(said.err.contains(words), "{arguments:?} {said:?}");
    }
    assert!(node.switch.take().is_none());
}

#[test]
fn a_refusal_gives_the_nodes_reason_and_a_silent_node_is_not_waited_for() {
    let mut node = Node::new("call-refused");
    let said = node.during(&["call", "base", "enable", "1"], |node| {
        if let Some(request) = node.switch.take() {
            node.switch.refuse(request, "the emergency stop is pressed");
        }
    });
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("the emergency stop is pressed"), "{said:?}");
    let said = node.place.sinew(&["call", "base", "enable", "1", "--timeout", "50ms"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("not answered in time"), "{said:?}");
}

#[test]
fn every_node_answers_ping() {
    let node = Node::new("call-ping");
    let said = node.place.sinew(&["call", "base", "ping", "--json"]);
    assert_eq!(said.json()[0]["answer"]["pid"].as_u64(), Some(u64::from(std::process::id())), "{said:?}");
}
