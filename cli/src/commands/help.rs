//! Help texts: commands by purpose, and an example for each.

use super::CommandLine;
use clap::CommandFactory;
use std::fmt::Write;

/// Every command under what it is for. A test holds this list to the commands that there are.
const GROUPS: [(&str, &[&str]); 5] = [
    (
        "Run a robot",
        &[
            "run", "drive", "goto", "mode", "down", "estop", "reset", "resume", "start", "stop", "restart", "clear",
            "replace", "set", "wire", "spawn", "simulate", "shrink", "compare", "barn",
        ],
    ),
    ("Look at a running robot", &["top", "incidents", "ls", "cat", "hz", "logs", "call"]),
    ("Record, and see again", &["record", "info", "play", "replay", "recover", "live"]),
    ("Look at a robot file", &["check", "graph", "schema"]),
    ("Look at this machine", &["doctor", "bench", "experiments", "chaos"]),
];

const BOLD: &str = "\x1b[1m";
const DIM: &str = "\x1b[2m";
const PLAIN: &str = "\x1b[0m";

const EXIT_CODES: &str = "  0  done
  1  it did not work; the message says why
  2  the arguments make no sense
  3  no such robot is running, or its node or channel is not there
  4  a check failed: errors in a robot file, a contact that the robot caused, an ailment of the machine";

const FIRST_STEPS: &str = "  sinew run                             the built-in Pioneer wanders through its office
  sinew cat /drivers/base/sonar --once  one sample of its sonars, from another terminal
  sinew simulate --seeds 0..20          twenty simulated runs, much faster than real time";

const ENVIRONMENT: &str = "  SINEW_SHM    folder of the robots' channels    (/dev/shm/sinew)
  SINEW_STATE  folder of logs                    (~/.local/state/sinew)
  NO_COLOR     no colours; CLICOLOR_FORCE insists on them";

/// The command line with its grouped overview.
pub fn command_line() -> clap::Command {
    let mut command = CommandLine::command();
    // Fills in what derive leaves for the first parse.
    command.build();
    let mut text = String::from("{about}\n\nUsage: sinew <COMMAND> [ARGUMENTS]\n");
    for (title, names) in GROUPS {
        let _ = write!(text, "\n{BOLD}{title}{PLAIN}\n");
        for name in names {
            let about = command.find_subcommand(name).and_then(clap::Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {BOLD}{name:<11}{PLAIN} {about}");
        }
    }
    let _ = write!(text, "\n{BOLD}First steps{PLAIN}\n{FIRST_STEPS}\n");
    let _ = write!(text, "\n{BOLD}Exit codes{PLAIN}\n{EXIT_CODES}\n");
    let _ = write!(text, "\n{BOLD}Environment{PLAIN}\n{ENVIRONMENT}\n");
    let _ =
        write!(text, "\n{DIM}`sinew COMMAND --help` tells more about a command. Reading commands take --json.{PLAIN}");
    CommandLine::command().help_template(text)
}

pub const RUN: &str = "\
Examples:
  sinew run                                        the built-in Pioneer, simulated
  sinew run robots/pioneer --for 60s --json        a minute without a screen, results as JSON
  sinew run robots/pioneer --device base=/dev/ttyUSB0    the same robot on real wheels
  sinew run --record run.mcap                      records everything, so that every node can be replayed

JSON (--json), one object per line, told apart by event:
  state     each second: time_s, x_m, y_m, heading_rad, speed_m_s, turn_rad_s, battery_v, clearance_m, contacts_caused,
            contacts_suffered, held (why motion holds the body back), nodes, nodes_up, restarts; null is unknown
  incident  node, incident (died, restarted, recovered, …), message, pid, code, signal, span_s, last_lines
  robot     state (starting, running, degraded, stopping, stopped)
  end       stopped_by, ran_s, distance_m, mean_speed_m_s, least_clearance_m, contacts_…, restarts, lost";

pub const SIMULATE: &str = "\
Examples:
  sinew simulate --seeds 0..100 --for 300s         a hundred runs of the built-in Pioneer
  sinew simulate robots/pioneer --seeds 7..8 --svg run.svg    draws run 7
  sinew simulate --seeds 7..8 --record run.mcap    records run 7, for `sinew replay`
  sinew simulate --world office:7 --seeds 0..100   in an office made from seed 7 (also corridors, rooms, cave)
  sinew simulate --seeds 0..1000 --scenario mission.toml --csv a.csv --report a.html
                                                   a batch of missions; --resume goes on after Ctrl-C
  sinew simulate --seeds 0..1000 --faults chaos    deaths, hangs, lost bytes, … from each seed
  sinew simulate --seeds 7..8 --faults faults.toml --expect 0123456789abcdef
                                                   a mission again: the same byte for byte, or exit code 1

A fault file holds rates per minute (deaths, hangs, slowdowns, bursts, stops, supervisor: those of chaos are 14, 5, 5, 4,
1, 2), bounds (in_step, hang_s, slower, slow_s, lost_bytes, burst_s), and single faults, which happen in every mission:
  [[fault]]
  kind = \"death\"                  at_s, node; when (at_once, mid_write, before_head, before_wake), writes
                                    also hang (at_s, node, for_s), slowdown (… factor, for_s),
                                    burst (at_s, share, for_s, seed), supervisor (at_s, for_s),
                                    stop (at_s, node, gone_after_s, reset_after_s)
Each kind draws from a random stream of its own: one kind less leaves the others as they are.

JSON (--json):
  {\"runs\": [{seed, contacts_caused, contacts_suffered, distance_m, least_clearance_m, mean_speed_m_s,
             realtime_factor, hash}], \"total\": {the same keys}}
  The same seed gives the same hash, on any machine.
  With --scenario, --csv or --report: {missions: [{seed, success, failure, time_s, goals, …}], wanted, finished,
  succeeded, realtime_factor, figures: [{metric, unit, mean, deviation, quantiles}]}; a failed mission's exit code is 4.

