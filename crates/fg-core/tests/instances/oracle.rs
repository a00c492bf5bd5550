//! How far forces can be from the minimiser of eq. (8): computed from the problem alone, with none of the solvers' code.

use super::Instance;
use fg_core::friction::FrictionPyramid;
use nalgebra::{DMatrix, DVector};

/// What an answer is worth.
#[derive(Debug, Clone, Copy)]
pub struct Verdict {
    /// Largest violation of a constraint, N (torques divided by the length of their row).
    pub violation: f64,
    /// Bound on the distance to the minimiser, N, were violations and slacks of rows below `NEAR` zero.
    pub distance: f64,
}

/// Rows with less slack, N, may carry a multiplier.
const NEAR: f64 = 1e-8;

/// N: a bound on the distance to the minimiser that rounding does not inflate where alpha3 >> alpha1: with H = L L' the
/// objective's Hessian, multipliers >= 0 of rows with less slack than `near` leave a part r of the gradient, and f is within
/// |L^-1 r| / (2 (alpha1 + alpha2))^1/2 of the minimiser.
pub fn distance_in_energy(
    instance: &Instance,
    pyramids: &[FrictionPyramid],
    alpha: [f64; 3],
    f: &DVector<f64>,
    near: f64,
) -> f64 {
    let (_, tight, pull) = conditions(instance, pyramids, alpha, f, near);
    let n = f.len();
    let mut G = instance.G.clone();
    for (i, cap) in instance.f_normal_max.iter().enumerate().filter(|(_, cap)| **cap <= 0.0) {
        G.columns_mut(3 * i, 3).fill(0.0 * cap);
    }
    let s = 2.0 * (alpha[0] + alpha[1]);
    let H = DMatrix::identity(n, n) * s + G.transpose() * &G * (2.0 * alpha[2]);
    let L = H.cholesky().expect("positive definite").l();
    let solved = |x: &DVector<f64>| L.solve_lower_triangular(x).expect("regular");
    let columns: Vec<_> = tight.iter().map(solved).collect();
    nnls_residual(&columns, &solved(&pull)) / s.sqrt()
}

/// Judges forces `f`. The objective is strongly convex with modulus 2 (alpha1 + alpha2), so that a gradient which
/// multipliers >= 0 of tight rows leave unbalanced by r puts f within r / (2 (alpha1 + alpha2)) of the minimiser.
pub fn judge(
    instance: &Instance,
    pyramids: &[FrictionPyramid],
    alpha: [f64; 3],
    f: &DVector<f64>,
) -> Verdict {
    let (violation, tight, pull) = conditions(instance, pyramids, alpha, f, NEAR);
    Verdict { violation, distance: nnls_residual(&tight, &pull) / (2.0 * (alpha[0] + alpha[1])) }
}

