//! `sinew goto`, with the test as the node that drives.

use crate::place::{Channel, Place, Said};
use messages::{Done, GotoGoal, GotoProgress, GotoResult, Odometry};
use runtime::calls::{CallPort, Order, OrderPort};
use runtime::pump::{Pump, PumpBuilder};

struct Driver {
    place: Place,
    goals: OrderPort<GotoGoal, GotoProgress, GotoResult>,
    sends: CallPort<GotoGoal, Done>,
    _pump: Pump,
    _channel: Channel,
}

impl Driver {
    fn new(name: &str) -> Driver {
        let place = Place::new(name);
        let channel = Channel::make::<Odometry>(&place.tree("service"), "/perception/odometry/pose", 8, 0);
        let (goals, sends) = (OrderPort::detached("goto"), CallPort::detached("send"));
        let mut builder = PumpBuilder::new("/actions/goto");
        builder.attach(&goals);
        builder.attach(&sends);
        let pump = builder.spawn(&place.root.join("service")).unwrap();
        Driver { place, goals, sends, _pump: pump, _channel: channel }
    }

    fn during(&mut self, arguments: &[&str], mut each: impl FnMut(&mut Driver)) -> Said {
        Said::during(self.place.start(arguments), || each(self))
    }
}

type Held = Option<Order<GotoGoal, GotoProgress, GotoResult>>;

#[test]
fn a_goal_in_degrees_is_waited_for_with_its_progress_and_its_result() {
    let mut driver = Driver::new("goto-wait");
    let mut heard = Vec::new();
    let mut held: Held = None;
    let said = driver.during(&["goto", "2", "-1.5", "90", "--json"], |driver| match held.take() {
        None => {
            if let Some(mut order) = driver.goals.take() {
                heard.push(order.message);
                order.accept();
                order.progress(&GotoProgress { distance_m: 0.5, state: 1, ..GotoProgress::default() });
                held = Some(order);
            }
        }
        Some(order) => order.done(&GotoResult { x_m: 2.0, y_m: -1.5, distance_m: 0.01, ..GotoResult::default() }),
    });
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!((heard[0].x_m, heard[0].y_m, heard[0].tolerance_m), (2.0, -1.5, 0.0));
    assert!((heard[0].heading_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    let last = said.json().pop().unwrap();
    assert_eq!(last["result"]["distance_m"], 0.01, "{said:?}");
}

#[test]
fn without_a_heading_any_will_do_and_no_wait_returns_at_once() {
    let mut driver = Driver::new("goto-send");
    let mut heard = Vec::new();
    let said = driver.during(&["goto", "2", "1", "--tolerance", "0.1", "--no-wait"], |driver| {
        if let Some(request) = driver.sends.take() {
            heard.push(request.message);
            driver.sends.answer(request, &Done { at_ns: 1 });
        }
    });
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.starts_with("under way"), "{said:?}");
    assert!(heard[0].heading_rad.is_nan() && heard[0].tolerance_m == 0.1);
}

#[test]
fn a_goal_that_cannot_be_is_refused_with_the_reason() {
    let mut driver = Driver::new("goto-refused");
    let said = driver.during(&["goto", "99", "0"], |driver| {
        if let Some(order) = driver.goals.take() {
            order.refuse("the goal is off the map");
        }
    });
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("off the map"), "{said:?}");
    for arguments in [&["goto", "nan", "0"][..], &["goto", "0", "0", "inf"], &["goto", "0"], &["goto", "here", "0"]] {
        let said = driver.place.sinew(arguments);
        assert_eq!((said.code, said.out.as_str()), (Some(2), ""), "{arguments:?} {said:?}");
    }
    assert!(driver.goals.take().is_none());
}
