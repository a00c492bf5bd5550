//! Equalities through the null space of the rows: the careful way.
#![allow(clippy::needless_range_loop)] // factorisations read as in the books with indices

use super::qp::{dot, ForceQp, Forces, WIDTH};
use super::working_set::{Active, Entry, Equalities, Weights, WorkingSet, ROOM};

/// `A' = Q R` of the rows held, by Gram and Schmidt with reorthogonalisation.
///
/// The forces are a point on the rows plus steps in their null space, which no large multipliers pass through, whatever
/// alpha3 / s. Several times the cost of [`super::schur::SchurFactors`]: for what those leave undecided, and to polish an
/// interior-point answer independently of them.
#[derive(Debug, Clone, Default)]
pub struct NullSpaceFactors {
    set: WorkingSet,
    Q: [Forces; ROOM],
    /// `R[k]` is column k: `sign a_k = sum_j R[k][j] Q_j`.
    R: [Weights; ROOM],
    N: [Forces; 6],
    M: [[f64; 6]; 6],
    f: Forces,
    z: [f64; 6],
}

impl NullSpaceFactors {
    /// A row whose part orthogonal to the rows held is shorter than this depends on them.
    const DEPENDENT: f64 = 1e-9;

    /// x := x less its part along the first `len` rows of Q, whose coefficients are added to `along`.
    fn project(&self, x: &mut Forces, len: usize, along: &mut Weights) {
        for _ in 0..2 {
            for (q, c) in self.Q[..len].iter().zip(along.iter_mut()) {
                let part = dot(q, x);
                *c += part;
                for (x, q) in x.iter_mut().zip(q) {
                    *x -= part * q;
                }
            }
        }
    }

    /// Column `at` of Q and R from the row written there; false if it depends on the columns before.
    fn factor_column(&mut self, qp: &ForceQp, at: usize, w: &Active) -> bool {
        let mut a = [0.0; WIDTH];
        qp.add_row(&qp.rows[w.row], w.sign, &mut a);
        let mut column = [0.0; ROOM];
        self.project(&mut a, at, &mut column);
        let length = dot(&a, &a).sqrt();
        column[at] = length;
        self.R[at] = column;
        self.Q[at] = a.map(|x| x / length);
        length > Self::DEPENDENT
    }

    /// x := R^-1 x over the first `len` columns.
    fn back_substitute(&self, x: &mut Weights, len: usize) {
        for k in (0..len).rev() {
            x[k] /= self.R[k][k];
            for j in 0..k {
                x[j] -= self.R[k][j] * x[k];
            }
        }
    }

    /// A point on the rows, the one nearest zero.
    fn point(&self, qp: &ForceQp) -> Forces {
        // R' z = bounds, f = Q z.
        let mut f = [0.0; WIDTH];
        let mut z = [0.0; ROOM];
        for (k, w) in self.set.active().iter().enumerate() {
            let mut sum = w.sign * w.bound(qp);
            for j in 0..k {
                sum -= self.R[k][j] * z[j];
            }
            z[k] = sum / self.R[k][k];
            for (f, q) in f.iter_mut().zip(&self.Q[k]) {
                *f += z[k] * q;
            }
        }
        f
    }

    /// Projects G into the rows' null space, and factors `s I + alpha3 N N' = M M'`.
    fn factor_null_space(&mut self, qp: &ForceQp) {
        let mut unused = [0.0; ROOM];
        for i in 0..6 {
            let mut row = qp.G[i];
            self.project(&mut row, self.set.len(), &mut unused);
            self.N[i] = row;
            for j in 0..=i {
                let mut sum = qp.alpha3 * dot(&self.N[i], &self.N[j]);
                if i == j {
                    sum += qp.s;
                }
                for k in 0..j {
                    sum -= self.M[i][k] * self.M[j][k];
                }
                self.M[i][j] = if i == j { sum.sqrt() } else { sum / self.M[j][j] };
            }
        }
    }

