//! What stands between bad measurements and the hand: a guard at the entry of the control step, a limiter at its exit.
//!
//! The paper assumes that sensors work. Here every measurement is judged before it is used; what cannot be trusted is
//! replaced by what the rest of the measurement says, short glitches pass without any effect on the grasp, and what lasts
//! changes the [`SafeMode`]. The table of faults, with what each leads to and how it ends, is in `docs/safety.md`.
//!
//! | file | judges |
//! |---|---|
//! | [`clock`] | the time of the measurement |
//! | [`joints`] | encoders |
//! | [`touch`] | tactile sensors |
//! | [`effort`] | all tactile sensors together, by the joint torques |
//! | [`motors`] | motors, by the torques that they give |
//! | [`odometry`] | nothing: the object's motion, as the fingers that stick to it tell it |
//! | [`frame`] | the first pose and the first normals, against the touching tips |
//! | [`pose`] | the object's pose, against that motion |
//! | [`fusion`] | nothing: the pose between the sensor's samples, and behind their noise |
//! | [`relearn`] | joint angles that are refused: whether they are right after all |
//! | [`mod@reference`] | the desired motion, and where it stands while the mode is not normal |
//! | [`guard`] | the whole measurement; the mode |
//! | [`steady`] | nothing: the wrench that goes on without feedback |
//! | [`limiter`] | the torque command |

pub mod clock;
pub mod config;
pub mod debounce;
pub mod effort;
pub mod frame;
pub mod fusion;
pub mod guard;
pub mod joints;
pub mod limiter;
pub mod motors;
pub mod odometry;
pub mod pose;
pub mod reference;
pub mod relearn;
pub mod steady;
pub mod touch;

/// Something that is not as it should be. The discriminant is the bit in [`Faults::bits`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Time is not finite, stands still, goes back or jumps ahead.
    Clock = 0,
    /// The step came late, by more than half a period.
    Late = 1,
    /// A joint angle is not finite, out of its range, or has jumped.
    Encoder = 2,
    /// A joint angle stands still while its finger moves.
    EncoderStuck = 3,
    /// The pose is not a pose, or out of reach.
    Pose = 4,
    /// The pose has jumped away from where the fingers say that the object is.
    PoseJump = 5,
    /// The pose stands still while the fingers say that the object moves.
    PoseStale = 6,
    /// A tactile reading is not finite, negative, or off the fingertip.
    Tactile = 7,
    /// A tactile sensor feels nothing although its finger presses on the object.
    TactileLost = 8,
    /// A tactile sensor reads full scale, or a constant that its finger cannot explain.
    TactileStuck = 9,
    /// The reference is not finite, or out of reach.
    Reference = 10,
    /// No finger feels the object any more.
    ContactsLost = 11,
    /// The fingers' own weight and motion leave no torque to choose.
    TorqueBox = 12,
    /// No solver certifies contact forces.
    Solver = 13,
    /// Torques have been at their limit, or the wrench undeliverable, for long.
    Saturated = 14,
    /// A measured joint torque is not finite. Its motor is not judged.
    TorqueSensor = 15,
    /// A joint is asked for a torque and gives none.
    Motor = 16,
    /// A finger has looked for the object for long.
    FingerLost = 17,
    /// The grasp has grown bad, and no finger can be freed to mend it.
    Overdue = 18,
    /// The first pose does not fit the touching fingertips: another frame, or another object.
    PoseFrame = 19,
    /// Most tactile sensors feel something else than the joint torques press with.
    TactileScale = 20,
    /// The normals of the first contacts point away from each other: axes are swapped, or a sign is wrong.
    TactileAxes = 21,
    /// The object cannot be taken again, or not be set down: it lies and is left alone, or is held where it is.
    Aground = 22,
}

impl Fault {
    /// Every fault, in the order of its bits.
    pub const ALL: [Self; 23] = [
        Self::Clock,
        Self::Late,
        Self::Encoder,
        Self::EncoderStuck,
        Self::Pose,
        Self::PoseJump,
        Self::PoseStale,
        Self::Tactile,
        Self::TactileLost,
        Self::TactileStuck,
        Self::Reference,
        Self::ContactsLost,
        Self::TorqueBox,
        Self::Solver,
        Self::Saturated,
        Self::TorqueSensor,
        Self::Motor,
        Self::FingerLost,
        Self::Overdue,
        Self::PoseFrame,
        Self::TactileScale,
        Self::TactileAxes,
        Self::Aground,
    ];

    /// The name used in logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Clock => "clock",
            Self::Late => "late",
            Self::Encoder => "encoder",
            Self::EncoderStuck => "encoder_stuck",
            Self::Pose => "pose",
            Self::PoseJump => "pose_jump",
            Self::PoseStale => "pose_stale",
            Self::Tactile => "tactile",
            Self::TactileLost => "tactile_lost",
            Self::TactileStuck => "tactile_stuck",
            Self::Reference => "reference",
            Self::ContactsLost => "contacts_lost",
            Self::TorqueBox => "torque_box",
            Self::Solver => "solver",
            Self::Saturated => "saturated",
            Self::TorqueSensor => "torque_sensor",
            Self::Motor => "motor",
            Self::FingerLost => "finger_lost",
            Self::Overdue => "overdue",
            Self::PoseFrame => "pose_frame",
            Self::TactileScale => "tactile_scale",
            Self::TactileAxes => "tactile_axes",
            Self::Aground => "aground",
        }
    }
}

/// A set of faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults(u32);

impl Faults {
    /// Adds `fault`.
    pub fn insert(&mut self, fault: Fault) {
        self.0 |= 1 << fault as u32;
    }

    /// Adds `fault` where `present`.
    pub fn insert_if(&mut self, present: bool, fault: Fault) {
        if present {
            self.insert(fault);
        }
    }

    /// True where `fault` is in the set.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u32) != 0
    }

    /// True where any of `faults` is in the set.
    pub fn any(self, faults: &[Fault]) -> bool {
        faults.iter().any(|fault| self.contains(*fault))
    }

    /// True where the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set as a number: bit k is the fault with discriminant k.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// The faults in the set.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |fault| self.contains(*fault))
    }
}

/// How the hand is driven while something is not as it should be, from the mildest to the most severe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum SafeMode {
    /// As the paper says.
    #[default]
    Normal,
    /// The object is held where it is: the reference stands, no gait begins, a sliding finger presses and is loaded. Only
    /// where the grasp itself is the fault, overdue or saturated, gaits go on: they mend it.
    Hold,
    /// As [`SafeMode::Hold`], pressing harder, on the pose that the fingers tell; without that, with the last wrench.
    Squeeze,
    /// As [`SafeMode::Hold`], with a finger whose angles and contact are both unknown let go.
    Damp,
    /// Torques fade to the fingers' own weight: nothing is held.
    Stop,
}

impl SafeMode {
    /// Every mode, from the mildest on.
    pub const ALL: [Self; 5] = [Self::Normal, Self::Hold, Self::Squeeze, Self::Damp, Self::Stop];

    /// The name used in logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Hold => "hold",
            Self::Squeeze => "squeeze",
            Self::Damp => "damp",
            Self::Stop => "stop",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_its_bit() {
        for (k, fault) in Fault::ALL.into_iter().enumerate() {
            let mut faults = Faults::default();
            faults.insert(fault);
            assert_eq!(faults.bits(), 1 << k);
            assert!(faults.iter().eq([fault]));
        }
    }
}
