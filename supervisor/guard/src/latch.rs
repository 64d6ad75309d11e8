//! The stop latch as a pure state machine: events in, a state out; no clock, no memory, no process.
//!
//! ```text
//!        raise, hold              every wheel stands            reset, no cause held
//! Run ────────────────► Stopping ───────────────────► Latched ───────────────────────► Armed
//!  ▲                        ▲                                                            │ │
//!  │                        └──────────────────────── raise, hold ──────────────────────┘ │
//!  └─────────────────────────────────────── resume ────────────────────────────────────────┘
//! ```
//!
//! Motion is allowed in Run alone. A *raise* is an event (a person stopped the robot): it is over at once, what it did is
//! not. A *hold* lasts until the same source lowers it (an input line, a node that sees danger). A reset never starts
//! motion: that takes a second, separate word, and neither is accepted while any cause is held.

/// Where the latch stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum State {
    /// Motion is allowed.
    Run = 0,
    /// Stopped; not every driver has confirmed yet.
    Stopping = 1,
    /// Stopped, and every wheel is known to be told.
    Latched = 2,
    /// A person has reset it; the robot stands until a person lets it go.
    Armed = 3,
}

impl State {
    /// The state with this number.
    pub fn from_number(number: u32) -> State {
        match number & 3 {
            0 => State::Run,
            1 => State::Stopping,
            2 => State::Latched,
            _ => State::Armed,
        }
    }

    /// The state in one word.
    pub fn word(self) -> &'static str {
        match self {
            State::Run => "run",
            State::Stopping => "stopping",
            State::Latched => "latched",
            State::Armed => "armed",
        }
    }
}

/// What has happened. Sources are numbered by their slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The source wants a stop, now.
    Raise(usize),
    /// The source wants a stop, until it lowers it.
    Hold(usize),
    /// The source's cause is gone.
    Lower(usize),
    /// Every driver has written its stop, or the guard has for it.
    Stopped,
    /// A person says that the robot may be made ready again.
    Reset,
    /// A person lets it go.
    Resume,
}

/// Why a person's word changed nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// Nothing is stopped.
    NotStopped,
    /// The wheels are not known to stand yet.
    StillStopping,
    /// The source of this slot still holds its cause.
    Held(usize),
    /// A reset must come first.
    NotReset,
}

/// The latch with `N` slots for sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Latch<const N: usize> {
    state: State,
    held: [bool; N],
    raised: [bool; N],
}

impl<const N: usize> Default for Latch<N> {
    fn default() -> Self {
        Latch::new(State::Run)
    }
}

impl<const N: usize> Latch<N> {
    /// A latch in this state, of which nobody has asked anything.
    pub const fn new(state: State) -> Self {
        Latch { state, held: [false; N], raised: [false; N] }
    }

    /// Takes an event in; a person's word may be refused.
    pub fn handle(&mut self, event: Event) -> Result<State, Refused> {
        match event {
            Event::Raise(source) => self.raise(source, false),
            Event::Hold(source) => self.raise(source, true),
            Event::Lower(source) => {
                if let Some(held) = self.held.get_mut(source) {
                    *held = false;
                }
            }
            Event::Stopped if self.state == State::Stopping => self.state = State::Latched,
            Event::Stopped => {}
            Event::Reset => self.reset()?,
            Event::Resume => self.resume()?,
        }
        Ok(self.state)
    }

    fn raise(&mut self, source: usize, hold: bool) {
        // A source without a slot stops the robot all the same.
        if let Some(raised) = self.raised.get_mut(source) {
            *raised = true;
            self.held[source] |= hold;
        }
        if matches!(self.state, State::Run | State::Armed) {
            self.state = State::Stopping;
        }
    }

    fn reset(&mut self) -> Result<(), Refused> {
        match self.state {
            State::Run | State::Armed => Err(Refused::NotStopped),
            State::Stopping => Err(Refused::StillStopping),
            State::Latched => {
                self.free()?;
                self.raised = [false; N];
                self.state = State::Armed;
                Ok(())
            }
        }
    }

    fn resume(&mut self) -> Result<(), Refused> {
        match self.state {
            State::Run => Err(Refused::NotStopped),
            State::Stopping | State::Latched => Err(Refused::NotReset),
            State::Armed => {
                self.free()?;
                self.state = State::Run;
                Ok(())
            }
        }
    }

    fn free(&self) -> Result<(), Refused> {
        self.held.iter().position(|held| *held).map_or(Ok(()), |source| Err(Refused::Held(source)))
    }

    /// Where it stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether the source still holds its cause.
    pub fn is_held(&self, source: usize) -> bool {
        self.held.get(source).copied().unwrap_or(false)
    }

    /// Whether the source has wanted a stop since the last reset.
    pub fn is_raised(&self, source: usize) -> bool {
        self.raised.get(source).copied().unwrap_or(false)
    }

