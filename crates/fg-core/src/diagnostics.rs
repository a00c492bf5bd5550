//! What a control step decided, and why, as plain numbers.

use crate::gait::planner::GaitRate;
use crate::gait::quality::Quality;
use crate::gait::supervisor::{GaitEnd, Phase};
use crate::manipulation::force::{ForceStatus, SolverCounters, SolverUsed};
use crate::regrasp::phase as regrasp;
use crate::safety::{Faults, SafeMode};
use crate::signals::Reference;
use nalgebra::{DVector, Isometry3, Vector6};

/// The figures of one control step. Allocated once, overwritten by each step; holds no time measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostics {
    /// Phase of the gait.
    pub phase: Phase,
    /// Finger whose gait is under way.
    pub free_finger: Option<usize>,
    /// Phase of regrasping.
    pub regrasp: regrasp::Phase,
    /// Times that the object was set down.
    pub set_downs: u64,
    /// What the object is to do now: what is asked, less the turn that it missed while it lay. Its pose is in the log.
    pub governed: Reference,
    /// Gaits begun since the start.
    pub gaits: u64,
    /// Why the last gait ended.
    pub last_end: GaitEnd,
    /// Grasp quality, eq. (1).
    pub quality: Quality,
    /// delta_Q; NaN before the first grasp.
    pub threshold: f64,
    /// Value of the gait LP, zero outside a slide.
    pub rate: GaitRate,
    /// Pose error against the filtered reference [m; rad].
    pub e: Vector6<f64>,
    /// Desired wrench [N; N m] at Oo in W.
    pub F_des: Vector6<f64>,
    /// What the force optimiser could not deliver: Psi = F_des - G f.
    pub psi: Vector6<f64>,
    /// Contact forces in their contact frames, N.
    pub f: DVector<f64>,
    /// Measured normal forces, N.
    pub f_n: DVector<f64>,
    /// Heights of the contacts over the first grasp's mean, in the object's frame, m.
    pub heights: DVector<f64>,
    /// Slip speeds of the holding fingers, m/s.
    pub slip: DVector<f64>,
    /// Times that slip has lowered the assumed friction.
    pub slips: u64,
    /// Desired joint velocities of the free finger, rad/s; as long as the finger with the most joints, zero behind the free
    /// one's last.
    pub qd_des: DVector<f64>,
    /// Torque command, N m.
    pub tau: DVector<f64>,
    /// Whether the force optimum is certified.
    pub status: ForceStatus,
    /// Who solved the QP.
    pub solver: SolverUsed,
    /// KKT residual of the QP, N, of held forces too; certified up to `force.tolerance` times the largest force, and taken as
    /// it is up to 100 times that where rounding or an interior point allow no better.
    pub kkt: f64,
    /// Iterations of the QP solver.
    pub iterations: usize,
    /// Answers of each solver since the start, and how often and why one passed the QP on to the next. Not in the log,
    /// which has each step's solver and residual.
    pub solver_counts: SolverCounters,
    /// Friction coefficient that the force optimiser assumes.
    pub friction: f64,
    /// What was wrong with this step's measurement, or with the step itself.
    pub faults: Faults,
    /// How the hand was driven because of it.
    pub safe_mode: SafeMode,
}

impl Diagnostics {
    /// Diagnostics for fingers with `counts` joints, all zero.
    pub fn new(counts: &[usize]) -> Self {
        let zeros = DVector::zeros;
        let n_fingers = counts.len();
        Self {
            phase: Phase::Hold,
            free_finger: None,
            regrasp: regrasp::Phase::Idle,
            set_downs: 0,
            governed: Reference { X_WD: Isometry3::identity(), V_WD: Vector6::zeros() },
            gaits: 0,
            last_end: GaitEnd::None,
            quality: Quality::default(),
            threshold: f64::NAN,
            rate: GaitRate { Q_dot: 0.0, feasible: true },
            e: Vector6::zeros(),
            F_des: Vector6::zeros(),
            psi: Vector6::zeros(),
            f: zeros(3 * n_fingers),
            f_n: zeros(n_fingers),
            heights: zeros(n_fingers),
            slip: zeros(n_fingers),
            slips: 0,
            qd_des: zeros(counts.iter().copied().max().unwrap_or(0)),
            tau: zeros(counts.iter().sum()),
            status: ForceStatus::Solved,
            solver: SolverUsed::ActiveSet,
            kkt: 0.0,
            iterations: 0,
            solver_counts: SolverCounters::default(),
            friction: 0.0,
            faults: Faults::default(),
            safe_mode: SafeMode::Normal,
        }
    }

    /// Shows every figure in a fixed order: a name, and one value or a vector of them.
    fn visit(&self, mut show: impl FnMut(&'static str, &[f64])) {
        show("phase", &[f64::from(self.phase as u8)]);
        show("free_finger", &[self.free_finger.map_or(-1.0, |k| k as f64)]);
        show("regrasp", &[f64::from(self.regrasp as u8)]);
        show("set_downs", &[self.set_downs as f64]);
        let (p, q) = (self.governed.X_WD.translation.vector, self.governed.X_WD.rotation.coords);
        show("governed", &[p.x, p.y, p.z, q.w, q.x, q.y, q.z]);
        show("gaits", &[self.gaits as f64]);
        show("gait_end", &[f64::from(self.last_end as u8)]);
        show("Q", &[self.quality.Q]);
        show("Q_o", &[self.quality.Q_o]);
        show("Q_h", &[self.quality.Q_h]);
        show("threshold", &[self.threshold]);
        show("Q_dot", &[self.rate.Q_dot]);
        show("lp_feasible", &[f64::from(u8::from(self.rate.feasible))]);
        show("e", self.e.as_slice());
        show("F_des", self.F_des.as_slice());
        show("psi", self.psi.as_slice());
        show("f", self.f.as_slice());
        show("f_n", self.f_n.as_slice());
        show("height", self.heights.as_slice());
        show("slip", self.slip.as_slice());
        show("slips", &[self.slips as f64]);
        show("qd_des", self.qd_des.as_slice());
        show("tau_des", self.tau.as_slice());
        show("status", &[f64::from(self.status as u8)]);
        show("solver", &[f64::from(self.solver as u8)]);
        show("kkt", &[self.kkt]);
        show("iterations", &[self.iterations as f64]);
        show("friction", &[self.friction]);
        show("faults", &[f64::from(self.faults.bits())]);
        show("safe_mode", &[f64::from(self.safe_mode as u8)]);
    }

    /// Names of the numbers that [`Diagnostics::row`] writes, in order, for fingers with `counts` joints; elements of vectors
    /// end in their index.
    pub fn columns(counts: &[usize]) -> Vec<String> {
        let mut names = Vec::new();
        Self::new(counts).visit(|name, values| match values.len() {
            1 => names.push(name.to_owned()),
            n => names.extend((0..n).map(|i| format!("{name}_{i}"))),
        });
        names
    }

    /// Appends every figure of the step to `row`.
    pub fn row(&self, row: &mut Vec<f64>) {
        self.visit(|_, values| row.extend_from_slice(values));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_as_many_numbers_as_columns() {
        for counts in [&[3; 4][..], &[1, 1], &[1, 7, 2, 4, 3]] {
            let mut row = Vec::new();
            Diagnostics::new(counts).row(&mut row);
            assert_eq!(row.len(), Diagnostics::columns(counts).len());
        }
    }
}
