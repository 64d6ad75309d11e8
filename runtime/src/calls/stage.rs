//! Where the requests of one command wait for the step: a fixed number of places between the pump and the step.
//!
//! A place goes round `FREE → STAGED → TAKEN → ENDED → FREE`. Each arrow belongs to one side: the pump fills and frees,
//! the step takes and ends; only `STAGED` may be left by either (the step takes, the pump withdraws), by compare and
//! exchange. So whoever is in a place is there alone, its mutexes are free when they are locked, and neither side waits.
//! The exception is the progress report, which the pump may be reading while the step has a newer one.

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::wire::{Name, SENDER_BYTES};
use crate::Time;
use crate::pump::Waker;

/// Requests of one command that can wait or be worked on at once.
pub const PLACES: usize = 16;

const FREE: u32 = 0;
const STAGED: u32 = 1;
const TAKEN: u32 = 2;
const ENDED: u32 = 3;

/// Who called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sender {
    /// What it calls itself: a node's path, or a program's name.
    pub name: Name<SENDER_BYTES>,
    /// Its process, as the kernel says; 0 within a simulated host.
    pub pid: i32,
    /// Its user, as the kernel says.
    pub uid: u32,
}

/// Whether a command is done within a step or takes its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandKind {
    /// One request, one answer.
    Call,
    /// Accepted, then progress, then done, failed or cancelled.
    Order,
}

/// The layout of one message of a command.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    pub hash: u64,
    pub bytes: usize,
    pub schema: fn() -> messages::Schema,
}

impl Shape {
    pub fn of<M: messages::Message>() -> Shape {
        Shape { hash: M::layout_hash(), bytes: size_of::<M>(), schema: M::schema }
    }
}

/// How a request ended, in the step's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The answer stands in the place.
    Answered,
    /// Not begun.
    Refused(&'static str),
    /// Begun, and not possible.
    Failed(&'static str),
    /// Stopped at the caller's wish.
    Cancelled,
    /// The node lost the request.
    Forgotten,
}

/// Why the caller no longer wants what it asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Cancellation {
    /// It said so.
    Asked = 1,
    /// It has ended, or closed its connection.
    CallerGone = 2,
}

/// The waiting room of one command.
#[derive(Debug)]
pub(crate) struct Stage {
    pub command: &'static str,
    pub kind: CommandKind,
    pub request: Shape,
    pub progress: Option<Shape>,
    pub answer: Shape,
    places: Box<[Place]>,
    /// How many requests were staged and are not taken or withdrawn yet: most steps find none and need not look further.
    waiting: AtomicU32,
    waker: OnceLock<Waker>,
}

#[derive(Debug)]
struct Place {
    state: AtomicU32,
    /// Greatest first: priority, then earliest arrival.
    rank: AtomicU64,
    cancelled: AtomicU8,
    accepted: AtomicBool,
    reported: AtomicBool,
    request: Mutex<Staged>,
    progress: Mutex<Box<[u8]>>,
    outcome: Mutex<Outcome>,
}

#[derive(Debug)]
struct Staged {
    sender: Sender,
    priority: u8,
    deadline: Time,
    body: Box<[u8]>,
}

#[derive(Debug)]
struct Outcome {
    end: End,
    body: Box<[u8]>,
}

/// What the step sees of a request beside its message.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Particulars {
    pub sender: Sender,
    pub priority: u8,
    pub deadline: Time,
}

