//! Whether joint angles that are refused are right after all, for a finger that touches the object.
//!
//! An angle is refused once it has jumped. While it is, the joint may turn: with the object, or because the object is
//! pushed. When the encoder is well again its angle is then far from the last good one, and to compare it with that alone
//! would refuse it for ever. But the point of the tip that stuck to the object is still there, so the angles must put it
//! where the object has carried it. Those of an encoder that is off for good do not. What the angles said just before they
//! jumped may have been wrong already, so the point is one that has been known for a while.

use super::odometry::Odometry;
use crate::hand::HandState;
use nalgebra::{Isometry3, Point3};

/// The angles must explain the contact for this long, s ...
const TIME: f64 = 0.3;
/// ... to within `safety.relearn_distance` and this share of what the last good angles leave unexplained: a small jump moves the tip by little.
const SHARE: f64 = 0.5;

/// The point is at least so old when the angles jump, and at most twice as old, s.
const SETTLED: f64 = 0.1;

/// A point of the tip that sticks to the object, in the fingertip's frame and in the object's, m.
type Mark = (Point3<f64>, Point3<f64>);

/// What is known of one finger's contact, and whether it explains angles that are refused.
#[derive(Debug, Clone, Copy, Default)]
pub struct Refused {
    /// Where the finger stuck to the object while its angles were good. None where it did not, or has been moved on purpose
    /// since.
    mark: Option<Mark>,
    /// The mark to come, and its age, s.
    next: Option<Mark>,
    age: f64,
    /// For how long the angles have explained it, s.
    agrees: f64,
}

impl Refused {
    /// Forgets the past.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Takes a step of `elapsed` seconds in which no angle of finger `j` is refused. `state` and `odometry` are those of the
    /// last step.
    pub fn none(&mut self, j: usize, holding: bool, elapsed: f64, state: &HandState, odometry: &Odometry) {
        self.agrees = 0.0;
        if !holding {
            self.reset();
            return;
        }
        self.age += elapsed;
        if self.age > SETTLED {
            self.age = 0.0;
            self.mark = self.next;
            let p_W = Point3::from(*odometry.contact(j));
            let point = |X: &Isometry3<f64>| {
                (state.tip(j).inverse_transform_point(&p_W), X.inverse_transform_point(&p_W))
            };
            self.next = odometry.pose().filter(|_| odometry.sticks(j)).map(point);
        }
    }

    /// Takes a step of `elapsed` seconds in which angles of finger `j` are refused; true where they are right after all.
    ///
    /// `turns(i)` is what the sample has over the last good angle of the finger's joint `i`, rad; None where it has no angle.
    /// `state` and `odometry` are those of the last step, on the last good angles; `distance`, m, is what they may be off by.
    #[allow(clippy::too_many_arguments, reason = "one call, all of it needed")]
    pub fn explains(
        &mut self,
        j: usize,
        turns: impl Fn(usize) -> Option<f64>,
        holding: bool,
        elapsed: f64,
        state: &HandState,
        odometry: &Odometry,
        distance: f64,
    ) -> bool {
        let Some(X_WO) = odometry.pose() else { return false };
        if !holding {
            self.reset();
        }
        let Some((p_F, p_O)) = self.mark else { return false };
        let expected = (X_WO * p_O).coords;
        let good = (state.tip(j) * p_F).coords;
        let Some(found) = state.turned(j, turns, &good) else {
            self.agrees = 0.0;
            return false;
        };
        let agrees = (found - expected).norm() < distance.min(SHARE * (good - expected).norm());
        self.agrees = if agrees { self.agrees + elapsed } else { 0.0 };
        self.agrees > TIME
    }
}
