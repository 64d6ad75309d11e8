//! The worlds of a folder, and what counts as having crossed one.
//!
//! Two kinds of folder: `grids.txt` and `worlds.csv` (BARN), or `worlds.txt` (DynaBARN). Start, goal, limits and score
//! are the benchmark's own.

use crate::exit::{CHECK, Failure, USAGE};
use simulator::geometry::{Point, Pose};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};

/// Speed of the ideal crossing by which a run is scored [m/s].
const IDEAL_M_S: f64 = 2.0;
/// A run's time counts as no less and no more than these multiples of the ideal one.
const CLIP: (f64, f64) = (2.0, 8.0);
/// Within this of the goal the world is crossed [m].
pub const ARRIVED_M: f64 = 1.0;
/// The clock begins after this much motion [m].
pub const CLOCK_FROM_M: f64 = 0.1;
/// Time to cross a world in [s].
pub const LIMIT_S: f64 = 100.0;
/// Scored length of every DynaBARN world: from start to goal. The challenge's own runner takes goal.x − start.x, which is
/// −31 by a mistake of signs [m].
const DYNAMIC_PATH_M: f64 = 20.0;

const LAYOUT: &str =
    "Give a folder laid out as BARN's (grids.txt, worlds.csv), or with --dynamic as DynaBARN's (worlds.txt).";

/// Which of the two benchmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Cylinders that stand.
    Barn,
    /// Cylinders that move.
    DynaBarn,
}

/// One world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Its number.
    pub index: u32,
    /// Length that its score is worked out from [m].
    pub path_m: f64,
}

/// The worlds of a folder.
#[derive(Debug, Clone)]
pub struct Suite {
    /// Which benchmark.
    pub kind: Kind,
    /// The file that holds the worlds.
    pub file: PathBuf,
    /// The worlds, by number.
    pub courses: Vec<Course>,
}

impl Suite {
    /// Reads the folder; `dynamic` asks for DynaBARN.
    pub fn read(folder: &Path, dynamic: bool) -> Result<Suite, Failure> {
        let kind = if dynamic { Kind::DynaBarn } else { Kind::Barn };
        let (grids, table, moving) = (folder.join("grids.txt"), folder.join("worlds.csv"), folder.join("worlds.txt"));
        let fault = |text: String| Err(Failure::new(USAGE, text));
        let name = folder.display();
        if !folder.is_dir() {
            let what = if folder.exists() { "is no folder" } else { "does not exist" };
            return fault(format!("--data {name}: {what}\n{LAYOUT}"));
        }
        let (needed, other) = if dynamic { (&moving, &grids) } else { (&grids, &moving) };
        if !needed.exists() && other.exists() {
            let (holds, todo) = if dynamic { ("BARN", "leave --dynamic out") } else { ("DynaBARN", "add --dynamic") };
            return fault(format!("{name} holds {holds} worlds: {todo}"));
        }
        let files: &[&Path] = if dynamic { &[&moving] } else { &[&grids, &table] };
        if let Some(missing) = files.iter().find(|file| !file.is_file()) {
            return fault(format!("there is no file {}\n{LAYOUT}", missing.display()));
        }
        let (file, courses) = match kind {
            Kind::Barn => (grids, barn_courses(&table)?),
            Kind::DynaBarn => (moving.clone(), dynamic_courses(&moving)?),
        };
        if courses.is_empty() {
            return Err(Failure::new(CHECK, format!("{} lists no world", file.display())));
        }
        // The file is named in the robot's configuration, whatever folder that is relative to.
        let file = std::path::absolute(&file)?;
        Ok(Suite { kind, file, courses })
    }

    /// Where the robot starts.
    pub fn start(&self) -> Pose {
        match self.kind {
            Kind::Barn => Pose::new(-2.25, 3.0, FRAC_PI_2),
            Kind::DynaBarn => Pose::new(11.0, 0.0, PI),
        }
    }

    /// Where it is to get to.
    pub fn goal(&self) -> Point {
        match self.kind {
            Kind::Barn => Point::new(-2.25, 13.0),
            Kind::DynaBarn => Point::new(-9.0, 0.0),
        }
    }

    /// The difficulty that DynaBARN gives a world.
    pub fn class(&self, index: u32) -> Option<&'static str> {
        (self.kind == Kind::DynaBarn).then_some(match index {
            0..=19 => "easy",
            20..=39 => "medium",
            _ => "hard",
        })
    }
}

