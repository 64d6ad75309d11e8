//! SICK LMS 2xx: telegrams, without any session yet.
//!
//! | file | what |
//! |---|---|
//! | [`protocol`] | frame, sum, commands, scans |
//! | [`framer`] | telegrams in a stream of bytes |

pub mod framer;
pub mod protocol;
