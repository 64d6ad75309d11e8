//! `derive(Message)`: checks a message's layout and emits its schema. The traits and the schema are in `messages`.

mod emit;
mod parse;
#[cfg(test)]
mod tests;

use proc_macro::TokenStream;

/// Makes a struct a message, or a part of messages: plain data that lies in shared memory as it is.
///
/// Implements `messages::Message`, `messages::Plain`, `bytemuck::Pod` and `bytemuck::Zeroable`. The struct is `Copy`, has
/// named fields, `#[repr(C)]`, no type parameters and no padding. Its fields are u8…u64, i8…i64, f32, f64, arrays of these,
/// and other such structs. The compiler checks all of this.
///
/// The first paragraph of each doc comment goes into the schema. A field's unit stands in square brackets at its end.
///
/// | attribute | on | meaning |
/// |---|---|---|
/// | `#[message(tail = Type)]` | struct | ends in a variable-length array of `Type` |
/// | `#[message(crate = path)]` | struct | where `messages` is, when not a direct dependency: `sinew::messages` |
/// | `#[message(unit = "m/s")]` | field | the unit, where the doc comment does not say it |
/// | `#[message(values = "off on")]` | field | names of the values 0, 1…; u8, u16, u32, u64 and arrays of them |
///
/// ```
/// use messages::{Kind, Message, Schema};
///
/// /// What a gripper feels; the tail holds the force on each finger's pads.
/// #[derive(Debug, Clone, Copy, Message)]
/// #[repr(C)]
/// #[message(tail = [f32; 4])]
/// struct Grip {
///     /// Opening between the fingers [m].
///     opening_m: f64,
///     /// What the motor does.
///     #[message(values = "idle closing opening")]
///     motor: u32,
///     #[message(unit = "°C")]
///     temperature_c: f32,
/// }
///
/// let schema = Grip::schema();
/// assert_eq!((schema.size, schema.fields[2].offset), (16, 12));
/// assert_eq!(schema.fields[0].unit.as_deref(), Some("m"));
/// assert_eq!(schema.tail.as_ref().map(|tail| tail.size()), Some(16));
///
/// let grip = Grip { opening_m: 0.04, motor: 1, temperature_c: 31.5 };
/// assert_eq!(
///     messages::to_json_value(&grip, &[[0.5, 0.0, 0.0, 1.0]]).to_string(),
///     r#"{"opening_m":0.04,"motor":"closing","temperature_c":31.5,"tail":[[0.5,0.0,0.0,1.0]]}"#
/// );
/// ```
///
/// # What does not compile
///
/// Without `repr(C)`: Rust may order the fields as it likes.
///
/// ```compile_fail
/// #[derive(Clone, Copy, messages::Message)]
/// struct Speed { forward_m_s: f64 }
/// ```
///
/// `repr(packed)`: order the fields so that nothing needs packing.
///
/// ```compile_fail
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C, packed)]
/// struct Speed { wheels: u8, forward_m_s: f64 }
/// ```
///
/// Padding between fields: its bytes are not initialised, must not be shared, and no schema names them.
///
/// ```compile_fail,E0080
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Speed { wheels: u32, forward_m_s: f64 }
/// ```
///
/// Padding behind the last field.
///
/// ```compile_fail,E0080
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Speed { forward_m_s: f64, wheels: u32 }
/// ```
///
/// A `bool`, `char` or enum: another process may write bits that are none of its values. Use `values`.
///
/// ```compile_fail,E0277
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Motor { enabled: bool }
/// ```
///
/// A reference, pointer, `String` or `Vec`: it points into a memory that the reader does not have. Use a tail.
///
/// ```compile_fail,E0277
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Name { text: &'static str }
/// ```
///
/// `usize` and `isize`: their size depends on the machine.
///
/// ```compile_fail,E0277
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Count { samples: usize }
/// ```
///
/// Type parameters: the layout is one, known to every program.
///
/// ```compile_fail
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Pair<T> { first: T, second: T }
/// ```
///
/// Fields without names: the schema needs some.
///
/// ```compile_fail
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Speed(f64);
/// ```
///
/// Without `Copy`: samples are copied out of shared memory.
///
/// ```compile_fail,E0277
/// #[derive(messages::Message)]
/// #[repr(C)]
/// struct Speed { forward_m_s: f64 }
/// ```
///
/// A message with a tail within another: the tail would have to end in the middle.
///
/// ```compile_fail,E0080
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Both { left: messages::Ranges, right: messages::Ranges }
/// ```
///
/// Names for the values of what is no unsigned integer.
///
/// ```compile_fail
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C)]
/// struct Motor { #[message(values = "off on")] state: f32 }
/// ```
///
/// An alignment that a channel's slots do not have.
///
/// ```compile_fail,E0080
/// #[derive(Clone, Copy, messages::Message)]
/// #[repr(C, align(16))]
/// struct Speed { forward_m_s: f64, left_m_s: f64 }
/// ```
#[proc_macro_derive(Message, attributes(message))]
pub fn derive_message(input: TokenStream) -> TokenStream {
    expand(input.into()).into()
}

/// The implementations, or the errors that the compiler shows instead.
fn expand(input: proc_macro2::TokenStream) -> proc_macro2::TokenStream {
    let message = syn::parse2(input).and_then(parse::Message::read);
    message.map_or_else(|error| error.to_compile_error(), |message| emit::emit(&message))
}
