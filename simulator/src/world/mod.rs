//! Worlds: what stands still, who walks about, where robots start.
//!
//! A world comes from a TOML file (its words are in [`file`]), from a map_server YAML with its picture, from a BARN grids
//! file or a DynaBARN worlds file (`grids.txt#17` chooses world 17), or from a Stage world file (see `stage`).

mod barn;
mod bitmap;
mod build;
mod crowd;
mod dynabarn;
mod error;
mod file;
mod grid;
mod image;
mod made;
mod map;
mod person;
mod rays;
mod stage;
mod sweep;
#[cfg(test)]
mod tests;

pub use error::WorldError;
pub use map::{Map, Nearest, Post, Wall};
pub use person::{Course, Person, Social, Walk};
pub(crate) use sweep::View;

use crate::geometry::{Circle, Point, Pose, Segment};

/// No world reaches farther from its origin [m].
const FARTHEST_M: f64 = 10_000.0;

/// Where a robot may start.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Start {
    /// The pose.
    pub pose: Pose,
    /// Greatest deviation along x and y, drawn from the seed [m].
    pub spread_m: f64,
    /// Greatest deviation of the heading, drawn from the seed [rad].
    pub spread_rad: f64,
}

/// A closed outline with a solid inside. Its sides are among the map's walls; it is kept for drawing and to tell
/// inside from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Its corners in order.
    pub outline: Vec<Point>,
}

/// A whole world. It never changes while it is simulated; what moves in it is the simulation's.
#[derive(Debug, Clone, Default)]
pub struct World {
    /// For people.
    pub name: String,
    /// What stands still.
    pub map: Map,
    /// Insides of obstacles.
    pub solids: Vec<Solid>,
    /// Who walks about.
    pub persons: Vec<Person>,
    /// Where robots start, in order.
    pub starts: Vec<Start>,
    /// What the file says and nothing here obeys, with its place.
    pub notes: Vec<String>,
}

/// A world while it is being read.
#[derive(Debug, Default)]
struct Sketch {
    name: String,
    walls: Vec<Wall>,
    posts: Vec<Post>,
    solids: Vec<Solid>,
    persons: Vec<Person>,
    starts: Vec<Start>,
    notes: Vec<String>,
    crowds: Vec<crowd::Crowd>,
}

impl World {
    /// Reads the world `name` with everything that it names. `load` answers a file's bytes, or why there are none.
    pub fn load(name: &str, load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>) -> Result<World, WorldError> {
        let (file, choice) = match name.rsplit_once('#') {
            Some((file, choice)) => (file, Some(choice)),
            None => (name, None),
        };
        if let Some(made) = made::world(name) {
            return Ok(made?.finish());
        }
        let bytes = load(file)
            .map_err(|why| WorldError::of_file(file, format!("cannot be read: {why}"), "correct the name"))?;
        let mut sketch = Sketch::default();
        match file.rsplit_once('.').map(|(_, ending)| ending) {
            Some("toml") => {
                let text = std::str::from_utf8(&bytes)
                    .map_err(|_| WorldError::of_file(file, "it is not UTF-8 text", "save it as UTF-8"))?;
                sketch = build::from_toml(file, text, load)?;
            }
            Some("yaml" | "yml") => bitmap::add(&mut sketch, file, &bytes, false, load)?,
            Some("txt") => {
                let wanted = choice.map(str::parse).transpose().map_err(|_| {
                    WorldError::of_file(name, "what follows # is no number", "write for example grids.txt#1")
                })?;
                match dynabarn::is_one(&bytes) {
                    true => dynabarn::add(&mut sketch, file, &bytes, wanted)?,
                    false => barn::add(&mut sketch, file, &bytes, wanted)?,
                }
            }
            Some("world") => stage::add(&mut sketch, file, &bytes, load)?,
            _ => {
                let remedy =
                    "give a world (.toml), a map_server map (.yaml), a BARN grid (.txt) or a Stage world (.world)";
                return Err(WorldError::of_file(file, "this kind of file describes no world", remedy));
            }
        }
        if sketch.name.is_empty() {
            sketch.name = file.rsplit('/').next().unwrap_or(file).to_owned();
        }
        if sketch.reach_m() > FARTHEST_M {
            let reason = format!("something lies farther than {} km from the origin", FARTHEST_M / 1000.0);
            return Err(WorldError::of_file(file, reason, "lengths are in metres: check for millimetres or pixels"));
        }
        Ok(sketch.finish())
    }

    /// A world of these obstacles alone.
    pub fn of(walls: &[Wall], posts: &[Post]) -> World {
        World { map: Map::new(walls, posts), ..World::default() }
    }

    /// Whether `point` lies inside an obstacle.
    pub fn is_solid(&self, point: Point) -> bool {
        self.map.circles().iter().any(|circle| circle.contains(point))
            || self.solids.iter().any(|solid| solid.contains(point))
    }
}

impl Sketch {
    fn add_line(&mut self, segment: Segment, rough: bool) {
        self.walls.push(Wall { segment, rough });
    }

    fn add_post(&mut self, circle: Circle, rough: bool) {
        self.posts.push(Post { circle, rough });
    }

    fn add_solid(&mut self, solid: Solid, rough: bool) {
        let corners = &solid.outline;
        for (k, corner) in corners.iter().enumerate() {
            self.walls.push(Wall { segment: Segment::new(*corner, corners[(k + 1) % corners.len()]), rough });
        }
        self.solids.push(solid);
    }

    /// A straight wall of that thickness about its middle line; a bare line when it has none.
    fn add_slab(&mut self, middle: Segment, thickness_m: f64, rough: bool) {
        if thickness_m == 0.0 {
            return self.add_line(middle, rough);
        }
        let along = middle.b - middle.a;
        let aside = along.left() * (0.5 * thickness_m / along.norm());
        let outline = vec![middle.a - aside, middle.b - aside, middle.b + aside, middle.a + aside];
        self.add_solid(Solid { outline }, rough);
    }

    /// How far from the origin anything lies, along x or y [m].
    fn reach_m(&self) -> f64 {
        let ends = self.walls.iter().flat_map(|wall| [(wall.segment.a, 0.0), (wall.segment.b, 0.0)]);
        let discs = self.posts.iter().map(|post| (post.circle.centre, post.circle.radius_m));
        ends.chain(discs).map(|(point, more)| point.x_m.abs().max(point.y_m.abs()) + more).fold(0.0, f64::max)
    }

    /// Builds the index once everything has been added.
    fn finish(self) -> World {
        let Sketch { name, walls, posts, solids, persons, starts, notes, crowds } = self;
        let mut world = World { name, map: Map::new(&walls, &posts), solids, persons, starts, notes };
        for crowd in &crowds {
            let found = crowd::draw(&world, crowd);
            if found.len() < crowd.count {
                let note =
                    format!("{}: of {} people only {} found a way to walk", world.name, crowd.count, found.len());
                world.notes.push(note);
            }
            world.persons.extend(found);
        }
        world
    }
}

impl Solid {
    /// Whether `point` lies inside (crossing number).
    pub fn contains(&self, point: Point) -> bool {
        let corners = &self.outline;
        let mut inside = false;
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            if (a.y_m > point.y_m) != (b.y_m > point.y_m) {
                let x_m = a.x_m + (point.y_m - a.y_m) / (b.y_m - a.y_m) * (b.x_m - a.x_m);
                inside ^= point.x_m < x_m;
            }
        }
        inside
    }
}