    /// Newton's step to the minimiser on the rows, for the forces and for z, the wrench's pull on the object over s:
    ///
    /// ```text
    /// f - prior - G' z = sum mu_i a_i,    (s / alpha3) z = F_des - G f
    /// ```
    ///
    /// z is an unknown of its own because alpha3 / s times a difference of nearly equal wrenches would be noise.
    fn step(&mut self, qp: &ForceQp) {
        // d = -x + N' y, x = P (f - prior) - N' z,  (s I + alpha3 N N') y = alpha3 (F_des - G f + N x) - s z.
        let mut x = self.f;
        for (x, prior) in x.iter_mut().zip(&qp.prior) {
            *x -= prior;
        }
        self.project(&mut x, self.set.len(), &mut [0.0; ROOM]);
        for (n, z) in self.N.iter().zip(&self.z) {
            for (x, n) in x.iter_mut().zip(n) {
                *x -= z * n;
            }
        }
        let psi = qp.psi(&self.f);
        let mut y = [0.0; 6];
        for i in 0..6 {
            let mut sum = qp.alpha3 * (psi[i] + dot(&self.N[i], &x)) - qp.s * self.z[i];
            for k in 0..i {
                sum -= self.M[i][k] * y[k];
            }
            y[i] = sum / self.M[i][i];
        }
        for i in (0..6).rev() {
            for k in i + 1..6 {
                y[i] -= self.M[k][i] * y[k];
            }
            y[i] /= self.M[i][i];
        }
        for (n, y) in self.N.iter().zip(&y) {
            for (x, n) in x.iter_mut().zip(n) {
                *x -= y * n;
            }
        }
        // y can be large, N is only orthogonal to the rows within rounding: without this the forces drift off the rows.
        self.project(&mut x, self.set.len(), &mut [0.0; ROOM]);
        for (f, x) in self.f.iter_mut().zip(&x) {
            *f -= x;
        }
        for (z, y) in self.z.iter_mut().zip(&y) {
            *z += y;
        }
    }
}

impl Equalities for NullSpaceFactors {
    fn set(&self) -> &WorkingSet {
        &self.set
    }

    fn set_mut(&mut self) -> &mut WorkingSet {
        &mut self.set
    }

    fn prepare(&mut self, _qp: &ForceQp) {
        self.set.clear();
    }

    fn add(&mut self, qp: &ForceQp, candidate: Active) -> Entry {
        let at = self.set.len();
        self.set.propose(candidate);
        let independent = self.factor_column(qp, at, &candidate);
        if independent && at < qp.n_free() {
            self.set.accept();
            return Entry::Accepted;
        }
        let mut p = self.R[at];
        self.back_substitute(&mut p, at);
        for x in &mut p[..at] {
            *x = -*x;
        }
        p[at] = 1.0;
        Entry::Dependent(p)
    }

    fn remove(&mut self, qp: &ForceQp, k: usize) {
        self.set.remove(k);
        for at in k..self.set.len() {
            let w = self.set.active()[at];
            // Rows of an independent set stay independent.
            self.factor_column(qp, at, &w);
        }
    }

    fn multipliers(&mut self, qp: &ForceQp) -> Weights {
        self.factor_null_space(qp);
        self.f = self.point(qp);
        // One step would do but for rounding.
        self.z = [0.0; 6];
        for _ in 0..3 {
            self.step(qp);
        }
        let mut pull = self.f;
        for (x, prior) in pull.iter_mut().zip(&qp.prior) {
            *x -= prior;
        }
        for (g, z) in qp.G.iter().zip(&self.z) {
            for (x, g) in pull.iter_mut().zip(g) {
                *x -= z * g;
            }
        }
        let mut mu = [0.0; ROOM];
        let len = self.set.len();
        for (x, q) in mu[..len].iter_mut().zip(&self.Q) {
            *x = dot(q, &pull);
        }
        self.back_substitute(&mut mu, len);
        mu
    }

    fn forces(&self, _qp: &ForceQp) -> Forces {
        self.f
    }

    /// None to speak of: the forces come from no multipliers.
    fn rounding(&self) -> f64 {
        0.0
    }

    /// Nothing: the forces come from no multipliers.
    fn refine(&mut self, _qp: &ForceQp, _f: &mut Forces) {}
}
