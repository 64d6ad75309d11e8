//! The file format of a channel, version 1: enough to read one from C or Python.
//!
//! A channel is one file, `<root>/<path>`, for example `/dev/shm/sinew/pioneer/drivers/base/sonar`. All numbers are
//! little-endian; `u64` at offsets divisible by 8, `u32` by 4. The in-process twin holds the same bytes on the heap.
//!
//! | offset | type | name | meaning |
//! |---:|---|---|---|
//! | 0 | 8 bytes | magic | `SINEWCH` and a zero byte |
//! | 8 | u64 | version | 1 |
//! | 16 | u64 | header_bytes | offset of slot 0, a multiple of 4096 |
//! | 24 | u64 | total_bytes | of the whole file |
//! | 32 | u64 | layout_hash | of the message's schema |
//! | 40 | u64 | slot_bytes | from one slot to the next, a multiple of 64 |
//! | 48 | u64 | slot_count | depth + 1, so that `depth` samples stay whole while one is being written |
//! | 56 | u64 | depth | samples of history |
//! | 64 | u64 | fixed_bytes | size of the message without its tail |
//! | 72 | u64 | tail_element_bytes | 0 when the message has no tail |
//! | 80 | u64 | tail_capacity | elements |
//! | 88 | u64 | type_name_bytes | UTF-8 text at offset 512 |
//! | 96 | u64 | schema_bytes | UTF-8 text right after the type name |
//! | 104 | u64 | created_ns | CLOCK_MONOTONIC at creation; 0 in process |
//! | 256 | u64 | head | newest complete sequence number; the first is 1, 0 means none |
//! | 264 | u64 | generation | counts writers; 0 before the first |
//! | 272 | u64 | writer_pid | 0 when the last writer left in order or none came |
//! | 280 | u64 | retired | 0 while in use; else 1 + the last sequence number that counts: open the path again |
//! | 288 | u32 | wake | changes after each sample; a futex word |
//! | 512 | text | type_name, schema | |
//!
//! Everything below offset 256 never changes; a channel of another geometry is another file (inode) under the same
//! path. Sequence `n` is in slot `n % slot_count`, at `header_bytes + (n % slot_count) * slot_bytes`:
//!
//! | offset in slot | type | name | meaning |
//! |---:|---|---|---|
//! | 0 | u64 | mark | 2 n when sample n is complete, 2 n + 1 while it is written |
//! | 8 | u64 | stamp_ns | on the robot's clock |
//! | 16 | u64 | generation | of the writer that wrote it |
//! | 24 | u64 | tail_bytes | length of the tail |
//! | 32 | bytes | fixed part | `fixed_bytes` |
//! | 32 + fixed_bytes rounded up to 8 | bytes | tail | `tail_bytes` |
//!
//! To read sample `n`: map the file read-only; load `head`, then a load fence; not there yet if `n > head`; load
//! `mark`, lost if it is not `2 n`; copy; a load fence; load `mark` again: the copy is good if it is still `2 n`. On
//! x86 plain loads in this order will do, in C `atomic_load_explicit(…, memory_order_relaxed)` with
//! `atomic_thread_fence(memory_order_acquire)`. To sleep: load `wake`, look at `head`, `FUTEX_WAIT` on the loaded value.

use super::atomic::{AtomicU64, Ordering};
use super::error::ChannelError;
use super::ring;
use messages::Message;

#[cfg(not(all(target_pointer_width = "64", target_endian = "little")))]
compile_error!("channels need a 64-bit little-endian target: slots are shared as 8-byte atomic words");

pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"SINEWCH\0");
pub(super) const VERSION: u64 = 1;

/// Word indexes (offset / 8) of the header's fields.
pub(super) mod at {
    pub const MAGIC: usize = 0;
    pub const VERSION: usize = 1;
    pub const HEADER_BYTES: usize = 2;
    pub const TOTAL_BYTES: usize = 3;
    pub const LAYOUT_HASH: usize = 4;
    pub const SLOT_BYTES: usize = 5;
    pub const SLOT_COUNT: usize = 6;
    pub const DEPTH: usize = 7;
    pub const FIXED_BYTES: usize = 8;
    pub const TAIL_ELEMENT_BYTES: usize = 9;
    pub const TAIL_CAPACITY: usize = 10;
    pub const TYPE_NAME_BYTES: usize = 11;
    pub const SCHEMA_BYTES: usize = 12;
    pub const CREATED_NS: usize = 13;
    pub const HEAD: usize = 32;
    pub const GENERATION: usize = 33;
    pub const WRITER_PID: usize = 34;
    pub const RETIRED: usize = 35;
    pub const WAKE: usize = 36;
    pub const TEXT: usize = 64;
}

/// Header words that every file must have.
pub(super) const LEAST_WORDS: usize = PAGE_BYTES / 8;