/// What the pump learns of a place.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum News<'a> {
    /// The step accepted the order.
    Accepted,
    /// The newest progress message.
    Progress(&'a [u8]),
    /// It is over; the body is the answer message when it was answered. The place is free again.
    Ended(End, &'a [u8]),
}

impl Stage {
    pub fn new(
        command: &'static str,
        kind: CommandKind,
        request: Shape,
        progress: Option<Shape>,
        answer: Shape,
    ) -> Arc<Stage> {
        let progress_bytes = progress.map_or(0, |shape| shape.bytes);
        let places = (0..PLACES).map(|_| Place::new(request.bytes, progress_bytes, answer.bytes)).collect();
        Arc::new(Stage {
            command,
            kind,
            request,
            progress,
            answer,
            places,
            waiting: AtomicU32::new(0),
            waker: OnceLock::new(),
        })
    }

    /// How the step wakes the pump. False when a pump has it already.
    pub fn attach(&self, waker: Waker) -> bool {
        self.waker.set(waker).is_ok()
    }

    fn wake_pump(&self) {
        if let Some(waker) = self.waker.get() {
            waker.wake();
        }
    }

    // The pump's side.

    /// Lets a request wait; none when no place is free. `arrival` grows with every request of the node.
    pub fn admit(&self, particulars: Particulars, arrival: u64, body: &[u8]) -> Option<usize> {
        let index = self.places.iter().position(|place| place.state.load(Ordering::Acquire) == FREE)?;
        let place = &self.places[index];
        {
            let mut staged = lock(&place.request);
            staged.sender = particulars.sender;
            staged.priority = particulars.priority;
            staged.deadline = particulars.deadline;
            let length = body.len().min(staged.body.len());
            staged.body[..length].copy_from_slice(&body[..length]);
        }
        place.cancelled.store(0, Ordering::Relaxed);
        place.accepted.store(false, Ordering::Relaxed);
        place.reported.store(false, Ordering::Relaxed);
        place.rank.store(rank(particulars.priority, arrival), Ordering::Relaxed);
        place.state.store(STAGED, Ordering::Release);
        // A step that takes it before this line counts below zero for a moment, which is not zero either.
        self.waiting.fetch_add(1, Ordering::Release);
        Some(index)
    }

    /// Takes a request back that the step has not taken; false when it has.
    pub fn withdraw(&self, index: usize) -> bool {
        let state = &self.places[index].state;
        let withdrawn = state.compare_exchange(STAGED, FREE, Ordering::AcqRel, Ordering::Acquire).is_ok();
        if withdrawn {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
        withdrawn
    }

    /// Whether the step has accepted or ended the request.
    pub fn has_news(&self, index: usize) -> bool {
        let place = &self.places[index];
        place.state.load(Ordering::Acquire) == ENDED || place.accepted.load(Ordering::Acquire)
    }

    /// Tells the step that the request is no longer wanted.
    pub fn cancel(&self, index: usize, why: Cancellation) {
        self.places[index].cancelled.store(why as u8, Ordering::Release);
    }

    /// What is new in a place that was admitted: at most acceptance, one progress message and the end, in this order.
    pub fn collect(&self, index: usize, accepted_before: bool, mut tell: impl FnMut(News<'_>)) {
        let place = &self.places[index];
        // The end is looked for first: what was reported before it is then seen as well.
        let ended = place.state.load(Ordering::Acquire) == ENDED;
        if !accepted_before && place.accepted.load(Ordering::Acquire) {
            tell(News::Accepted);
        }
        if place.reported.swap(false, Ordering::AcqRel) {
            tell(News::Progress(&lock(&place.progress)));
        }
        if ended {
            {
                let outcome = lock(&place.outcome);
                tell(News::Ended(outcome.end, &outcome.body));
            }
            place.state.store(FREE, Ordering::Release);
        }
    }

    // The step's side.

    /// Takes the request that comes first by priority, then by arrival.
    pub fn take(&self) -> Option<usize> {
        if self.waiting.load(Ordering::Acquire) == 0 {
            return None;
        }
        // Each round lost means that the pump withdrew that request: no more rounds than places.
        for _ in 0..PLACES {
            let staged = self.places.iter().enumerate();
            let staged = staged.filter(|(_, place)| place.state.load(Ordering::Acquire) == STAGED);
            let (index, place) = staged.max_by_key(|(_, place)| place.rank.load(Ordering::Relaxed))?;
            if place.state.compare_exchange(STAGED, TAKEN, Ordering::AcqRel, Ordering::Acquire).is_ok() {
                self.waiting.fetch_sub(1, Ordering::Relaxed);
                return Some(index);
            }
        }
        None
    }

    /// The request that was taken.
    pub fn read<Q: messages::Message>(&self, index: usize) -> (Q, Particulars) {
        let staged = lock(&self.places[index].request);
        let mut message = Q::zeroed();
        let bytes = messages::bytemuck::bytes_of_mut(&mut message);
        let length = bytes.len().min(staged.body.len());
        bytes[..length].copy_from_slice(&staged.body[..length]);
        (message, Particulars { sender: staged.sender, priority: staged.priority, deadline: staged.deadline })
    }

    /// Whether, and why, the request is no longer wanted.
    pub fn cancellation(&self, index: usize) -> Option<Cancellation> {
        match self.places[index].cancelled.load(Ordering::Acquire) {
            0 => None,
            1 => Some(Cancellation::Asked),
            _ => Some(Cancellation::CallerGone),
        }
    }

    /// Accepts a long order.
    pub fn accept(&self, index: usize) {
        self.places[index].accepted.store(true, Ordering::Release);
        self.wake_pump();
    }

    /// Reports progress; false when the pump was just reading the report before, which then stands.
    pub fn report(&self, index: usize, body: &[u8]) -> bool {
        let place = &self.places[index];
        let Ok(mut progress) = place.progress.try_lock() else { return false };
        let length = body.len().min(progress.len());
        progress[..length].copy_from_slice(&body[..length]);
        drop(progress);
        place.reported.store(true, Ordering::Release);
        self.wake_pump();
        true
    }

    /// Ends the request; `body` is the answer message, or nothing.
    pub fn end(&self, index: usize, end: End, body: &[u8]) {
        let place = &self.places[index];
        {
            let mut outcome = lock(&place.outcome);
            outcome.end = end;
            let length = body.len().min(outcome.body.len());
            outcome.body[..length].copy_from_slice(&body[..length]);
        }
        place.state.store(ENDED, Ordering::Release);
        self.wake_pump();
    }
}

impl Place {
    fn new(request_bytes: usize, progress_bytes: usize, answer_bytes: usize) -> Place {
        let nobody = Sender { name: Name::default(), pid: 0, uid: 0 };
        Place {
            state: AtomicU32::new(FREE),
            rank: AtomicU64::new(0),
            cancelled: AtomicU8::new(0),
            accepted: AtomicBool::new(false),
            reported: AtomicBool::new(false),
            request: Mutex::new(Staged {
                sender: nobody,
                priority: 0,
                deadline: Time::ZERO,
                body: vec![0; request_bytes].into(),
            }),
            progress: Mutex::new(vec![0; progress_bytes].into()),
            outcome: Mutex::new(Outcome { end: End::Forgotten, body: vec![0; answer_bytes].into() }),
        }
    }
}

/// Orders by priority, then by arrival: greatest first.
fn rank(priority: u8, arrival: u64) -> u64 {
    const ARRIVALS: u64 = (1 << 56) - 1;
    u64::from(priority) << 56 | (ARRIVALS - (arrival & ARRIVALS))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Odometry;
    use std::sync::atomic::AtomicUsize;

    fn stage() -> Arc<Stage> {
        // Any message does: the stage sees bytes.
        let shape = Shape { bytes: 8, ..Shape::of::<Odometry>() };
        Stage::new("test", CommandKind::Order, shape, Some(shape), shape)
    }

    fn particulars(priority: u8) -> Particulars {
        let sender = Sender { name: Name::default(), pid: 0, uid: 0 };
        Particulars { sender, priority, deadline: Time::ZERO }
    }

    #[test]
    fn news_come_in_the_order_of_an_orders_life() {
        let stage = stage();
        let place = stage.admit(particulars(0), 1, &[1; 8]).unwrap();
        assert_eq!(stage.take(), Some(place));
        stage.accept(place);
        assert!(stage.report(place, &[2; 8]));
        assert!(stage.report(place, &[3; 8]));
        stage.end(place, End::Answered, &[4; 8]);
        let mut heard = Vec::new();
        stage.collect(place, false, |news| {
            heard.push(match news {
                News::Accepted => 1,
                News::Progress(body) => body[0],
                News::Ended(end, body) => {
                    assert_eq!(end, End::Answered);
                    body[0]
                }
            });
        });
        assert_eq!(heard, [1, 3, 4]);
        // The place is free, and remembers nothing.
        assert_eq!(stage.admit(particulars(0), 2, &[5; 8]), Some(place));
        assert_eq!(stage.cancellation(place), None);
        stage.collect(place, false, |news| panic!("{news:?}"));
    }

    #[test]
    fn a_place_that_the_step_has_cannot_be_withdrawn() {
        let stage = stage();
        let place = stage.admit(particulars(0), 1, &[]).unwrap();
        stage.take();
        assert!(!stage.withdraw(place));
        let other = stage.admit(particulars(0), 2, &[]).unwrap();
        assert!(stage.withdraw(other));
        assert_eq!(stage.take(), None);
    }

    #[test]
    fn pump_and_step_together_end_every_request_exactly_once() {
        const REQUESTS: u64 = 20_000;
        let stage = stage();
        let over = AtomicBool::new(false);
        let (taken, mut answered, mut withdrawn) = (AtomicUsize::new(0), 0, 0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Acquire) {
                    let Some(place) = stage.take() else {
                        std::thread::yield_now();
                        continue;
                    };
                    taken.fetch_add(1, Ordering::Relaxed);
                    let body = lock(&stage.places[place].request).body.clone();
                    stage.report(place, &body);
                    stage.end(place, End::Answered, &body);
                }
            });
            let mut waiting: Vec<(usize, u64)> = Vec::new();
            let mut next = 0;
            while next < REQUESTS || !waiting.is_empty() {
                if next < REQUESTS
                    && let Some(place) = stage.admit(particulars(next as u8), next, &next.to_le_bytes())
                {
                    assert!(waiting.iter().all(|(other, _)| *other != place));
                    waiting.push((place, next));
                    next += 1;
                } else {
                    std::thread::yield_now();
                }
                waiting.retain(|(place, request)| {
                    if request % 7 == 0 && stage.withdraw(*place) {
                        withdrawn += 1;
                        return false;
                    }
                    let mut ended = false;
                    stage.collect(*place, true, |news| match news {
                        News::Accepted => panic!("nobody accepts"),
                        News::Progress(body) => assert_eq!(body, request.to_le_bytes()),
                        News::Ended(end, body) => {
                            assert_eq!((end, body), (End::Answered, &request.to_le_bytes()[..]));
                            ended = true;
                        }
                    });
                    answered += usize::from(ended);
                    !ended
                });
            }
            over.store(true, Ordering::Release);
        });
        assert_eq!(taken.into_inner(), answered);
        assert_eq!(answered + withdrawn, REQUESTS as usize);
    }
}
