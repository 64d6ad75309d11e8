//! `sinew drive`, from the key on a terminal to the proposal in the ring.

use crate::place::{Channel, Place};
use crate::terminal::{Keys, Terminal};
use messages::{Odometry, Proposal, bytemuck};
use runtime::channel::{RawReader, SampleBuffer, Tree};
use runtime::clock;
use runtime::robot::{Resources, Robot};
use sinew::built_in::{PIONEER, node_types};
use sinew::launch::Launch;

const PROPOSAL: &str = "/actions/teleop/proposal";

/// A robot that only seems to run: its launch is written down, and its odometry goes on.
struct Seeming {
    place: Place,
    tree: Tree,
    odometry: Channel,
}

impl Seeming {
    fn new(name: &str) -> Seeming {
        let place = Place::new(name);
        let text = std::str::from_utf8(PIONEER[0].1).unwrap();
        let robot = Robot::parse(text, "robot.toml", Resources::Embedded(PIONEER), &node_types(&[])).unwrap();
        let tree = place.tree("pioneer");
        let odometry = Channel::make::<Odometry>(&tree, "/perception/odometry/pose", 8, 0);
        Launch::new(&robot, 1).write(&place.root.join("pioneer")).map_err(|e| e.message).unwrap();
        Seeming { place, tree, odometry }
    }

    fn drive(&self, keys: Keys) -> Terminal {
        let mut command = self.place.command(&["drive"]);
        command.env_remove("NO_COLOR");
        Terminal::run(command, keys)
    }

    /// Goes on until `done`, for ten seconds at most; `each` is done in every turn.
    fn until(
        &mut self,
        terminal: &mut Terminal,
        answer: bool,
        what: &str,
        mut done: impl FnMut(&Tree, &Terminal) -> bool,
    ) {
        let end = clock::now().after_s(10.0);
        while !done(&self.tree, terminal) {
            assert!(clock::now() < end, "{what} did not come about; the screen says\n{}", terminal.screen);
            self.odometry.write(clock::now().nanos(), &Odometry::default(), &[]);
            terminal.serve(answer);
        }
    }
}

/// The newest proposal.
fn proposal(tree: &Tree) -> Option<Proposal> {
    let ring: RawReader = tree.reader(PROPOSAL, None).ok()?;
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).ok()?;
    Some(bytemuck::pod_read_unaligned(buffer.fixed()))
}

fn forward(tree: &Tree) -> Option<f64> {
    proposal(tree).map(|proposal| proposal.forward.value)
}

#[test]
fn a_terminal_that_goes_away_ends_the_drive_and_its_words_to_the_robot() {
    let mut seeming = Seeming::new("drive-gone");
    let mut terminal = seeming.drive(Keys::Plain);
    seeming.until(&mut terminal, true, "a first picture", |_, terminal| terminal.screen.contains("speed"));
    terminal.hang_up();
    seeming.until(&mut terminal, false, "the end of the ring", |tree, _| proposal(tree).is_none());
    let end = clock::now().after_s(10.0);
    while terminal.child.try_wait().unwrap().is_none() {
        assert!(clock::now() < end, "it goes on without a terminal");
        clock::sleep_s(0.01);
    }
}

#[test]
fn a_key_drives_while_it_repeats_and_the_robot_stands_when_repeats_end() {
    let mut robot = Seeming::new("drive-repeats");
    let mut terminal = robot.drive(Keys::Plain);
    robot.until(&mut terminal, true, "a proposal to stand", |tree, _| forward(tree) == Some(0.0));
    robot.until(&mut terminal, true, "the screen", |_, terminal| terminal.screen.contains("repeat ends"));
    robot.until(&mut terminal, true, "driving", |tree, terminal| {
        terminal.press("w");
        forward(tree) == Some(0.3)
    });
    assert_eq!(proposal(&robot.tree).map(|p| (p.urgency, p.turn.value)), Some((1.0, 0.0)));
    robot.until(&mut terminal, true, "standing after the last repeat", |tree, _| forward(tree) == Some(0.0));
    terminal.press("q");
    robot.until(&mut terminal, true, "the end of the ring", |tree, _| proposal(tree).is_none());
    assert_eq!(terminal.child.wait().unwrap().code(), Some(0));
}

#[test]
fn a_terminal_that_tells_of_releases_is_believed_while_it_answers() {
    let mut robot = Seeming::new("drive-releases");
    let mut terminal = robot.drive(Keys::Kitty);
    robot.until(&mut terminal, true, "the screen", |_, terminal| terminal.screen.contains("reports releases"));
    // Pressed once, no repeat follows: it is held for longer than any dead man would allow. Where this machine stalls
    // for as long, the robot rightly stops; then once more.
    let mut held = false;
    for _ in 0..8 {
        terminal.press("\x1b[119;1:1u");
        robot.until(&mut terminal, true, "driving", |tree, _| forward(tree) == Some(0.3));
        let since = clock::now();
        robot.until(&mut terminal, true, "a second of driving", |tree, _| {
            held = clock::now().since(since) > 1.0;
            held || forward(tree) != Some(0.3)
        });
        if held {
            break;
        }
        terminal.press("\x1b[119;1:3u");
    }
    assert!(held, "the robot stopped although the key was held and the terminal answered");
    terminal.press("\x1b[119;1:3u");
    robot.until(&mut terminal, true, "standing after the release", |tree, _| forward(tree) == Some(0.0));
    // The key is held again, and then the connection breaks: nothing is answered any more.
    terminal.press("\x1b[119;1:1u");
    robot.until(&mut terminal, true, "driving again", |tree, _| forward(tree) == Some(0.3));
    robot.until(&mut terminal, false, "standing when the terminal fell silent", |tree, _| forward(tree) == Some(0.0));
}

#[test]
fn a_second_driver_is_refused() {
    let mut robot = Seeming::new("drive-second");
    let mut first = robot.drive(Keys::Plain);
    robot.until(&mut first, true, "a proposal to stand", |tree, _| forward(tree) == Some(0.0));
    let mut second = robot.drive(Keys::Plain);
    robot.until(&mut second, true, "the refusal", |_, terminal| terminal.screen.contains("drives this robot already"));
    assert_eq!(second.child.wait().unwrap().code(), Some(1));
}
