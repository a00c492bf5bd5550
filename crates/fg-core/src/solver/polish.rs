//! Polishing of an interior-point answer on its active set.
//!
//! Clarabel's "Solved" can be 0.2 N off here: alpha3 |psi|^2 inflates the objective, so that a relative gap of 1e-8 leaves
//! room for errors in the weakly weighted internal forces. The active set is right all the same, and with it the forces
//! follow from one linear solve. This path may allocate, and is written for independence from the fast path: a dense KKT
//! matrix with full pivoting instead of the fast path's factors.

use super::kkt::{residual, Residual};
use super::qp::{dot, ForceQp, Forces, MAX_ACTIVE, WIDTH};
use nalgebra::{DMatrix, DVector};

/// Forces with the multipliers that certify them.
#[derive(Debug, Clone)]
pub struct Polished {
    /// N.
    pub f: Forces,
    /// (row, signed multiplier in N).
    pub multipliers: Vec<(usize, f64)>,
    /// KKT residual.
    pub residual: Residual,
}

const SOLVES: usize = 6;
/// A row whose part orthogonal to the rows before it is shorter than this depends on them.
const DEPENDENT: f64 = 1e-7;
/// N: a row violated by less is not added to the working set.
const FEASIBLE: f64 = 1e-10;

#[derive(Debug, Clone, Copy)]
struct Bound {
    row: usize,
    /// +1 lower, -1 upper.
    sign: f64,
    mu: f64,
}

/// The best of at most six solves on the active set that `candidate` = (row, multiplier, slack) suggests: after each, rows
/// with wrong multipliers leave and violated rows enter. Stops at a residual of `tolerance` newtons.
pub fn polish(qp: &ForceQp, candidate: &[(usize, f64, f64)], tolerance: f64) -> Option<Polished> {
    let mut active: Vec<_> = candidate
        .iter()
        .filter(|(_, mu, slack)| mu.abs() > *slack)
        .map(|(row, mu, _)| Bound { row: *row, sign: mu.signum(), mu: *mu })
        .collect();
    let mut best: Option<Polished> = None;
    for _ in 0..SOLVES {
        keep_independent(qp, &mut active);
        let Some(f) = solve_equalities(qp, &mut active) else { break };
        let multipliers: Vec<_> = active.iter().map(|b| (b.row, b.mu)).collect();
        let residual = residual(qp, &f, multipliers.iter().copied());
        if best.as_ref().is_none_or(|b| residual.worst() < b.residual.worst()) {
            best = Some(Polished { f, multipliers, residual });
        }
        if residual.worst() <= tolerance {
            break;
        }
        active.retain(|b| b.sign * b.mu > 0.0);
        add_violated(qp, &f, &mut active);
    }
    best
}

/// Drops rows that are combinations of others, those with the smallest multipliers first.
fn keep_independent(qp: &ForceQp, active: &mut Vec<Bound>) {
    active.sort_by(|a, b| b.mu.abs().total_cmp(&a.mu.abs()));
    let mut basis: Vec<Forces> = Vec::with_capacity(MAX_ACTIVE);
    active.retain(|bound| {
        let mut a = [0.0; WIDTH];
        qp.add_row(&qp.rows[bound.row], 1.0, &mut a);
        // Twice: once is not orthogonal enough for nearly dependent rows.
        for _ in 0..2 {
            for b in &basis {
                let along = dot(b, &a);
                a.iter_mut().zip(b).for_each(|(x, y)| *x -= along * y);
            }
        }
        let length = dot(&a, &a).sqrt();
        let independent = length > DEPENDENT;
        if independent {
            basis.push(a.map(|x| x / length));
        }
        independent
    });
}

/// Forces and multipliers with the working set as equalities: `[H/s -A'; A 0] [f; mu] = [h/s; bound]`.
fn solve_equalities(qp: &ForceQp, active: &mut [Bound]) -> Option<Forces> {
    let n = qp.n();
    let size = n + active.len();
    let gain = qp.alpha3 / qp.s;
    let mut K = DMatrix::<f64>::zeros(size, size);
    let mut rhs = DVector::<f64>::zeros(size);
    for i in 0..n {
        for j in 0..n {
            K[(i, j)] = gain * qp.G.iter().map(|g| g[i] * g[j]).sum::<f64>();
        }
        K[(i, i)] += 1.0;
        rhs[i] = qp.prior[i] + gain * qp.G.iter().zip(&qp.F_des).map(|(g, y)| g[i] * y).sum::<f64>();
    }
    for (k, bound) in active.iter().enumerate() {
        let row = &qp.rows[bound.row];
        let mut a = [0.0; WIDTH];
        qp.add_row(row, 1.0, &mut a);
        for i in 0..n {
            K[(n + k, i)] = a[i];
            K[(i, n + k)] = -a[i];
        }
        rhs[n + k] = if bound.sign > 0.0 { row.lower } else { row.upper };
    }
    let lu = K.clone().full_piv_lu();
    let mut x = lu.solve(&rhs)?;
    x += lu.solve(&(&rhs - &K * &x))?;
    if x.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let mut f = [0.0; WIDTH];
    f[..n].copy_from_slice(&x.as_slice()[..n]);
    for (bound, mu) in active.iter_mut().zip(&x.as_slice()[n..]) {
        bound.mu = *mu;
    }
    Some(f)
}

fn add_violated(qp: &ForceQp, f: &Forces, active: &mut Vec<Bound>) {
    for (index, row) in qp.rows.iter().enumerate() {
        let along = qp.along(row, f);
        let sign = if row.lower - along > FEASIBLE {
            1.0
        } else if along - row.upper > FEASIBLE {
            -1.0
        } else {
            continue;
        };
        if active.iter().all(|b| b.row != index) {
            active.push(Bound { row: index, sign, mu: 0.0 });
        }
    }
}
