//! The linear references of a law: the same joint free of friction, and stuck.

use super::parameter::{LIMIT, STATIC_LIMIT};
use super::pieces::STUCK;
use super::springs::Springs;
use super::{Law, SharedLaw};

/// Index of the stiffnesses of [`Law::springs`].
const FREE: usize = 0;
const HELD: usize = 1;

impl dyn Law + '_ {
    /// The same law with another slip limit, N, static or not; `None` if it has none.
    fn limited(&self, limit: f64) -> Option<SharedLaw> {
        let law = self.with(LIMIT, limit)?;
        Some(law.with(STATIC_LIMIT, limit).unwrap_or(law))
    }

    /// The same joint as linear springs, if the law says which.
    fn as_springs(&self, which: usize) -> Option<SharedLaw> {
        self.springs().map(|springs| Springs::shared(&springs[which]))
    }

    /// The same joint free of friction, a linear reference: its slip limit is zero, or its faces stay apart. `None` if the law has neither a
    /// limit nor faces that part.
    pub fn free(&self) -> Option<SharedLaw> {
        match self.closed() {
            Some(along) => Some(Springs::shared(&vec![0.0; along.len()])),
            None => self.as_springs(FREE).or_else(|| self.limited(0.0)),
        }
    }

    /// The same joint stuck, a linear reference: no force reaches its slip limit, and its faces stay closed. `None` as for the free reference.
    pub fn stuck(&self) -> Option<SharedLaw> {
        match self.closed() {
            Some(along) => Some(Springs::shared(&along)),
            None => self.as_springs(HELD).or_else(|| self.limited(STUCK)),
        }
    }
}
