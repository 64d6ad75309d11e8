//! Stage's `.world` files: the subset of which its cave, simple and hospital examples are made.
//!
//! | word | here |
//! |---|---|
//! | `include "FILE"`, `define NAME BASE ( ... )` | obeyed; what is defined may be based on what is defined |
//! | `model` with `bitmap`, `block`s or `size` alone, `pose`, `origin`, `boundary` | walls and solids |
//! | `position` (robots) with `pose` | a start each, in order |
//! | `unit_length`, `unit_angle` | obeyed |
//! | `window`, colours, names, `resolution`, `interval_sim` and the like | nothing: they change no physics here |
//! | a robot's shape, drive, `ranger`s, `laser`s, `ctrl` | the robot file's part: noted |
//! | anything else | noted with its place |
//!
//! A pose is `[x y heading]` or `[x y z heading]`, a size `[x y]` or `[x y z]`, headings in degrees. In a bitmap a pixel
//! is an obstacle where its shade is at most 127; the box around all obstacles is stretched to the model's size (not the
//! picture's own box). `boundary 1` adds walls around that box. Source: the manual and example worlds of Stage 2 to 4.

mod known;
mod shape;
#[cfg(test)]
mod tests;
mod words;

use super::build::Loader;
use super::error::WorldError;
use super::{Sketch, Start};
use crate::geometry::{Point, Pose};
use std::f64::consts::PI;
use words::{Entry, Place, Value, Words};

/// Things within things at most, and definitions based on one another.
const DEPTH: usize = 16;
/// Size of a thing that has none [m].
const SIZE_M: f64 = 0.1;

/// Adds all that the world file holds.
pub(super) fn add(sketch: &mut Sketch, file: &str, bytes: &[u8], load: &mut Loader) -> Result<(), WorldError> {
    let words = words::read(file, bytes, load)?;
    let mut stage = Stage { words: &words, file, load, sketch, unit_m: 1.0, unit_rad: PI / 180.0 };
    stage.units()?;
    for entry in &words.entries {
        match entry {
            Entry::Property { word, value, place } => match word.as_str() {
                "name" => {
                    if let Value::Text(name) = value {
                        stage.sketch.name = name.clone();
                    }
                }
                "unit_length" | "unit_angle" => {}
                word if known::is_harmless_in_the_world(word) => {}
                word => stage.note(place, &format!("`{word}` is not understood and left out")),
            },
            Entry::Thing { kind, body, place } => stage.thing(kind, body, place, &Pose::default(), 0)?,
        }
    }
    Ok(())
}

/// A world while it is read.
struct Stage<'a, 'b> {
    words: &'a Words,
    file: &'a str,
    load: &'a mut Loader<'b>,
    sketch: &'a mut Sketch,
    unit_m: f64,
    unit_rad: f64,
}