const PAGE_BYTES: usize = 4096;
const SLOT_ALIGN: usize = 64;
/// A file beyond this is an error in a header or in a robot file, not a wish.
const MOST_BYTES: usize = 1 << 40;

/// What a channel holds: the message's layout and how many samples are kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Geometry {
    /// Name of the message type, for people and for the error that names both types.
    pub type_name: String,
    /// Hash of the schema: equal hashes mean equal layouts.
    pub layout_hash: u64,
    /// The schema's text, by which tools decode the bytes.
    pub schema: String,
    /// Size of the message without its tail, in bytes.
    pub fixed_bytes: usize,
    /// Size of one element of the tail, in bytes; 0 when there is no tail.
    pub tail_element_bytes: usize,
    /// Elements that fit into the tail.
    pub tail_capacity: usize,
    /// Samples of history that readers can rely on; at least 1.
    pub depth: usize,
}

impl Geometry {
    /// The geometry of a channel of `M`, with room for `tail_capacity` tail elements.
    pub fn of<M: Message>(tail_capacity: usize, depth: usize) -> Geometry {
        let schema = M::schema_text();
        Geometry {
            type_name: M::NAME.into(),
            layout_hash: schema.hash,
            schema: schema.text.clone(),
            fixed_bytes: size_of::<M>(),
            tail_element_bytes: if M::HAS_TAIL { size_of::<M::Tail>() } else { 0 },
            tail_capacity: if M::HAS_TAIL { tail_capacity } else { 0 },
            depth,
        }
    }

    /// Whether samples can be carried from a ring of geometry `self` into one of `other`: only depth and tail capacity
    /// may differ.
    pub(super) fn same_layout(&self, other: &Geometry) -> bool {
        self.layout_hash == other.layout_hash
            && self.type_name == other.type_name
            && self.fixed_bytes == other.fixed_bytes
            && self.tail_element_bytes == other.tail_element_bytes
    }

    /// The sizes that follow from this geometry, or why there are none.
    pub(super) fn shape(&self) -> Result<Shape, String> {
        if self.depth == 0 {
            return Err("depth must be at least 1".into());
        }
        if self.tail_element_bytes == 0 && self.tail_capacity != 0 {
            return Err(format!("a tail of {} elements of no size", self.tail_capacity));
        }
        self.checked_shape()
            .filter(|shape| shape.total_bytes() <= MOST_BYTES)
            .ok_or_else(|| format!("{} samples of this size are beyond any memory", self.depth))
    }

    fn checked_shape(&self) -> Option<Shape> {
        let text = self.type_name.len().checked_add(self.schema.len())?;
        let header_bytes = (at::TEXT * 8).checked_add(text)?.checked_next_multiple_of(PAGE_BYTES)?;
        let tail_bytes = self.tail_element_bytes.checked_mul(self.tail_capacity)?;
        let fixed_words = self.fixed_bytes.div_ceil(8);
        let data_words = fixed_words.checked_add(tail_bytes.div_ceil(8))?;
        let slot_bytes = data_words.checked_add(ring::DATA)?.checked_mul(8)?.checked_next_multiple_of(SLOT_ALIGN)?;
        let slot_count = self.depth.checked_add(1)?;
        slot_bytes.checked_mul(slot_count)?.checked_add(header_bytes)?;
        Some(Shape {
            header_words: header_bytes / 8,
            slot_words: slot_bytes / 8,
            slot_count,
            depth: self.depth,
            fixed_bytes: self.fixed_bytes,
            fixed_words,
            tail_element_bytes: self.tail_element_bytes,
            tail_bytes,
        })
    }
}

/// Sizes of a ring, checked against its memory once and cached: no later read of the header can move an access.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    pub header_words: usize,
    pub slot_words: usize,
    pub slot_count: usize,
    pub depth: usize,
    pub fixed_bytes: usize,
    pub fixed_words: usize,
    pub tail_element_bytes: usize,
    /// Capacity of the tail, in bytes.
    pub tail_bytes: usize,
}

impl Shape {
    pub fn total_words(&self) -> usize {
        self.header_words + self.slot_words * self.slot_count
    }

    pub fn total_bytes(&self) -> usize {
        self.total_words() * 8
    }

    /// First word of the slot of `sequence`.
    pub fn slot_start(&self, sequence: u64) -> usize {
        self.header_words + (sequence % self.slot_count as u64) as usize * self.slot_words
    }
}

