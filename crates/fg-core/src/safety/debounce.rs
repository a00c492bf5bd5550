//! A condition that must last before it counts, and be gone for a while before it stops counting.

/// See the module. Times in s.
#[derive(Debug, Clone, Default)]
pub struct Debounce {
    present: f64,
    absent: f64,
    confirmed: bool,
}

impl Debounce {
    /// Takes this step: `present` for `dt` seconds more, or not. True while the condition counts.
    ///
    /// It counts once it has been present for `confirm`, time without it counting against, until it has been absent for
    /// `clear` without a break.
    pub fn update(&mut self, present: bool, dt: f64, confirm: f64, clear: f64) -> bool {
        if present {
            self.absent = 0.0;
            // Bounded, so that a fault of an hour is not remembered for an hour.
            self.present = (self.present + dt).min(confirm + dt);
            self.confirmed |= self.present > confirm;
        } else {
            self.absent += dt;
            self.present = (self.present - dt).max(0.0);
            self.confirmed &= self.absent < clear;
        }
        self.confirmed
    }

    /// True while the condition counts.
    pub fn confirmed(&self) -> bool {
        self.confirmed
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_when_it_lasts_and_stops_when_gone() {
        let mut debounce = Debounce::default();
        let mut step = |present: bool| debounce.update(present, 0.002, 0.01, 0.1);
        assert!((0..5).all(|_| !step(true)));
        assert!(step(true));
        assert!((0..49).all(|_| step(false)));
        assert!(!(0..2).all(|_| step(false)));
        // Every other sample missing is not a failure.
        assert!((0..1000).all(|k| !step(k % 2 == 0)));
    }
}