/// What a thing says of itself, the definitions that it is based on included.
struct Said<'a> {
    /// What it is in the end.
    base: &'a str,
    properties: Vec<(&'a str, &'a Value, &'a Place)>,
    things: Vec<(&'a str, &'a [Entry], &'a Place)>,
}

impl<'a> Said<'a> {
    /// The value that was given last.
    fn last(&self, word: &str) -> Option<(&'a Value, &'a Place)> {
        self.properties.iter().rev().find(|(own, ..)| *own == word).map(|(_, value, place)| (*value, *place))
    }
}

impl<'a> Stage<'a, '_> {
    fn units(&mut self) -> Result<(), WorldError> {
        for entry in &self.words.entries {
            let Entry::Property { word, value, place } = entry else { continue };
            let text = if let Value::Text(text) = value { text.as_str() } else { "" };
            match (word.as_str(), text) {
                ("unit_length", "m") | ("unit_angle", "degrees") => {}
                ("unit_length", "cm") => self.unit_m = 0.01,
                ("unit_length", "mm") => self.unit_m = 0.001,
                ("unit_angle", "radians") => self.unit_rad = 1.0,
                ("unit_length", _) => {
                    return Err(place.fault("no such unit of length", "write \"m\", \"cm\" or \"mm\""));
                }
                ("unit_angle", _) => {
                    return Err(place.fault("no such unit of angle", "write \"degrees\" or \"radians\""));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Says once what is left out.
    fn note(&mut self, place: &Place, what: &str) {
        let note = place.note(what);
        if !self.sketch.notes.contains(&note) {
            self.sketch.notes.push(note);
        }
    }

    /// What a thing of this kind says, with the definitions behind it.
    fn said(&self, kind: &'a str, body: &'a [Entry], place: &Place) -> Result<Said<'a>, WorldError> {
        let words: &'a Words = self.words;
        let (mut base, mut bodies) = (kind, vec![body]);
        // The first definition of a name counts, and one may be based on a kind of its own name.
        while let Some((_, next, more)) = words.defined.iter().find(|(name, ..)| name == base) {
            bodies.push(more);
            if bodies.len() > DEPTH {
                return Err(place.fault(format!("`{kind}` is based on itself"), "break the circle of definitions"));
            }
            if next == base {
                break;
            }
            base = next;
        }
        let mut said = Said { base, properties: Vec::new(), things: Vec::new() };
        for entry in bodies.into_iter().rev().flatten() {
            match entry {
                Entry::Property { word, value, place } => said.properties.push((word, value, place)),
                Entry::Thing { kind, body, place } => said.things.push((kind, body, place)),
            }
        }
        Ok(said)
    }

    fn thing(
        &mut self,
        kind: &'a str,
        body: &'a [Entry],
        place: &'a Place,
        carrier: &Pose,
        depth: usize,
    ) -> Result<(), WorldError> {
        if depth > DEPTH {
            return Err(place.fault(format!("things are {DEPTH} deep in one another"), "put them side by side"));
        }
        if known::DISPLAY.contains(&kind) {
            return Ok(());
        }
        let said = self.said(kind, body, place)?;
        if known::STANDING.contains(&said.base) {
            self.standing(&said, place, carrier, depth)
        } else if known::DRIVING.contains(&said.base) {
            self.driving(&said, carrier)
        } else if known::CARRIED.contains(&said.base) {
            self.note(place, &format!("`{kind}` stands alone: sensors are the robot file's, it is left out"));
            Ok(())
        } else {
            self.note(place, &format!("`{kind}` is no kind of thing that is known here: it is left out"));
            Ok(())
        }
    }

    /// A thing that stands still.
    fn standing(&mut self, said: &Said<'a>, place: &'a Place, carrier: &Pose, depth: usize) -> Result<(), WorldError> {
        let own = self.pose(said, "pose")?;
        let pose = Pose {
            x_m: carrier.world_from_body(own.place()).x_m,
            y_m: carrier.world_from_body(own.place()).y_m,
            heading_rad: runtime::math::wrap_angle(carrier.heading_rad + own.heading_rad),
        };
        for (word, value, place) in &said.properties {
            match *word {
                "pose" | "size" | "origin" | "bitmap" | "boundary" | "obstacle_return" | "blocks" => {}
                "laser_return" | "ranger_return" if **value == Value::Number(0.0) => {
                    self.note(place, &format!("`{word} 0`: sensors do not see this thing in Stage; here all see it"));
                }
                "laser_return" | "ranger_return" => {}
                "ctrl" => self.note(place, "`ctrl`: controllers are not run, the thing stands still"),
                word if known::is_harmless(word) || shape::is_its_word(word) => {}
                word => self.note(place, &format!("`{word}` is not understood and left out")),
            }
        }
        if said.last("obstacle_return").is_some_and(|(value, _)| *value == Value::Number(0.0)) {
            self.note(
                place,
                "`obstacle_return 0`: it hinders nobody in Stage; here it is left out, sensors do not see it",
            );
        } else {
            self.shape(said, &pose, place)?;
        }
        for (kind, body, place) in &said.things {
            if *kind != "block" {
                self.thing(kind, body, place, &pose, depth + 1)?;
            }
        }
        Ok(())
    }

    /// A robot: a place to start.
    fn driving(&mut self, said: &Said<'a>, carrier: &Pose) -> Result<(), WorldError> {
        let own = self.pose(said, "pose")?;
        let at = carrier.world_from_body(own.place());
        let heading_rad = runtime::math::wrap_angle(carrier.heading_rad + own.heading_rad);
        let pose = Pose::new(at.x_m, at.y_m, heading_rad);
        self.sketch.starts.push(Start { pose, spread_m: 0.0, spread_rad: 0.0 });
        for (word, value, place) in &said.properties {
            match *word {
                "pose" => {}
                "ctrl" => self.note(place, "`ctrl`: controllers are nodes here, the robot file names them"),
                "drive" if **value != Value::Text("diff".into()) => {
                    self.note(place, "`drive`: the robot file's model drives differentially here");
                }
                word if known::is_harmless(word) || known::is_the_robot_files(word) => {}
                word => self.note(place, &format!("`{word}` of a robot is not taken over: the robot file decides")),
            }
        }
        for (kind, body, place) in &said.things {
            if *kind == "block" {
                continue;
            }
            let carried = self.said(kind, body, place)?;
            if known::CARRIED.contains(&carried.base) {
                self.note(place, &format!("`{kind}` of a robot is not taken over: the robot file decides on sensors"));
            } else {
                self.note(place, &format!("`{kind}` on a robot is not understood and left out"));
            }
        }
        Ok(())
    }

    /// A pose of two, three or four numbers; the origin when it is not given.
    fn pose(&self, said: &Said, word: &str) -> Result<Pose, WorldError> {
        let Some((value, place)) = said.last(word) else { return Ok(Pose::default()) };
        let numbers = match value {
            Value::List(numbers) => numbers.as_slice(),
            _ => &[],
        };
        let (x, y, heading) = match numbers {
            [x, y] => (*x, *y, 0.0),
            [x, y, heading] => (*x, *y, *heading),
            // Some of the examples have a fifth number, which nothing reads.
            [x, y, _, heading] | [x, y, _, heading, _] => (*x, *y, *heading),
            _ => {
                let reason = format!("`{word}` needs three or four numbers");
                return Err(place.fault(reason, "write [x y heading] or [x y z heading]"));
            }
        };
        Ok(Pose::new(x * self.unit_m, y * self.unit_m, runtime::math::wrap_angle(heading * self.unit_rad)))
    }

    /// Width and depth [m].
    fn size(&self, said: &Said) -> Result<Point, WorldError> {
        let Some((value, place)) = said.last("size") else { return Ok(Point::new(SIZE_M, SIZE_M)) };
        match value {
            Value::List(numbers) if (2..=3).contains(&numbers.len()) && numbers[0] > 0.0 && numbers[1] > 0.0 => {
                Ok(Point::new(numbers[0], numbers[1]) * self.unit_m)
            }
            _ => {
                Err(place
                    .fault("`size` needs two or three lengths, the first two above zero", "write [x y] or [x y z]"))
            }
        }
    }
}