/// Writes the header of `geometry` into zeroed `words`. The magic comes last.
pub(super) fn write_header(words: &[AtomicU64], geometry: &Geometry, shape: &Shape, created_ns: u64) {
    let put = |at: usize, value: u64| words[at].store(value, Ordering::Relaxed);
    put(at::VERSION, VERSION);
    put(at::HEADER_BYTES, shape.header_words as u64 * 8);
    put(at::TOTAL_BYTES, shape.total_bytes() as u64);
    put(at::LAYOUT_HASH, geometry.layout_hash);
    put(at::SLOT_BYTES, shape.slot_words as u64 * 8);
    put(at::SLOT_COUNT, shape.slot_count as u64);
    put(at::DEPTH, shape.depth as u64);
    put(at::FIXED_BYTES, geometry.fixed_bytes as u64);
    put(at::TAIL_ELEMENT_BYTES, geometry.tail_element_bytes as u64);
    put(at::TAIL_CAPACITY, geometry.tail_capacity as u64);
    put(at::TYPE_NAME_BYTES, geometry.type_name.len() as u64);
    put(at::SCHEMA_BYTES, geometry.schema.len() as u64);
    put(at::CREATED_NS, created_ns);
    let text: Vec<u8> = geometry.type_name.bytes().chain(geometry.schema.bytes()).collect();
    for (word, bytes) in words[at::TEXT..shape.header_words].iter().zip(text.chunks(8)) {
        let mut padded = [0; 8];
        padded[..bytes.len()].copy_from_slice(bytes);
        word.store(u64::from_le_bytes(padded), Ordering::Relaxed);
    }
    put(at::MAGIC, MAGIC);
}

/// Length that the header gives itself, in bytes; `words` are as much of the file as was read.
pub(super) fn stated_header_bytes(words: &[AtomicU64]) -> u64 {
    words.get(at::HEADER_BYTES).map_or(0, |word| word.load(Ordering::Relaxed))
}

/// Reads and checks a header that anybody may have written; every size that it returns fits a file of `file_words`.
pub(super) fn parse(words: &[AtomicU64], file_words: u64) -> Result<(Geometry, Shape), String> {
    if words.len() < LEAST_WORDS {
        return Err(format!("it has {} bytes, less than a header", words.len() * 8));
    }
    let get = |at: usize| words[at].load(Ordering::Relaxed);
    if get(at::MAGIC) != MAGIC {
        return Err("its magic number is not a channel's".into());
    }
    if get(at::VERSION) != VERSION {
        return Err(format!("its format has version {}, this program knows {VERSION}", get(at::VERSION)));
    }
    let size = |at: usize, name: &str| {
        let value = get(at);
        usize::try_from(value).ok().filter(|&v| v <= MOST_BYTES).ok_or(format!("its {name} is {value}"))
    };
    let (name_bytes, schema_bytes) =
        (size(at::TYPE_NAME_BYTES, "type name length")?, size(at::SCHEMA_BYTES, "schema length")?);
    let text = text(words, name_bytes, schema_bytes).ok_or("its type name or schema is damaged")?;
    let geometry = Geometry {
        type_name: text.0,
        layout_hash: get(at::LAYOUT_HASH),
        schema: text.1,
        fixed_bytes: size(at::FIXED_BYTES, "fixed size")?,
        tail_element_bytes: size(at::TAIL_ELEMENT_BYTES, "tail element size")?,
        tail_capacity: size(at::TAIL_CAPACITY, "tail capacity")?,
        depth: size(at::DEPTH, "depth")?,
    };
    let shape = geometry.shape()?;
    let stated = [get(at::HEADER_BYTES), get(at::SLOT_BYTES), get(at::SLOT_COUNT), get(at::TOTAL_BYTES)];
    let right = [shape.header_words * 8, shape.slot_words * 8, shape.slot_count, shape.total_bytes()].map(|v| v as u64);
    if stated != right {
        return Err("the sizes in its header contradict each other".into());
    }
    if shape.total_words() as u64 > file_words {
        return Err(format!("it has {} bytes of the {} in its header", file_words * 8, shape.total_bytes()));
    }
    Ok((geometry, shape))
}

/// Type name and schema, when they lie within `words` and are UTF-8.
fn text(words: &[AtomicU64], name_bytes: usize, schema_bytes: usize) -> Option<(String, String)> {
    let all = name_bytes.checked_add(schema_bytes)?;
    let words = words.get(at::TEXT..at::TEXT.checked_add(all.div_ceil(8))?)?;
    let mut bytes: Vec<u8> = words.iter().flat_map(|w| w.load(Ordering::Relaxed).to_le_bytes()).collect();
    bytes.truncate(all);
    let schema = String::from_utf8(bytes.split_off(name_bytes)).ok()?;
    Some((String::from_utf8(bytes).ok()?, schema))
}

impl Geometry {
    /// The sizes, or the error that names `path`.
    pub(super) fn shape_for(&self, path: &str) -> Result<Shape, ChannelError> {
        self.shape().map_err(|why| ChannelError::BadGeometry { path: path.into(), why })
    }
}