/// The score of a world crossed in `time_s`.
pub fn score(path_m: f64, time_s: f64) -> f64 {
    let ideal_s = path_m / IDEAL_M_S;
    ideal_s / time_s.clamp(CLIP.0 * ideal_s, CLIP.1 * ideal_s)
}

fn read(file: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(file)
        .map_err(|e| Failure::new(USAGE, format!("cannot read {}: {e}\n{LAYOUT}", file.display())))
}

fn barn_courses(table: &Path) -> Result<Vec<Course>, Failure> {
    let text = read(table)?;
    let mut lines = text.lines().enumerate();
    let fault = |row: usize, what: &str| Failure::new(CHECK, format!("{}, line {}: {what}", table.display(), row + 1));
    let header: Vec<&str> = lines.next().map(|(_, line)| line.split(',').map(str::trim).collect()).unwrap_or_default();
    let column = |name: &str| {
        header
            .iter()
            .position(|known| *known == name)
            .ok_or_else(|| fault(0, &format!("there is no column \"{name}\"")))
    };
    let (world, path) = (column("world")?, column("path_len_m")?);
    let mut courses = Vec::new();
    for (row, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let index = cells.get(world).and_then(|cell| cell.parse().ok());
        let path_m = cells.get(path).and_then(|cell| cell.parse().ok()).filter(|m: &f64| *m > 0.0 && m.is_finite());
        let (Some(index), Some(path_m)) = (index, path_m) else {
            return Err(fault(row, "world and path_len_m must be numbers"));
        };
        courses.push(Course { index, path_m });
    }
    courses.sort_by_key(|course| course.index);
    Ok(courses)
}

fn dynamic_courses(file: &Path) -> Result<Vec<Course>, Failure> {
    let mut courses: Vec<Course> = read(file)?
        .lines()
        .filter_map(|line| line.strip_prefix("world ")?.split_whitespace().next()?.parse().ok())
        .map(|index| Course { index, path_m: DYNAMIC_PATH_M })
        .collect();
    courses.sort_by_key(|course| course.index);
    Ok(courses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_scores_half_at_the_path_s_length_in_seconds_and_no_less_than_an_eighth_when_it_arrives() {
        assert_eq!(score(12.0, 3.0), 0.5);
        assert_eq!(score(12.0, 12.0), 0.5);
        assert_eq!(score(12.0, 24.0), 0.25);
        assert_eq!(score(12.0, 99.0), 0.125);
    }

    #[test]
    fn a_table_s_columns_are_found_by_name_and_its_faults_are_told_with_their_line() {
        let folder = std::env::temp_dir().join(format!("sinew-barn-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("worlds.csv");
        std::fs::write(&file, "path_len_m,world\n12.5,3\n11.0,1\n").unwrap();
        let courses = barn_courses(&file).unwrap();
        assert_eq!(courses, [Course { index: 1, path_m: 11.0 }, Course { index: 3, path_m: 12.5 }]);
        std::fs::write(&file, "path_len_m,world\n12.5,3\nnan,1\n").unwrap();
        assert!(barn_courses(&file).unwrap_err().message.contains("line 3"));
        std::fs::write(&file, "world\n1\n").unwrap();
        assert!(barn_courses(&file).unwrap_err().message.contains("path_len_m"));
        assert!(Suite::read(&folder, true).unwrap_err().message.contains("worlds.txt"));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_folder_that_is_missing_or_half_there_is_told_from_the_wrong_kind() {
        let folder = tempfile::tempdir().unwrap();
        let told = |folder: &Path, dynamic| Suite::read(folder, dynamic).unwrap_err().message;
        assert!(told(&folder.path().join("nowhere"), false).contains("does not exist"));
        assert!(
            told(folder.path(), false).contains("there is no file") && told(folder.path(), true).contains("worlds.txt")
        );
        std::fs::write(folder.path().join("worlds.csv"), "world,path_len_m\n1,11.0\n").unwrap();
        assert!(told(folder.path(), false).contains("grids.txt"));
        std::fs::write(folder.path().join("grids.txt"), "").unwrap();
        assert!(told(folder.path(), true).contains("leave --dynamic out"));
        assert!(told(&folder.path().join("grids.txt"), false).contains("is no folder"));
    }
}
