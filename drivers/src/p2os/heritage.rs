//! What a driver leaves its successor: the operator's orders, and who is at the other end of the line.
//!
//! `flags name class subclass`, the texts with their terminating NUL. Flags: 1 halted by the operator, 2 power forbidden.

use super::fields::Text;
use super::sip::Identity;
use runtime::Keepsake;

const HALTED: u8 = 1;
const FORBIDDEN: u8 = 2;

/// The keepsake, written when it changes.
pub struct Heritage {
    keepsake: Keepsake,
    /// What was written last.
    last: Option<((bool, bool), Identity)>,
}

impl Heritage {
    /// Nothing read, nothing written.
    pub fn new(keepsake: Keepsake) -> Heritage {
        Heritage { keepsake, last: None }
    }

    /// The operator's orders and the identity that a predecessor has left.
    pub fn read(&self) -> Option<((bool, bool), Identity)> {
        decode(self.keepsake.kept(&mut [0; Keepsake::MOST_BYTES]))
    }

    /// Leaves them, if they are others than the last time.
    pub fn write(&mut self, orders: (bool, bool), identity: &Identity) {
        if self.last != Some((orders, *identity)) {
            self.last = Some((orders, *identity));
            let mut bytes = [0; Keepsake::MOST_BYTES];
            let length = encode(orders, identity, &mut bytes);
            self.keepsake.keep(&bytes[..length]);
        }
    }
}

fn encode(orders: (bool, bool), identity: &Identity, out: &mut [u8; Keepsake::MOST_BYTES]) -> usize {
    out[0] = u8::from(orders.0) * HALTED + u8::from(orders.1) * FORBIDDEN;
    let mut at = 1;
    for text in [&identity.name, &identity.class, &identity.subclass] {
        let bytes = text.as_str().as_bytes();
        // Three texts of their greatest length fit.
        let Some(room) = out.get_mut(at..=at + bytes.len()) else { break };
        room[..bytes.len()].copy_from_slice(bytes);
        room[bytes.len()] = 0;
        at += bytes.len() + 1;
    }
    at
}

fn decode(bytes: &[u8]) -> Option<((bool, bool), Identity)> {
    let (flags, texts) = bytes.split_first()?;
    let mut texts = texts.split(|byte| *byte == 0).map(Text::from_bytes);
    let mut next = || texts.next().unwrap_or_default();
    let identity = Identity { name: next(), class: next(), subclass: next() };
    Some(((flags & HALTED != 0, flags & FORBIDDEN != 0), identity))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_read_as_it_was_written() {
        let long = "x".repeat(200);
        for name in ["Bessie", "", long.as_str()] {
            let identity = Identity { name: name.into(), class: "Pioneer".into(), subclass: "p3dx-sh".into() };
            for orders in [(false, false), (true, false), (false, true), (true, true)] {
                let mut bytes = [0; Keepsake::MOST_BYTES];
                let length = encode(orders, &identity, &mut bytes);
                assert_eq!(decode(&bytes[..length]), Some((orders, identity)));
            }
        }
        assert_eq!(decode(b""), None);
    }
}