/// Largest violation, rows with less slack than `near`, and the gradient of the objective.
fn conditions(
    instance: &Instance,
    pyramids: &[FrictionPyramid],
    alpha: [f64; 3],
    f: &DVector<f64>,
    near: f64,
) -> (f64, Vec<DVector<f64>>, DVector<f64>) {
    let free: Vec<bool> = instance.f_normal_max.iter().map(|cap| *cap > 0.0).collect();
    let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
    for (contact, pyramid) in pyramids.iter().enumerate() {
        let mut push = |x: [f64; 3], bound: f64| {
            let mut row = DVector::zeros(f.len());
            row.rows_mut(3 * contact, 3).copy_from_slice(&x);
            rows.push((row, bound));
        };
        for facet in pyramid.facets() {
            push([facet.x, facet.y, facet.z], 0.0);
        }
        if instance.f_normal_max[contact].is_finite() {
            push([0.0, 0.0, -1.0], -instance.f_normal_max[contact].max(0.0));
        }
    }
    for (joint, column) in instance.J.column_iter().enumerate() {
        let mut row = column.clone_owned();
        for (i, x) in row.iter_mut().enumerate() {
            if !free[i / 3] {
                *x = 0.0;
            }
        }
        let length = row.norm();
        if length > 1e-12 {
            rows.push((&row / length, instance.tau_min[joint] / length));
            rows.push((-&row / length, -instance.tau_max[joint] / length));
        }
    }
    let mut violation = 0.0_f64;
    let mut tight = Vec::new();
    for (row, bound) in &rows {
        let slack = row.dot(f) - bound;
        violation = violation.max(-slack);
        if slack < near {
            tight.push(row.clone());
        }
    }
    let [a1, a2, a3] = alpha;
    let psi = DVector::from_column_slice(instance.F_des.as_slice()) - &instance.G * f;
    let mut pull =
        f * (2.0 * a1) + (f - &instance.f_prev) * (2.0 * a2) - instance.G.transpose() * psi * (2.0 * a3);
    for (i, x) in pull.iter_mut().enumerate() {
        if !free[i / 3] {
            violation = violation.max(f[i].abs());
            *x = 0.0;
        }
    }
    // The rows' parts at pinned contacts push nothing.
    for row in &mut tight {
        for (i, x) in row.iter_mut().enumerate() {
            if !free[i / 3] {
                *x = 0.0;
            }
        }
    }
    (violation, tight, pull)
}

/// min |A x - b| over x >= 0, columns of A given: the residual, by Lawson and Hanson's method.
fn nnls_residual(columns: &[DVector<f64>], b: &DVector<f64>) -> f64 {
    let mut x = vec![0.0; columns.len()];
    let rest = |x: &[f64]| columns.iter().zip(x).fold(b.clone(), |rest, (a, x)| rest - a * *x);
    let mut inside: Vec<usize> = Vec::new();
    // Columns that rounding alone made look useful.
    let mut useless: Vec<usize> = Vec::new();
    for _ in 0..100 * (columns.len() + 1) {
        let now = rest(&x);
        let best = (0..columns.len())
            .filter(|k| !inside.contains(k) && !useless.contains(k))
            .map(|k| (k, columns[k].dot(&now)))
            .max_by(|p, q| p.1.total_cmp(&q.1));
        let Some((entering, gain)) = best else { break };
        if gain <= 0.0 {
            break;
        }
        let before = (x.clone(), inside.clone());
        inside.push(entering);
        while let Some(target) = least_squares(columns, &inside, b) {
            let blocked = inside
                .iter()
                .zip(&target)
                .filter(|(_, t)| **t <= 0.0)
                .map(|(k, t)| (*k, x[*k] / (x[*k] - t)))
                .min_by(|p, q| p.1.total_cmp(&q.1));
            let step = blocked.map_or(1.0, |(_, step)| step);
            for (k, t) in inside.iter().zip(&target) {
                x[*k] += step * (t - x[*k]);
            }
            let Some((leaving, _)) = blocked else { break };
            inside.retain(|k| *k != leaving);
            x[leaving] = 0.0;
        }
        if rest(&x).norm() < now.norm() {
            useless.clear();
        } else {
            (x, inside) = before;
            useless.push(entering);
        }
    }
    rest(&x).norm()
}

/// Least squares on some columns, refined; no answer where they are dependent. By QR: nalgebra's SVD of such columns was
/// seen to be wrong in the tenth digit.
fn least_squares(columns: &[DVector<f64>], inside: &[usize], b: &DVector<f64>) -> Option<Vec<f64>> {
    if inside.len() > b.len() {
        return None;
    }
    let A = DMatrix::from_fn(b.len(), inside.len(), |i, k| columns[inside[k]][i]);
    let qr = A.clone().qr();
    let (Q, R) = (qr.q(), qr.r());
    if R.diagonal().iter().any(|r| r.abs() < 1e-9) {
        return None;
    }
    let mut x = DVector::zeros(inside.len());
    for _ in 0..3 {
        x += R.solve_upper_triangular(&(Q.transpose() * (b - &A * &x)))?;
    }
    Some(x.iter().copied().collect())
}
