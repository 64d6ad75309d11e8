//! Requests over the control socket that concern the policy: `start NODE`, `stop NODE`, `restart NODE`,
//! `replace NODE [PROGRAM]`, `set NODE …`, `wire NODE …`, `clear`.
//!
//! `replace` starts the node's program anew, or another PROGRAM (the rest of the line), beside the living one; when it has
//! opened, the living one is stopped and it takes over. If it fails its trial, the one before is started again.
//!
//! Who asks for `set` or `wire` has written `launch.json` anew and left the one from before as `undo.NODE` beside it (the
//! node's path with dots): it comes back with the program from before, should the new process fail its trial.
//!
//! `clear` ends causes of limp mode and hold that wait for a person, once they are gone; the emergency stop itself is
//! reset at the guard. A node is named by its path or by the last part of it, where that is unique.

use std::ffi::OsStr;

use runtime::clock;

use crate::event::{Event, Request};
use crate::host::Host;
use crate::observer::Report;
use crate::policy::Policy;
use crate::processes::find_program;
use crate::severity::Cause;

/// The file to go back to is called so, and then like the node.
pub const UNDO: &str = "undo.";

/// What `words` ask for, or why not.
fn parse(words: &str, instances: &[String]) -> Option<Result<Request, String>> {
    let (verb, name) = words.split_once(' ').unwrap_or((words, ""));
    let make: fn(usize) -> Request = match verb {
        "start" => |node| Request::Start { node },
        "stop" => |node| Request::Stop { node },
        "restart" => |node| Request::Restart { node },
        // What has changed stands in the robot that every process reads at its start.
        "replace" | "set" | "wire" => |node| Request::Replace { node },
        "clear" if name.is_empty() => return Some(Ok(Request::Reset)),
        _ => return None,
    };
    let name = if ["replace", "set", "wire"].contains(&verb) { name.split(' ').next().unwrap_or(name) } else { name };
    Some(find(name, instances).map(make))
}

/// The other program that a `replace` names.
fn program(words: &str) -> Option<&str> {
    words.strip_prefix("replace ")?.split_once(' ').map(|(_, program)| program)
}

/// The node called `name`.
fn find(name: &str, instances: &[String]) -> Result<usize, String> {
    if let Some(exact) = instances.iter().position(|instance| instance == name) {
        return Ok(exact);
    }
    let ends = |instance: &String| instance.rsplit('/').next() == Some(name);
    let mut found = instances.iter().enumerate().filter(|(_, instance)| ends(instance)).map(|(node, _)| node);
    match (found.next(), found.next()) {
        (Some(node), None) => Ok(node),
        (Some(_), Some(_)) => Err(format!("several nodes are called \"{name}\": give the path of one")),
        (None, _) => Err(format!("there is no node \"{name}\"; there are {}", instances.join(", "))),
    }
}

/// The answer to `words`, and what is to be done; `None` for words that are no request of this kind.
pub(crate) fn answer(words: &str, instances: &[String], policy: &Policy) -> Option<(String, Option<Request>)> {
    let refused = |reason: String| (serde_json::json!({ "error": reason }).to_string(), None);
    Some(match parse(words, instances)? {
        Err(reason) => refused(reason),
        Ok(_) if program(words).is_some_and(|program| find_program(OsStr::new(program)).is_err()) => {
            refused(format!("cannot {words}: there is no such program, or it cannot be run"))
        }
        Ok(request) => match policy.refusal(request) {
            Some(reason) => refused(format!("cannot {words}: {reason}")),
            None if request == Request::Reset => (cleared(instances, policy), Some(request)),
            None => (r#"{"ok":true}"#.to_owned(), Some(request)),
        },
    })
}

/// What a process of the run reads at its start, below the run's folder.
const LAUNCH: &str = "launch.json";

/// What a `clear` ends, and what stays because it is not gone yet, or stays for all of the run.
fn cleared(instances: &[String], policy: &Policy) -> String {
    let (ended, stay): (Vec<&Cause>, Vec<&Cause>) = policy.causes().iter().partition(|cause| cause.resettable());
    let words = |cause: &&Cause| {
        let node = instances.get(cause.node).map_or("?", String::as_str);
        format!("{node} {} ({})", cause.kind.words(), cause.severity.word())
    };
    let stays: Vec<String> = stay.iter().map(words).collect();
    serde_json::json!({ "ok": true, "ended": ended.len(), "stays": stays }).to_string()
}

impl Host<'_> {
    /// Takes back what `set` or `wire` changed for the node: whoever asked has left the file from before.
    pub(crate) fn undo(&mut self, node: usize) {
        let (undo, launch) = (self.undo_file(node), self.run_folder.join(LAUNCH));
        match std::fs::rename(&undo, &launch) {
            Ok(()) => self.channels.change(clock::now(), Some(node), "taken back"),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => {
                let text = format!("the change of {} cannot be taken back: {error}", self.slots[node].instance);
                self.observer.report(Report::Note(&text));
            }
        }
    }

    /// The change of the node stays.
    pub(crate) fn forget_undo(&self, node: usize) {
        // There is none after most replacements.
        let _ = std::fs::remove_file(self.undo_file(node));
    }

    fn undo_file(&self, node: usize) -> std::path::PathBuf {
        self.run_folder.join(format!("{UNDO}{}", self.slots[node].file_name()))
    }

    /// Does what was asked for and answered already.
    pub(crate) fn carry_out(&mut self, words: &str, request: Request) {
        let node = match request {
            Request::Reset => None,
            Request::Start { node }
            | Request::Stop { node }
            | Request::Restart { node }
            | Request::Replace { node } => Some(node),
        };
        if let Request::Replace { node } = request
            && let Err(error) = self.slots[node].replace_with(program(words).map(OsStr::new))
        {
            // It was there when the request was answered.
            self.observer.report(Report::Note(&format!("cannot {words}: {error}")));
            return;
        }
        if let Some(node) = node.filter(|_| words.starts_with("replace ")) {
            // Of a change that nobody has finished.
            self.forget_undo(node);
        }
        self.channels.change(clock::now(), node, words);
        self.take(Event::Call(request));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rule::Rule;

    fn names() -> Vec<String> {
        ["/drivers/base", "/motion/drive", "/actions/base"].map(str::to_owned).into()
    }

    fn asked(words: &str) -> (String, Option<Request>) {
        let mut policy = Policy::new([Rule::default(); 3]);
        policy.handle(runtime::Time::from_seconds(1.0), Event::Begin, &mut Vec::new());
        answer(words, &names(), &policy).unwrap()
    }

    #[test]
    fn a_node_is_named_by_its_path_or_by_a_last_part_that_is_unique() {
        assert_eq!(asked("restart drive").1, Some(Request::Restart { node: 1 }));
        assert_eq!(asked("stop /actions/base").1, Some(Request::Stop { node: 2 }));
        assert!(asked("stop base").0.contains("several nodes"));
        assert!(asked("stop nobody").0.contains("there is no node"));
    }

    #[test]
    fn what_does_not_fit_the_state_is_refused_with_the_state() {
        let (answer, request) = asked("start drive");
        assert!(answer.contains("it is starting") && request.is_none(), "{answer}");
    }

    #[test]
    fn other_words_are_none_of_its_business() {
        let policy = Policy::new([Rule::default()]);
        assert_eq!(answer("dance drive", &names(), &policy), None);
        assert_eq!(answer("clear everything", &names(), &policy), None);
    }
}
