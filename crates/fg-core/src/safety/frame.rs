//! Whether pose, hand and tactile sensors fit together, before anything is driven by them.
//!
//! The pose and the hand must be in one frame. Neither the object's size nor its shape is known, but where the touching tips are is. They surround the object, so its
//! origin lies among them: within [`SafetyConfig::pose_spread`] times the radius of the contacts, R, their largest distance
//! from their mean. A camera that is calibrated badly, a pose in another frame or of another object does not fit, and K
//! would press with all its might through lever arms that do not exist. So nothing is driven until it does.
//!
//! Fingers that hold an object press at each other: on average their normals n point from the contacts c to their middle,
//! mean n . (c - mean c) < 0, whatever the pose is. A contact lies on its tip, one tip radius along n from the centre, so
//! normals with swapped axes or the wrong sign make that mean about a tip radius instead. Fingers that carry an object
//! from below make it zero; half a tip radius is the limit.

use super::config::SafetyConfig;
use crate::hand::{HandModel, HandState};
use crate::signals::Tactile;
use nalgebra::{Isometry3, Vector3};

/// Contacts that show where the object is; all of them on a hand that has fewer fingers.
const ENOUGH: usize = 3;

/// See the module. Allocated once.
#[derive(Debug, Clone)]
pub struct FrameGuard {
    spread: f64,
    /// The last place at which each tip felt the object, in its frame, m: a finger that is let go stays where it is.
    places: Vec<Option<Vector3<f64>>>,
    verdict: Verdict,
}

/// What the touching tips say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Verdict {
    /// Nothing against it.
    #[default]
    Fits,
    /// The pose's origin is not among the contacts.
    PoseElsewhere,
    /// The contacts' normals point away from each other.
    NormalsOutwards,
}

impl FrameGuard {
    /// A guard for `n` fingertips.
    pub fn new(n: usize, config: &SafetyConfig) -> Self {
        Self { spread: config.pose_spread, places: vec![None; n], verdict: Verdict::Fits }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.places.fill(None);
        self.verdict = Verdict::Fits;
    }

