//! The layout of a message, as data: names, offsets, kinds, units.

mod json;
mod json_error;
mod parse;
mod text;

pub use json::{from_json_value, to_json_value};
pub use json_error::{JsonError, JsonProblem};
pub use parse::SchemaError;

use crate::{Plain, tail_offset};

/// Layout of a message. Comes from [`Message::schema`](crate::Message::schema) or [`Schema::from_text`].
///
/// The fields follow one another without gaps, in the order of their offsets, and fill `size` bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Schema {
    /// Name of the type, for example `Ranges`.
    pub name: String,
    /// Size of the fixed part, without the tail [byte].
    pub size: usize,
    /// The fixed part's fields, in memory order.
    pub fields: Vec<Field>,
    /// What the tail is made of, when there is one.
    pub tail: Option<Element>,
    /// First paragraph of the type's documentation.
    pub doc: String,
}

/// What a channel's header says of a [`Schema`]: written out once per type, for channels are many.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct SchemaText {
    /// [`Schema::to_text`].
    pub text: String,
    /// [`Schema::hash`].
    pub hash: u64,
}

impl SchemaText {
    /// Writes a schema out.
    pub fn of(schema: &Schema) -> SchemaText {
        SchemaText { text: schema.to_text(), hash: schema.hash() }
    }
}

/// One named field of a [`Schema`].
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Field {
    /// Name, for example `range_m`.
    pub name: String,
    /// Distance from the beginning of the struct [byte].
    pub offset: usize,
    /// What the field holds, or each element of it.
    pub kind: Kind,
    /// Number of elements when the field is an array, row-major when of arrays; `None` for a single one.
    pub count: Option<usize>,
    /// Unit, for example `m/s`. Where elements differ, the units that occur, separated by commas.
    pub unit: Option<String>,
    /// Names of the values 0, 1, 2…, where the number stands for a choice; otherwise empty.
    pub values: Vec<String>,
    /// First paragraph of the field's documentation, without the unit.
    pub doc: String,
}

/// What a tail is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Element {
    /// Kind of the element, or of the elements of the array that it is.
    pub kind: Kind,
    /// Number of elements when each element of the tail is itself an array.
    pub count: Option<usize>,
}

/// What a field holds. Numbers are little-endian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Signed, 64 bits.
    I64,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
    /// Another struct, without a tail.
    Struct(Box<Schema>),
}

impl Schema {
    /// For the derive's output only.
    #[doc(hidden)]
    pub fn new(name: &str, size: usize, fields: Vec<Field>, tail: Option<Element>, doc: &str) -> Schema {
        Schema { name: name.to_owned(), size, fields, tail, doc: doc.to_owned() }
    }

    /// Where the tail begins; see [`tail_offset`].
    pub fn tail_offset(&self) -> usize {
        tail_offset(self.size)
    }

    /// Number of the layout: equal if and only if readers and writers mean the same by the same bytes.
    ///
    /// 64-bit FNV-1a over [`to_text`](Schema::to_text) without the `doc` keys: names, kinds, offsets, counts, units and
    /// values count, documentation does not.
    pub fn hash(&self) -> u64 {
        fnv1a(text::write(self, false).as_bytes())
    }
}

impl Field {
    /// For the derive's output only.
    #[doc(hidden)]
    pub fn of<T: Plain>(name: &str, offset: usize, unit: Option<&str>, values: &[&str], doc: &str) -> Field {
        Field {
            name: name.to_owned(),
            offset,
            kind: T::kind(),
            count: T::COUNT,
            unit: unit.map(str::to_owned),
            values: values.iter().map(|&value| value.to_owned()).collect(),
            doc: doc.to_owned(),
        }
    }

    /// Size of the whole field [byte].
    pub fn size(&self) -> usize {
        self.kind.size().saturating_mul(self.count.unwrap_or(1))
    }
}

impl Element {
    /// For the derive's output only.
    #[doc(hidden)]
    pub fn of<T: Plain>() -> Element {
        Element { kind: T::kind(), count: T::COUNT }
    }

    /// Size of one element of the tail [byte].
    pub fn size(&self) -> usize {
        self.kind.size().saturating_mul(self.count.unwrap_or(1))
    }
}

impl Kind {
    /// The numeric kinds with their names in schema texts.
    const NUMBERS: [(&'static str, Kind); 10] = [
        ("u8", Kind::U8),
        ("u16", Kind::U16),
        ("u32", Kind::U32),
        ("u64", Kind::U64),
        ("i8", Kind::I8),
        ("i16", Kind::I16),
        ("i32", Kind::I32),
        ("i64", Kind::I64),
        ("f32", Kind::F32),
        ("f64", Kind::F64),
    ];

    /// Size of one element [byte].
    pub fn size(&self) -> usize {
        match self {
            Kind::U8 | Kind::I8 => 1,
            Kind::U16 | Kind::I16 => 2,
            Kind::U32 | Kind::I32 | Kind::F32 => 4,
            Kind::U64 | Kind::I64 | Kind::F64 => 8,
            Kind::Struct(schema) => schema.size,
        }
    }

    /// Name as in schema texts: `u8`…`f64`, or the struct's name.
    pub fn name(&self) -> &str {
        match self {
            Kind::Struct(schema) => &schema.name,
            number => Kind::NUMBERS.iter().find(|(_, kind)| kind == number).map_or("", |(name, _)| name),
        }
    }

    /// Whether this is an unsigned integer, the only kind that may have named values.
    fn is_unsigned(&self) -> bool {
        matches!(self, Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64)
    }
}

/// 64-bit FNV-1a (Fowler, Noll, Vo).
pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fnv1a_gives_the_published_test_vectors() {
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
