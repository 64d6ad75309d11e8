//! Pictures.

use crate::Message;

/// How a picture's bytes are to be read (names after sensor_msgs/Image).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Encoding {
    /// One byte per pixel.
    Mono8 = 0,
    /// Red, green, blue, a byte each.
    Rgb8 = 1,
    /// Blue, green, red, a byte each.
    Bgr8 = 2,
    /// Two pixels in four bytes: Y U Y V.
    Yuyv = 3,
    /// A JPEG file.
    Jpeg = 4,
}

/// A picture; the tail holds its bytes, row after row (sensor_msgs/Image).
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct Image {
    /// Rows [px].
    pub height_px: u32,
    /// Columns [px].
    pub width_px: u32,
    /// Bytes from one row to the next; 0 when compressed [byte].
    pub step_bytes: u32,
    /// How to read the bytes; see [`Encoding`].
    #[message(values = "mono8 rgb8 bgr8 yuyv jpeg")]
    pub encoding: u32,
}
