//! Joint velocities that move a point of a fingertip as it is asked to: J+ = J^T (J J^T)^-1.

use super::{HandModel, HandState};
use nalgebra::{Matrix3, Vector3};

/// J J^T is made regular by this share of its mean moment.
const SINGULAR: f64 = 5e-4;

/// The damped inverse of the velocity Jacobian of one finger at one point.
#[derive(Debug, Clone, Copy)]
pub struct Inverse {
    n: usize,
    columns: [Vector3<f64>; HandModel::MAX_JOINTS],
    /// (J J^T)^-1; zero where there is none.
    moments: Matrix3<f64>,
}

impl Inverse {
    /// The inverse for the point `p_W` of the last link of finger `j`.
    pub fn new(state: &HandState, j: usize, p_W: &Vector3<f64>) -> Self {
        let mut columns = [Vector3::zeros(); HandModel::MAX_JOINTS];
        let mut JJ = Matrix3::zeros();
        let joints = state.joints(j);
        let n = joints.len();
        for (column, at) in columns.iter_mut().zip(joints) {
            *column = state.jacobian_column(at, p_W);
            JJ += *column * column.transpose();
        }
        let regular = JJ + Matrix3::identity() * (SINGULAR * JJ.trace() / 3.0);
        Self { n, columns, moments: regular.try_inverse().unwrap_or_else(Matrix3::zeros) }
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Velocity of the point where the joints turn by `qd`, m/s.
    pub fn forward(&self, qd: &[f64]) -> Vector3<f64> {
        self.columns[..self.n].iter().zip(qd).map(|(column, qd)| column * *qd).sum()
    }

    /// Writes `qd = J+ (v - J x) + x`, the joint velocities nearest to `x` that move the point at `v`, m/s and rad/s.
    pub fn near(&self, v: &Vector3<f64>, x: &[f64], qd: &mut [f64]) {
        let y = self.moments * (v - self.forward(x));
        for ((qd, x), column) in qd.iter_mut().zip(x).zip(&self.columns[..self.n]) {
            *qd = column.dot(&y) + x;
        }
    }
}
