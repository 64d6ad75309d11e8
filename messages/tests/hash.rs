//! The layout hash changes with whatever changes the meaning of the bytes, and with nothing else.

use messages::{Message, Schema};

/// Declares a module whose `layout()` is the hash of the message `Probe` in it.
macro_rules! probe {
    ($module:ident { $($item:tt)* }) => {
        mod $module {
            use messages::Message;
            $($item)*

            pub fn layout() -> u64 {
                Probe::layout_hash()
            }
        }
    };
}

probe!(original {
    /// A probe.
    #[derive(Clone, Copy, Message)]
    #[repr(C)]
    #[message(tail = u16)]
    pub struct Probe {
        /// Height [m].
        height_m: f64,
        #[message(values = "off on")]
        motor: u32,
        count: u32,
        parts: [f32; 2],
    }
});

/// `differs!(field "…" instead of …)`: the whole struct again with one thing changed.
macro_rules! changed {
    ($($module:ident: [$($tail:tt)*] [$($fields:tt)*])*) => {
        $(probe!($module {
            /// A probe.
            #[derive(Clone, Copy, Message)]
            #[repr(C)]
            #[message(tail = $($tail)*)]
            pub struct Probe { $($fields)* }
        });)*
    };
}

changed! {
    documented: [u16] [#[doc = "Other words [m]."] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    attributed: [u16] [#[message(unit = "m")] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    renamed: [u16] [#[doc = "[m]"] high_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    moved: [u16] [#[doc = "[m]"] height_m: f64, count: u32, #[message(values = "off on")] motor: u32, parts: [f32; 2]]
    in_feet: [u16] [#[doc = "[ft]"] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    unitless: [u16] [height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    retyped: [u16] [#[doc = "[m]"] height_m: f64, #[message(values = "off on")] motor: u32, count: i32, parts: [f32; 2]]
    revalued: [u16] [#[doc = "[m]"] height_m: f64, #[message(values = "on off")] motor: u32, count: u32, parts: [f32; 2]]
    recounted: [u16] [#[doc = "[m]"] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 4]]
    other_tail: [i16] [#[doc = "[m]"] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
    tail_of_arrays: [[u16; 1]] [#[doc = "[m]"] height_m: f64, #[message(values = "off on")] motor: u32, count: u32, parts: [f32; 2]]
}

#[test]
fn documentation_does_not_change_the_hash() {
    assert_eq!(documented::layout(), original::layout());
    assert_eq!(attributed::layout(), original::layout());
}

#[test]
fn every_change_of_meaning_changes_the_hash() {
    let hashes = [
        original::layout(),
        renamed::layout(),
        moved::layout(),
        in_feet::layout(),
        unitless::layout(),
        retyped::layout(),
        revalued::layout(),
        recounted::layout(),
        other_tail::layout(),
        tail_of_arrays::layout(),
    ];
    for (index, hash) in hashes.iter().enumerate() {
        assert!(!hashes[..index].contains(hash), "change {index} is not seen in the hash");
    }
}

#[test]
fn a_change_within_a_nested_struct_changes_the_hash() {
    let outer = messages::Odometry::schema();
    let mut inner_renamed = outer.to_text();
    inner_renamed = inner_renamed.replace("linear_x_m_s", "linear_z_m_s");
    assert_ne!(Schema::from_text(&inner_renamed).unwrap().hash(), outer.hash());
}

#[test]
fn the_hash_survives_the_text() {
    let schema = messages::Ranges::schema();
    assert_eq!(Schema::from_text(&schema.to_text()).unwrap().hash(), messages::Ranges::layout_hash());
}

/// A message that reaches `messages` through another crate, as a robot of a user's own does.
mod through_another_crate {
    mod sinew {
        pub use ::messages;
    }

    #[derive(Clone, Copy, sinew::messages::Message)]
    #[repr(C)]
    #[message(crate = sinew::messages)]
    struct Lamp {
        #[message(values = "dark lit")]
        state: u8,
        r#type: u8,
    }

    #[test]
    fn derives_as_usual() {
        use sinew::messages::{Message, to_json_value};
        assert_eq!(Lamp::NAME, "Lamp");
        assert_eq!(to_json_value(&Lamp { state: 1, r#type: 7 }, &[]).to_string(), r#"{"state":"lit","type":7}"#);
    }
}

#[test]
fn a_message_may_be_empty() {
    #[derive(Debug, Clone, Copy, PartialEq, Message)]
    #[repr(C)]
    struct Please {}
    let schema = Please::schema();
    assert_eq!(Schema::from_text(&schema.to_text()).unwrap(), schema);
    assert_eq!(messages::to_json_value(&Please {}, &[]).to_string(), "{}");
    assert_eq!(messages::from_json_value::<Please>(&serde_json::json!({})).unwrap(), (Please {}, vec![]));
}