    /// A latch as a dead guard left it. What it held makes it stop, whatever the state said.
    pub fn restore(state: State, held: [bool; N], raised: [bool; N]) -> Self {
        let any = held.iter().any(|held| *held);
        let state = if any && matches!(state, State::Run | State::Armed) { State::Stopping } else { state };
        Latch { state, held, raised }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{HashMap, HashSet, VecDeque};

    const SOURCES: usize = 3;
    type Small = Latch<SOURCES>;

    fn events() -> Vec<Event> {
        let of_sources = (0..=SOURCES).flat_map(|n| [Event::Raise(n), Event::Hold(n), Event::Lower(n)]);
        of_sources.chain([Event::Stopped, Event::Reset, Event::Resume]).collect()
    }

    /// Every reachable state with every event out of it.
    fn search(mut look: impl FnMut(&Small, Event, &Small, Result<State, Refused>)) -> usize {
        let starts = [State::Run, State::Stopping, State::Latched, State::Armed].map(Small::new);
        let mut seen: HashSet<Small> = starts.into_iter().collect();
        let mut open: VecDeque<Small> = starts.into_iter().collect();
        while let Some(latch) = open.pop_front() {
            for event in events() {
                let mut next = latch;
                let told = next.handle(event);
                look(&latch, event, &next, told);
                if seen.insert(next) {
                    open.push_back(next);
                }
            }
        }
        seen.len()
    }

    #[test]
    fn motion_begins_by_a_resume_out_of_armed_and_by_nothing_else() {
        let states = search(|before, event, after, _| {
            if after.state() == State::Run && before.state() != State::Run {
                assert_eq!((before.state(), event), (State::Armed, Event::Resume), "{before:?}");
            }
        });
        println!("{states} states searched with {} events each", events().len());
        // Nothing is wanted in Run and Armed; elsewhere each source is quiet, raised, or raised and held.
        assert_eq!(states, 2 + 2 * 3_usize.pow(SOURCES as u32));
    }

    #[test]
    fn armed_is_reached_by_a_reset_out_of_latched_and_by_nothing_else() {
        search(|before, event, after, _| {
            if after.state() == State::Armed && before.state() != State::Armed {
                assert_eq!((before.state(), event), (State::Latched, Event::Reset), "{before:?}");
            }
        });
    }

    #[test]
    fn no_motion_and_no_arming_while_any_cause_is_held() {
        search(|_, _, after, _| {
            let held = (0..SOURCES).any(|source| after.is_held(source));
            assert!(!held || matches!(after.state(), State::Stopping | State::Latched), "{after:?}");
        });
    }

    #[test]
    fn every_raise_and_every_hold_ends_motion_at_once_even_without_a_slot() {
        search(|_, event, after, _| {
            if matches!(event, Event::Raise(_) | Event::Hold(_)) {
                assert!(matches!(after.state(), State::Stopping | State::Latched), "{event:?} {after:?}");
            }
        });
    }

    #[test]
    fn what_is_refused_changes_nothing() {
        search(|before, event, after, told| {
            if told.is_err() {
                assert_eq!(before, after, "{event:?}");
            }
        });
    }

    #[test]
    fn from_everywhere_the_way_back_is_open_once_the_causes_are_gone() {
        let mut all = HashMap::new();
        search(|before, _, _, _| {
            all.insert(*before, ());
        });
        for (mut latch, ()) in all {
            for source in 0..SOURCES {
                let _ = latch.handle(Event::Lower(source));
            }
            for event in [Event::Stopped, Event::Reset, Event::Resume] {
                let _ = latch.handle(event);
            }
            assert_eq!(latch.state(), State::Run);
        }
    }

    #[test]
    fn a_latch_that_a_dead_guard_left_stops_for_what_was_held() {
        let held = [false, true, false];
        for state in [State::Run, State::Armed] {
            assert_eq!(Small::restore(state, held, held).state(), State::Stopping);
            assert_eq!(Small::restore(state, [false; 3], held).state(), state);
        }
        assert_eq!(Small::restore(State::Latched, held, held).state(), State::Latched);
    }

    #[test]
    fn a_refusal_names_what_is_in_the_way() {
        let mut latch = Small::default();
        assert_eq!(latch.handle(Event::Reset), Err(Refused::NotStopped));
        assert_eq!(latch.handle(Event::Hold(2)), Ok(State::Stopping));
        assert_eq!(latch.handle(Event::Reset), Err(Refused::StillStopping));
        assert_eq!(latch.handle(Event::Resume), Err(Refused::NotReset));
        assert_eq!(latch.handle(Event::Stopped), Ok(State::Latched));
        assert_eq!(latch.handle(Event::Reset), Err(Refused::Held(2)));
    }
}
