//! What may be shared between processes as it lies in memory, and what makes it a message.

use bytemuck::{Pod, Zeroable};

use crate::{Kind, Schema, SchemaText};

// The channel format, recordings and `to_json` say little-endian and 8-byte words; a robot computer of another kind
// needs conversions that nobody has written.
#[cfg(not(all(target_endian = "little", target_pointer_width = "64")))]
compile_error!("sinew's messages are shared as they lie in memory: only 64-bit little-endian targets are supported");

/// Data without pointers, padding or invalid bit patterns, that can describe itself.
///
/// Implemented for `u8`…`u64`, `i8`…`i64`, `f32`, `f64`, arrays of plain data and every struct that derives
/// [`Message`](macro@crate::Message). Not for `bool`, `char` and enums: another process may write any bits.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be part of a message",
    label = "not plain data",
    note = "allowed: u8…u64, i8…i64, f32, f64, arrays of these, and structs with `#[derive(Message)]`",
    note = "for a flag use a u32 that is 0 or 1; for a choice a u32 with `#[message(values = \"…\")]`"
)]
pub trait Plain: Pod + Send + Sync {
    /// Number of elements when this is an array (of arrays: of all, in row-major order).
    const COUNT: Option<usize> = None;

    /// Whether this may be a field or a tail: a message with a tail may not.
    #[doc(hidden)]
    const NESTS: bool = true;

    /// What one element is.
    fn kind() -> Kind;
}

/// One kind of sample on a channel: a fixed part, and perhaps a *tail* of further elements behind it.
///
/// Derived, see [`derive(Message)`](macro@crate::Message). In memory and in recordings the tail begins at
/// [`tail_offset`].
pub trait Message: Plain {
    /// What the tail is made of; [`NoTail`] when there is none.
    type Tail: Plain;

    /// Name of the message's type, as in a channel's header.
    const NAME: &'static str;

    /// Whether the message ends in a tail.
    const HAS_TAIL: bool;

    /// Describes the layout. Allocates: call it when a channel opens, not in a step.
    fn schema() -> Schema;

    /// The layout as text, and its hash. Allocates once per type and process: call it when a channel opens first.
    fn schema_text() -> &'static SchemaText;

    /// [`Schema::hash`] of the layout. Allocates as `schema_text` does.
    fn layout_hash() -> u64 {
        Self::schema_text().hash
    }
}

/// Where the tail begins: the fixed part's size rounded up to the next multiple of 8 bytes.
///
/// The bytes between the fixed part and the tail, if any, are zero.
///
/// ```
/// assert_eq!(messages::tail_offset(16), 16);
/// assert_eq!(messages::tail_offset(20), 24);
/// ```
pub const fn tail_offset(fixed_bytes: usize) -> usize {
    fixed_bytes.next_multiple_of(8)
}

/// The tail of a message that has none. Its slices are always empty: nobody else can make one.
///
/// It is one byte long, so that generic code may divide by the size of a tail's element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct NoTail(u8);

// SAFETY: a transparent wrapper of u8, for which zero is valid.
unsafe impl Zeroable for NoTail {}
// SAFETY: a transparent wrapper of u8: any bit pattern, no padding.
unsafe impl Pod for NoTail {}

impl Plain for NoTail {
    fn kind() -> Kind {
        Kind::U8
    }
}

macro_rules! plain_numbers {
    ($($number:ty => $kind:ident),*) => {
        $(impl Plain for $number {
            fn kind() -> Kind {
                Kind::$kind
            }
        })*
    };
}

plain_numbers!(u8 => U8, u16 => U16, u32 => U32, u64 => U64, i8 => I8, i16 => I16, i32 => I32, i64 => I64, f32 => F32, f64 => F64);

impl<T: Plain, const N: usize> Plain for [T; N] {
    const COUNT: Option<usize> = match T::COUNT {
        Some(inner) => Some(N * inner),
        None => Some(N),
    };
    const NESTS: bool = T::NESTS;

    fn kind() -> Kind {
        T::kind()
    }
}
