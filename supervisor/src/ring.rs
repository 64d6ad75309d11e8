//! A channel that is looked at from beside, and may come, go and be made anew.

use runtime::Time;
use runtime::channel::{Expect, RawReader, Tree};

pub(crate) struct Ring {
    path: String,
    expect: Option<Expect>,
    reader: Option<RawReader>,
}

impl Ring {
    pub fn new(path: String, expect: Option<Expect>) -> Ring {
        Ring { path, expect, reader: None }
    }

    /// A reader of what is there now.
    pub fn reader(&mut self, tree: &Tree) -> Option<&RawReader> {
        if self.reader.as_ref().is_none_or(|ring| ring.retired() || ring.unlinked()) {
            self.reader = tree.reader(&self.path, self.expect.clone()).ok();
        }
        self.reader.as_ref()
    }

    /// The stamp of its newest sample.
    pub fn newest(&mut self, tree: &Tree) -> Option<Time> {
        let sample = self.reader(tree).and_then(|ring| ring.stamp(ring.head()).ok());
        sample.map(|sample| Time::from_nanos(sample.stamp_ns))
    }
}
