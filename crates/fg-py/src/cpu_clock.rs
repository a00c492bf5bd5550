//! What a piece of work costs: thread CPU time, which other processes on the machine do not distort, and allocations.

use crate::allocations;
use rustix::time::{clock_gettime, ClockId};

/// A running measurement.
pub struct ThreadClock {
    ns: u64,
    allocations: u64,
}

fn now_ns() -> u64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    u64::try_from(time.tv_sec).unwrap_or(0) * 1_000_000_000 + u64::try_from(time.tv_nsec).unwrap_or(0)
}

impl ThreadClock {
    /// Starts measuring.
    pub fn start() -> Self {
        Self { allocations: allocations::count(), ns: now_ns() }
    }

    /// Thread CPU time since the start, ns.
    pub fn elapsed_ns(&self) -> u64 {
        now_ns().saturating_sub(self.ns)
    }

    /// Heap allocations of this thread since the start.
    pub fn allocations(&self) -> u64 {
        allocations::count() - self.allocations
    }
}
