//! Whether any finger can be spared: asked once, one finger a step, by the force optimiser without it.

/// The answers so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spares {
    /// Fingers that were asked for, in order, and whether one of them can be spared.
    asked: usize,
    found: bool,
    /// The next of them is to be asked for in this step.
    open: bool,
}

impl Spares {
    /// Asks on in this step, `now`, while none of the `n` fingers was found that can be spared.
    pub fn ask(&mut self, now: bool, n: usize) {
        self.open = now && !self.found && self.asked < n;
    }

    /// The finger of which [`Spares::answer`] is to be told whether the others can hold without it.
    pub fn doubt(&self) -> Option<usize> {
        self.open.then_some(self.asked)
    }

    /// Takes note of whether the finger in doubt can be spared.
    pub fn answer(&mut self, spared: bool) {
        self.asked += 1;
        self.found |= spared;
        self.open = false;
    }

    /// True where none of `n` fingers can be spared.
    pub fn none(&self, n: usize) -> bool {
        !self.found && self.asked == n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_finger_is_asked_for_once_until_one_can_be_spared() {
        for spared in [None, Some(0), Some(2)] {
            let mut spares = Spares::default();
            let mut asked = 0;
            for _ in 0..10 {
                spares.ask(true, 3);
                if let Some(k) = spares.doubt() {
                    assert_eq!(k, asked);
                    spares.answer(Some(k) == spared);
                    asked += 1;
                }
            }
            assert_eq!(asked, spared.map_or(3, |k| k + 1));
            assert_eq!(spares.none(3), spared.is_none());
        }
        let mut spares = Spares::default();
        spares.ask(false, 3);
        assert!(spares.doubt().is_none() && !spares.none(3));
    }
}