Exit code 4 when the robot caused a contact, or an emergency stop did not hold; 130 after Ctrl-C.";

pub const SHRINK: &str = "\
Examples:
  sinew shrink --seed 38 --faults chaos             which of the seed's faults the failure needs: faults-38.toml
  sinew shrink robots/mine --seed 38 --scenario mission.toml --faults chaos --out few.toml

Give everything else as it was given to `sinew simulate`. The mission must fail for the same reason with the faults that
are left; with any one of them left out it does not. Durations and factors are halved and times rounded as far as they
can be. The command that is printed replays the result.

JSON (--json): {seed, failure, before, after, runs, faults, file, hash, again}

Exit code 4 when the seed does not fail, or fails without faults as well.";

pub const BARN: &str = "\
Examples:
  sinew barn --data barn                           every world once: success, collisions, score
  sinew barn --data barn --reactive --seeds 3      the newest scan alone decides, three runs in each world
  sinew barn --data dynabarn --dynamic --tracking off    cylinders that move, and a planner that is not told so
  sinew barn --data barn --latency-ms 50 --odometry-scale 1.01
  sinew barn --data barn --worlds 17..18 --svg run.svg   draws the run through world 17

JSON (--json):
  {note, runs, success, collisions, timeouts (shares, 0 to 1), mean_time_s, score, least_clearance_m, classes (DynaBARN),
   \"worlds\": [{world, seed, end, time_s, score, least_clearance_m, distance_m}]}

Start, goal, limits and score are the challenge's; the robot is the whole stack in the simulated host, in planar
kinematics: these figures are no leaderboard scores.";
pub const COMPARE: &str = "\
Examples:
  sinew simulate --seeds 0..200 --csv a.csv
  sinew simulate --seeds 0..200 --set nodes.forward.config.speed_m_s=0.2 --csv b.csv
  sinew compare a.csv b.csv       what the change does, with 95 % confidence intervals

JSON (--json): {seeds, unpaired, identical, success, success_interval, only, p,
  metrics: [{metric, unit, mean, difference, interval, significant}]}";

pub const DRIVE: &str = "\
Examples:
  sinew drive                     drives the only running robot with arrow keys or W A S D
  sinew drive --speed 0.15        slower than the robot file allows

While it runs the robot obeys the keys alone; when it ends, the robot's own actions go on. A key acts while it is held:
where the terminal reports releases (kitty keyboard protocol) the robot stops on release, elsewhere 0.4 s after the
last key repeat. Limits, stop zones and bumpers act as ever.

It is an action like any other: it writes /actions/teleop/proposal (urgency 1, valid for 0.3 s), which the coordinator
obeys as one more member of its set.";

pub const GOTO: &str = "\
Examples:
  sinew goto 6 4                  to x = 6 m, y = 4 m of the map, and waits until it is there; Ctrl-C cancels
  sinew goto 6 -1.5 90            and turns to 90° there, counter-clockwise from the map's x axis
  sinew goto 6 4 --no-wait        returns when the robot has accepted; `sinew call goto cancel` ends it

Without localisation the map is the odometry frame: it begins at `start` of the node odometry, or where the call
set_pose last put the robot. A goal that is off the map, on something, or no number is refused, and nothing moves.

JSON (--json), one object per line: {accepted}, {progress}, then node, result, took_s.";

pub const MODE: &str = "\
Examples:
  sinew mode                      the modes of the robot's coordinator, and which one counts
  sinew mode position_avoidance   sets one by its name
  sinew mode 0                    or by its number

JSON (--json): node, mode, name, modes (their names in order).";

pub const EXPERIMENTS: &str = "\
Examples:
  sinew experiments               all, with all their runs (some minutes)
  sinew experiments goto --quick  a tenth of the runs of one
  sinew experiments --plot docs/experiments    draws the plots of docs/experiments.md

JSON (--json), an object per experiment: experiment, conditions, runs, figures [{name, value, unit, target}], remarks,
holds. The same figures on any machine.

Exit code 4 when a figure is not what it must be.";

pub const DOWN: &str = "\
Examples:
  sinew down                      stops the only running robot in order: nodes first, then its files
  sinew down pioneer --timeout 30s

JSON (--json): robot, stopped, took_s.";

pub const START: &str = "\
Examples:
  sinew start steer_clear           starts a node that was stopped, has ended or was given up
  sinew start base --robot pioneer

JSON (--json): robot, node, request, ok.";

pub const STOP: &str = "\
Examples:
  sinew stop steer_clear            stops one node in order; it stays stopped until `sinew start`
  sinew down                        stops the whole robot

JSON (--json): robot, node, request, ok.";

pub const RESTART: &str = "\
Examples:
  sinew restart steer_clear         stops a node in order and starts it again

JSON (--json): robot, node, request, ok.";

pub const SET: &str = "\
Examples:
  sinew set forward.speed_m_s 0.15              another speed, while it drives
  sinew set forward.speed_m_s 0.15 --save       … and in the robot file, comments kept

The change is checked as `sinew check` would; then a new process of the node opens with it beside the living one and
takes its place. A value that the node refuses changes nothing.

JSON (--json): robot, node, change, saved, ok.";

pub const WIRE: &str = "\
Examples:
  sinew wire steer_clear.ranges /drivers/laser/ranges
  sinew wire drive.ranges /drivers/laser/ranges /drivers/base/sonar    the second one while the first is silent

Types must agree. A node is written to by one alone, so a wire never makes a second writer.

JSON (--json): robot, node, change, saved, ok.";

pub const SPAWN: &str = "\
Examples:
  sinew spawn stop_zone --at watch --period 100 --budget 2 --read ranges=/perception/echoes/ranges
  sinew spawn forward --at creep --period 100 --budget 1 --set speed_m_s=0.05 --save

The robot file with the new node is checked as `sinew check` would, the node is opened for its ports, and response-time
analysis must find that nobody misses a deadline for it: nodes without budget_ms count with what was measured of them.
What is refused changes nothing. A spawned node stands last until the robot starts anew; `sinew stop` ends it.

JSON (--json): robot, node, change, saved, reckoned, utilization, ok.";

pub const REPLACE: &str = "\
Examples:
  sinew replace steer_clear                           starts the node's program anew, as its file is now
  sinew replace steer_clear --program ./sinew-new     another build of it

The new process opens everything beside the living one. When it waits, the living one is stopped in order and the new
one takes its paths. One that does not open is ended and nothing changes; one that dies within its trial
(care.trial_s) is taken back. `sinew incidents` tells which it was.

JSON (--json): robot, node, request, ok.";

pub const TOP: &str = "\
Examples:
  sinew top                         every node's state, timing, processor, memory and scheduling, again and again
  sinew top --once --json           the same, once, for programs

JSON (--json): one object per look: robot, state, severity, nodes [{node, state, pid, restarts, rate_hz, lateness_ms,
execution_ms (p50, p99, max), steps, skipped, missed, faults, dropped, cpu_percent, rss_bytes, scheduling}].";

pub const INCIDENTS: &str = "\
Examples:
  sinew incidents                   what went wrong on the only running robot, oldest first
  sinew incidents pioneer --last 20 also after it has stopped
  sinew incidents --lines           with the last lines that each dead process wrote

A process that died with a core dump says where that is: beside the logs as NODE.core where the kernel writes files (the
newest of each node), else which program it was piped to. Whether cores are written at all is `ulimit -c` of whoever
started the robot.

JSON (--json): one record per line, as in incidents.jsonl.";

pub const CLEAR: &str = "\
Examples:
  sinew clear                       all is well again: ends limp mode and hold that wait for a person

Causes that are still there stay, and are listed. The emergency stop is not among them: `sinew reset`, then `sinew resume`.

JSON (--json): robot, ended (how many), stays [what], ok.";

pub const ESTOP: &str = "\
Examples:
  sinew estop                     stops the only running robot at once
  sinew estop pioneer --reason 'a child in the corridor'
  sinew estop --show              where the stop latch stands, and who wanted it

Anyone may stop a robot; it takes no privilege. The word goes straight to the guard, which wakes drivers and motion; where
a driver is dead or does not obey, the guard writes the device's stop itself. The stop outlives every process of the
robot, and a power cycle.

JSON (--json): robot, state (run, stopping, latched, armed), changes, sources [{name, reason, held, unix_ms, pid, uid}],
took_s (until the guard's answer).";

pub const RESET: &str = "\
Examples:
  sinew reset                     makes a stopped robot ready again; it does not move before `sinew resume`

Refused while the cause of a stop is still there, and while not every wheel is known to stand. JSON (--json): as `estop`.";

pub const RESUME: &str = "\
Examples:
  sinew resume                    lets a robot go that was reset, or that was started with `sinew run --stand`

JSON (--json): as `estop`.";

pub const LS: &str = "\
Examples:
  sinew ls                        every channel
  sinew ls /drivers               those of a layer or of a node
  sinew ls '/actions/*/proposal'  those of a pattern
  sinew ls sonar                  those with the word in their path
  sinew ls --tree                 by layer and node

JSON (--json): one object with robot, running, channels: [{path, type, writer_pid, writer_alive, generation, rate_hz,
age_s, samples, held, depth, bytes, layout_hash}]. Who reads a channel is not known: reading leaves no trace.";

pub const CAT: &str = "\
Examples:
  sinew cat /drivers/base/sonar               every new sample, until Ctrl-C
  sinew cat sonar --once                      the newest one; the end of a path will do where it is the only one
  sinew cat /perception/odometry/pose --field x_m --field y_m --rate 2
  sinew cat /drivers/base/state --json | jq .message.battery_v
  sinew cat /motion/drive/state --history 20  the newest 20 that the ring still holds

JSON (--json), one object per line: path, stamp_ns, sequence, generation, dropped (samples lost so far because this
reader was too slow), message; with --field: values instead of message.";

pub const HZ: &str = "\
Examples:
  sinew hz /drivers/base/odometry             at once, from the samples in the ring
  sinew hz odometry --window 10               watches for ten seconds
  sinew hz sonar --window 1 --follow          a line every second

The rate is the number of samples by sequence number over the time between their stamps: it is the writer's, however
busy this machine is. JSON (--json): path, rate_hz, samples, span_s, spacing_s and jitter_s {p50, p99, max}, dropped,
generation, age_s. Jitter is the distance of a spacing from the median spacing.";

pub const CALL: &str = "\
Examples:
  sinew call /drivers/base                    its commands and their fields
  sinew call /drivers/base enable '{\"on\": 1}'
  sinew call base ping                        who answers, and how fast

A message with several fields needs them all, as JSON or as FIELD=VALUE; one field takes the bare value; on and off are
1 and 0. Long orders show their progress; Ctrl-C cancels them.

JSON (--json): node, command, answer, took_s; before it {accepted} and {progress} of a long order. Without a command:
node, commands [{name, kind, request, progress, answer}], built_in.";

pub const LOGS: &str = "\
Examples:
  sinew logs                      the last lines of every node
  sinew logs base -f              what node base says from now on
  sinew logs base --lines 200
  sinew logs base --previous      the run before

JSON (--json), one object per line: node, line.";

pub const RECORD: &str = "\
Examples:
  sinew record                    records the only running robot, until Ctrl-C, to NAME-TIME.mcap
  sinew record pioneer -o run.mcap --for 60s
  sinew record --paths /drivers --paths '/actions/*/proposal'    a part of it
  sinew run --record run.mcap     a whole run from its first step, that can be replayed

The file is MCAP with the profile ros2: Foxglove, Lichtblick, Rerun and `ros2 bag` read it. The recorder is a process of
its own that only reads: a full disk ends the recording and never the robot.

JSON (--json): file, duration_s, channels, samples, lost, bytes, cpu_s.";

pub const LIVE: &str = "\
Examples:
  sinew live                      serves the only running robot at ws://127.0.0.1:8765, until Ctrl-C
  sinew live pioneer --port 0     at a port that the kernel chooses
  sinew live --paths /drivers --paths /ros
  sinew live --bind 0.0.0.0       to the whole network, unencrypted

In Lichtblick (1.22 or newer) or Foxglove: Open connection, Foxglove WebSocket, ws://127.0.0.1:8765. Topics, types and
bytes are those of a recording. Viewers can watch and nothing else; a slow one loses messages and slows nobody down. The
server is a program of its own, sinew-live, that `cargo xtask live` builds.

JSON (--json): event \"serving\" with robot, url, port; at the end \"over\" with samples, lost.";

pub const INFO: &str = "\
Examples:
  sinew info run.mcap             topics, types, counts, rates, what is missing, incidents
  sinew info run.mcap --json

JSON (--json): file, bytes, robot, host (live, simulated), seed, build, started, duration_s, messages, missing (gaps in
the numbers of channels), lost (samples that the recorder says it lost), replayable (nodes recorded from their start),
topics [{topic, type, count, rate_hz, bytes, missing}], incidents [{at_s, node, message}], changes, content_hash,
damage. Exit code 4 when the file is cut off or damaged.";

pub const PLAY: &str = "\
Examples:
  sinew play run.mcap             its paths come alive: sinew ls, cat, hz work as if the robot ran
  sinew play run.mcap --rate 4 --from 20s
  sinew play run.mcap --loop --name ghost
  (echo pause; echo seek 20s; cat) | sinew play run.mcap --commands

In a terminal space pauses, ← and → skip 5 s, + and - double and halve the rate, Home begins anew, q ends; with --commands
lines of the standard input do the same: pause, go, rate 2, seek 20s, skip -5s, end. Stamps are moved to now; at another
rate they are as far apart as they are played.

JSON (--json): samples, rounds, took_s.";

pub const REPLAY: &str = "\
Examples:
  sinew replay run.mcap                                   every node does its recorded steps again
  sinew replay run.mcap --node steer_clear --node base    these two
  sinew replay run.mcap --node forward --set nodes.forward.config.speed_m_s=0.2 --svg change.svg
                                                          how a changed node differs: statistics and a plot
A step sees the samples, device bytes and calls that it saw then, and what it writes is compared byte for byte. A step of
which something is missing is counted as not replayable; nothing is guessed.

JSON (--json): identical, nodes [{node, steps, identical_steps, different_steps, not_replayable, unproven,
unproven_identical, reasons, lives, paths [{path, identical, different, not_recorded, other_count, fields [{field, values,
different, mean, rms, max}]}], first_difference {step, at_s, path, sequence, fields, recorded, replayed, inputs, events}}].
Exit code 4 when something differs.";

pub const RECOVER: &str = "\
Examples:
  sinew recover cut.mcap -o whole.mcap    saves what is whole in a file that was cut off or damaged

JSON (--json): file, messages, duration_s, damaged_chunks, damage.";

pub const CHECK: &str = "\
Examples:
  sinew check                     the built-in Pioneer
  sinew check robots/pioneer      reads the file, opens every node for its ports, checks every wire; needs no hardware
  sinew check --types             node types that a robot file can name

JSON (--json): ok, errors [{file, line, column, reason, advice, message}] and, when all is well, what `graph --json` tells.
Exit code 4 when there is an error.";

pub const GRAPH: &str = "\
Examples:
  sinew graph                     the built-in Pioneer as text
  sinew graph robots/pioneer --dot | dot -Tsvg > pioneer.svg
  sinew graph --json

JSON (--json): robot, file, nodes [{path, type, layer, period_ms, deadline_ms, triggers, priority, process, reads,
writes}], edges [{from, to, path, port, triggers}].";

pub const SCHEMA: &str = "\
Examples:
  sinew schema > robot.schema.json     for editors: completion and errors while typing (first line of robot.toml:
                                       #:schema robot.schema.json)
  sinew schema --messages              layouts of all messages";

pub const BENCH: &str = "\
Examples:
  sinew bench channel             round trips between two processes beside futex and pipe
  sinew bench --json

JSON (--json): {\"machine\": {…}, \"rows\": [{name, size_bytes, p50_us, p99_us, max_us, n}]}";

pub const DOCTOR: &str = "\
Examples:
  sinew doctor                    what this machine lacks for real-time runs and real devices, and how to mend it
  sinew doctor --json

JSON (--json): verdict (ok, warn, fail), findings [{name, verdict, found, remedy}].
Exit code 4 when something must be mended before a robot can run; warnings do not count.";

pub const NODE: &str = "\
Examples:
  sinew node --root /dev/shm/sinew/pioneer /drivers/base    a node alone, for a debugger";

pub const CHAOS: &str = "\
Examples:
  sinew chaos --for 60s                          hurts the built-in Pioneer for a minute while it wanders
  sinew chaos robots/pioneer --for 10m --json    kills, stops, hangs, spins and feeds any process, about one every 2 s

Every process may be hit: nodes, supervisor, guard. Not the root of the process tree, which is never replaced, nor the
simulated world, which is the reality that the others live in.

JSON (--json): faults, contacts_caused, leaks (processes, files, descriptors), recovery_ms {p50, p99, max} from the fault
to the successor's first sign of life, recovered, not_recovered [..], leaked [..], contacts_per_fault_below (3/n),
faults_by_kind, faults_by_process, distance_m, lasted_s, seed.
Exit code 4 when the robot caused a contact, something leaked, or somebody did not come back.";

pub const TREE: &str = "\
Examples:
  sinew tree                      reads a launch and becomes the root of its process tree; for `sinew run` alone";

pub const SUPERVISE: &str = "\
Examples:
  sinew supervise --root /dev/shm/sinew/pioneer    for the root of a process tree alone";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_stands_in_the_overview_exactly_once() {
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        listed.sort_unstable();
        let command = CommandLine::command();
        let mut there: Vec<&str> =
            command.get_subcommands().filter(|c| !c.is_hide_set()).map(clap::Command::get_name).collect();
        there.sort_unstable();
        assert_eq!(listed, there);
    }

    #[test]
    fn every_command_has_a_line_about_it_and_an_example() {
        for command in CommandLine::command().get_subcommands_mut() {
            let name = command.get_name().to_owned();
            assert!(command.get_about().is_some(), "{name} has no line about it");
            let help = command.render_long_help().to_string();
            assert!(help.contains("Examples:") && help.contains(&format!("sinew {name}")), "{name}:\n{help}");
        }
    }

    #[test]
    fn every_argument_says_what_it_is() {
        for command in CommandLine::command().get_subcommands() {
            for argument in command.get_arguments() {
                assert!(argument.get_help().is_some(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }

    #[test]
    fn the_overview_tells_exit_codes_and_first_steps() {
        let help = command_line().render_help().to_string();
        for words in ["Run a robot", "sinew run", "Exit codes", "3  no such robot", "SINEW_SHM"] {
            assert!(help.contains(words), "{words} is missing in\n{help}");
        }
        assert!(!help.contains('{'), "{help}");
    }

    #[test]
    fn reading_commands_take_json() {
        let command = CommandLine::command();
        for name in [
            "ls", "cat", "hz", "call", "logs", "check", "graph", "doctor", "simulate", "bench", "record", "info",
            "play", "replay", "recover", "live", "estop", "reset", "resume",
        ] {
            let found = command.find_subcommand(name).expect("it is a command");
            assert!(found.get_arguments().any(|a| a.get_long() == Some("json")), "{name} has no --json");
        }
    }

    #[test]
    fn the_command_line_is_sound() {
        command_line().debug_assert();
    }
}