    /// What the last step found.
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Judges the pose `X_WO` against the tips that touch, or did; with too few of them the last verdict stands.
    pub fn admit(&mut self, hand: &HandModel, state: &HandState, tactile: &[Tactile], X_WO: &Isometry3<f64>) {
        for (place, reading) in self.places.iter_mut().zip(tactile) {
            if reading.f_n > 0.0 && reading.p_FC.norm() > 1e-6 {
                *place = Some(reading.p_FC);
            }
        }
        let places = &self.places;
        // Contact and normal, in W, and the tip's radius.
        let contacts = || {
            places.iter().enumerate().filter_map(|(j, place)| {
                let (X_WF, radius) = (state.tip(j), hand.tip_radius(j));
                place.map(|p_FC| {
                    let n_W = X_WF.rotation * p_FC.normalize();
                    (X_WF.translation.vector + n_W * radius, n_W, radius)
                })
            })
        };
        let count = contacts().count();
        if count < ENOUGH.min(places.len()) {
            return;
        }
        let mean = contacts().map(|(p_WC, ..)| p_WC).sum::<Vector3<f64>>() / count as f64;
        let radius = contacts().map(|(p_WC, ..)| (p_WC - mean).norm()).fold(0.0, f64::max);
        let outwards: f64 = contacts().map(|(p_WC, n_W, _)| n_W.dot(&(p_WC - mean))).sum();
        let limit: f64 = contacts().map(|(.., radius)| 0.5 * radius).sum();
        // NaN fits nothing.
        let among = (X_WO.translation.vector - mean).norm() <= self.spread * radius;
        self.verdict = match (outwards > limit, among) {
            (true, _) => Verdict::NormalsOutwards,
            (false, true) => Verdict::Fits,
            (false, false) => Verdict::PoseElsewhere,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::{Finger, Joint, Tip};

    /// `n` straight fingers round the origin, whose tips stand at `radius` + 10 mm and touch at `radius`.
    fn ring(n: usize, radius: f64) -> (HandModel, HandState, Vec<Tactile>) {
        let fingers = (0..n).map(|j| {
            let angle = std::f64::consts::TAU * j as f64 / n as f64;
            let quaternion = [(angle / 2.0).cos(), 0.0, 0.0, (angle / 2.0).sin()];
            let joint = Joint { name: "j".into(), quaternion, lower: -1.0, upper: 1.0, ..Joint::default() };
            let tip = Tip { position: [radius + 0.01, 0.0, 0.0], radius: 0.01 };
            Finger { name: format!("f{j}"), joints: vec![joint], tip }
        });
        let hand = HandModel::new(fingers.collect(), [0.0; 3]).unwrap();
        let mut state = HandState::new(&hand);
        state.update(&hand, &vec![0.0; n]);
        (hand, state, vec![Tactile { p_FC: Vector3::new(-0.01, 0.0, 0.0), f_n: 0.5 }; n])
    }

    #[test]
    fn an_origin_among_the_contacts_fits_and_one_beyond_them_does_not() {
        for (n, radius) in [(2, 0.02), (3, 0.012), (4, 0.025), (5, 0.06)] {
            let (hand, state, tactile) = ring(n, radius);
            let mut guard = FrameGuard::new(n, &SafetyConfig::default());
            let mut refuses = |x: f64, y: f64, z: f64| {
                guard.admit(&hand, &state, &tactile, &Isometry3::translation(x, y, z));
                guard.verdict() == Verdict::PoseElsewhere
            };
            assert!(
                !refuses(0.0, 0.0, 0.0)
                    && !refuses(1.2 * radius, 0.0, 0.0)
                    && !refuses(0.0, 0.0, 1.8 * radius)
            );
            assert!(
                refuses(2.4 * radius, 0.0, 0.0) && refuses(0.0, -0.3, 0.4) && refuses(f64::NAN, 0.0, 0.0)
            );
        }
    }

    #[test]
    fn normals_that_do_not_face_each_other_are_the_sensors_fault_whatever_the_pose() {
        let turns: [fn(f64) -> Vector3<f64>; 2] =
            [|r| Vector3::new(0.0, -r, 0.0), |r| Vector3::new(r, 0.0, 0.0)];
        for (n, radius) in [(3, 0.03), (4, 0.025), (5, 0.002)] {
            let (hand, state, mut tactile) = ring(n, radius);
            let mut guard = FrameGuard::new(n, &SafetyConfig::default());
            for turn in turns {
                for reading in &mut tactile {
                    reading.p_FC = turn(0.01);
                }
                for x in [0.0, 0.3] {
                    guard.admit(&hand, &state, &tactile, &Isometry3::translation(x, 0.0, 0.0));
                    assert_eq!(guard.verdict(), Verdict::NormalsOutwards);
                }
            }
            // Fingers that carry the object from below.
            for reading in &mut tactile {
                reading.p_FC = Vector3::new(0.0, 0.0, 0.01);
            }
            guard.admit(&hand, &state, &tactile, &Isometry3::translation(0.0, 0.0, 0.01));
            assert_ne!(guard.verdict(), Verdict::NormalsOutwards);
        }
    }

    #[test]
    fn too_few_contacts_change_no_verdict() {
        let (hand, state, mut tactile) = ring(4, 0.025);
        let mut guard = FrameGuard::new(4, &SafetyConfig::default());
        tactile[2].f_n = 0.0;
        tactile[3].f_n = 0.0;
        let far = Isometry3::translation(0.2, 0.0, 0.0);
        guard.admit(&hand, &state, &tactile, &far);
        assert!(guard.verdict() == Verdict::Fits, "two of four");
        tactile[2].f_n = 0.1;
        guard.admit(&hand, &state, &tactile, &far);
        assert!(guard.verdict() == Verdict::PoseElsewhere);
        for reading in &mut tactile {
            reading.f_n = 0.0;
        }
        guard.admit(&hand, &state, &tactile, &far);
        assert!(
            guard.verdict() == Verdict::PoseElsewhere,
            "a hand that has let go still knows where it touched"
        );
        guard.admit(&hand, &state, &tactile, &Isometry3::translation(0.01, 0.0, 0.0));
        assert!(guard.verdict() == Verdict::Fits);
        guard.reset();
        guard.admit(&hand, &state, &tactile, &far);
        assert!(guard.verdict() == Verdict::Fits);
    }
}
