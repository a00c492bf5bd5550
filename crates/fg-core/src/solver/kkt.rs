//! The optimality check that an answer of any solver must pass.
//!
//! An answer is certified where its [`Residual`] is at most `tolerance` times [`ForceQp::size`], the answer's largest force:
//! a relative error, whatever the unit of force and the weights.

use super::qp::{dot, ForceQp, Forces, WIDTH};

/// How far forces and multipliers are from satisfying the KKT conditions of [`ForceQp`]. Everything is in newtons.
///
/// With H = s I + alpha3 G'G, s = alpha1 + alpha2, and signed multipliers mu_i (positive: the lower bound pushes,
/// negative: the upper bound):
///
/// - `stationarity`: how far the gradient `r = f - prior - (alpha3/s) G'(F_des - G f) - sum mu_i a_i` alone can move the
///   minimiser, at most. `|r|_2`, as H >= s I, where that is enough to certify; else the tighter
///   `(r' s H^-1 r)^1/2`, see [`distance`], for the multipliers whose last digits suit r best: with alpha3 >> s rounding
///   makes much of r, and little of it moves f.
/// - `primal` = largest violation of a row.
/// - `complementarity` = largest `min(|mu_i|, |slack of the bound that mu_i's sign names|)`. A multiplier that pushes
///   at a bound which does not exist counts in full, so that wrong dual signs are covered.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Residual {
    /// N.
    pub stationarity: f64,
    /// N.
    pub primal: f64,
    /// N.
    pub complementarity: f64,
}

impl Residual {
    /// The largest of the three, N; infinite where any number is not finite.
    pub fn worst(&self) -> f64 {
        let sum = self.stationarity + self.primal + self.complementarity;
        if sum.is_finite() {
            self.stationarity.max(self.primal).max(self.complementarity)
        } else {
            f64::INFINITY
        }
    }

    /// True where all residuals are within `tolerance`, N, but for a stationarity that rounding (N, see [`rounding`]) would
    /// make of an exact solution, up to `loose`: such forces minimise the problem with its numbers' last digits changed.
    pub fn certifies(&self, tolerance: f64, loose: f64, rounding: impl Fn() -> f64) -> bool {
        let worst = self.worst();
        worst <= tolerance
            || (worst <= loose
                && self.primal.max(self.complementarity) <= tolerance
                && self.stationarity <= rounding())
    }
}

/// N: what rounding makes of the stationarity of an exact solution. A residual below it says nothing against it.
pub fn rounding(qp: &ForceQp, f: &Forces, multipliers: impl Iterator<Item = (usize, f64)>) -> f64 {
    let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let G = qp.G.iter().map(|g| dot(g, g)).sum::<f64>().sqrt();
    let pull = qp.alpha3 / qp.s * G * (length(&qp.F_des) + G * length(f));
    let push: f64 = multipliers.map(|(_, mu)| mu.abs()).sum();
    8.0 * f64::EPSILON * (pull + push)
}

/// Largest violation of a row by `f`, N.
pub fn violation(qp: &ForceQp, f: &Forces) -> f64 {
    let mut worst = 0.0_f64;
    for row in &qp.rows {
        let along = qp.along(row, f);
        let below = row.lower - along;
        let above = along - row.upper;
        // Not f64::max, whose care for NaN costs a third of this function.
        let missed = if below > above { below } else { above };
        if missed > worst {
            worst = missed;
        }
    }
    worst
}

/// Gradient of the Lagrangian over s, N: `f - prior - (alpha3/s) G'(F_des - G f) - sum mu_i a_i`.
pub fn gradient(qp: &ForceQp, f: &Forces, multipliers: impl Iterator<Item = (usize, f64)>) -> Forces {
    let psi = qp.psi(f);
    let gain = qp.alpha3 / qp.s;
    let mut gradient = [0.0; WIDTH];
    for (row, y) in qp.G.iter().zip(&psi) {
        for (r, g) in gradient.iter_mut().zip(row) {
            *r -= gain * y * g;
        }
    }
    for ((r, x), p) in gradient.iter_mut().zip(f).zip(&qp.prior) {
        *r += x - p;
    }
    for (index, mu) in multipliers {
        qp.add_row(&qp.rows[index], -mu, &mut gradient);
    }
    gradient
}

/// N: `(r' s H^-1 r)^1/2`, how far a gradient r (over s, N) can move the minimiser.
///
/// The minimiser of a quadratic on a convex set moves by at most |r| in the norms of H^-1 and H, and H >= s I. By the matrix
/// inversion lemma `r' s H^-1 r = |r|^2 - alpha3 |M^-1 G r|^2`, `M M' = s I + alpha3 G G'`.
#[allow(clippy::needless_range_loop)] // factorisations read as in the books with indices
pub fn distance(qp: &ForceQp, r: &Forces) -> f64 {
    let mut M = [[0.0; 6]; 6];
    let mut rest = dot(r, r);
    let mut y = [0.0; 6];
    for i in 0..6 {
        for j in 0..=i {
            let mut sum = qp.alpha3 * dot(&qp.G[i], &qp.G[j]);
            if i == j {
                sum += qp.s;
            }
            for k in 0..j {
                sum -= M[i][k] * M[j][k];
            }
            M[i][j] = if i == j { sum.sqrt() } else { sum / M[j][j] };
        }
        let mut sum = dot(&qp.G[i], r);
        for k in 0..i {
            sum -= M[i][k] * y[k];
        }
        y[i] = sum / M[i][i];
        rest -= qp.alpha3 * y[i] * y[i];
    }
    // What is left of |r|^2 is exact to a few units in its last place.
    rest.max(4.0 * f64::EPSILON * dot(r, r)).sqrt()
}

/// N: the residual of forces that come without multipliers, at rows that are as good as tight: the larger of their worst
/// violation and of the [`distance`] of a gradient that multipliers leave. Finite, whatever the numbers.
///
/// The multipliers are found by coordinate descent, so that this bounds the smallest residual from above.
pub fn without_multipliers(qp: &ForceQp, f: &Forces, tolerance: f64) -> f64 {
    let near = tolerance * qp.size(f);
    let mut pushes = Pushes::none();
    for (index, row) in qp.rows.iter().enumerate() {
        let along = qp.along(row, f);
        let (at_lower, at_upper) = (along - row.lower <= near, row.upper - along <= near);
        if at_lower || at_upper {
            let least = if at_upper { f64::NEG_INFINITY } else { 0.0 };
            pushes.may(index, least, if at_lower { f64::INFINITY } else { 0.0 });
        }
    }
    let mut r = gradient(qp, f, std::iter::empty());
    pushes.balance(qp, &mut r);
    let worst = violation(qp, f).max(qp.unreachable).max(distance(qp, &r));
    if worst.is_finite() {
        worst
    } else {
        f64::MAX
    }
}

/// Changes of multipliers, each within bounds, N.
struct Pushes {
    rows: [(usize, f64, f64, f64); Self::ROOM],
    len: usize,
}

impl Pushes {
    const ROOM: usize = 64;
    const SWEEPS: usize = 200;

    fn none() -> Self {
        Self { rows: [(0, 0.0, 0.0, 0.0); Self::ROOM], len: 0 }
    }

    /// Row `index` may push by least..most more; rows beyond the room may not.
    fn may(&mut self, index: usize, least: f64, most: f64) {
        if self.len < Self::ROOM {
            self.rows[self.len] = (index, least, most, 0.0);
            self.len += 1;
        }
    }

    /// Makes r shorter, by coordinate descent.
    fn balance(&mut self, qp: &ForceQp, r: &mut Forces) {
        for _ in 0..Self::SWEEPS {
            for (index, least, most, push) in &mut self.rows[..self.len] {
                let row = &qp.rows[*index];
                let better = (*push + qp.along(row, r)).min(*most).max(*least);
                qp.add_row(row, *push - better, r);
                *push = better;
            }
        }
    }
}

/// The residual at forces `f` with multipliers given as (row, mu), mu = 0 for all other rows. A gradient longer than
/// `enough`, N, is measured by its [`distance`], with the multipliers' last digits chosen for it.
pub fn residual(
    qp: &ForceQp,
    f: &Forces,
    multipliers: impl Iterator<Item = (usize, f64)> + Clone,
    enough: f64,
) -> Residual {
    let mut gradient = gradient(qp, f, multipliers.clone());
    let mut complementarity = 0.0_f64;
    for (index, mu) in multipliers.clone() {
        let row = &qp.rows[index];
        let along = qp.along(row, f);
        let slack = if mu > 0.0 { along - row.lower } else { row.upper - along };
        complementarity = complementarity.max(mu.abs().min(slack.abs()));
    }
    let mut stationarity = dot(&gradient, &gradient).sqrt();
    if stationarity > enough {
        let digits = 64.0 * f64::EPSILON * multipliers.clone().map(|(_, mu)| mu.abs()).sum::<f64>();
        let mut pushes = Pushes::none();
        for (index, mu) in multipliers {
            pushes.may(index, -digits.min(mu.abs()), digits.min(mu.abs()));
        }
        pushes.balance(qp, &mut gradient);
        stationarity = stationarity.min(distance(qp, &gradient));
    }
    Residual { stationarity, primal: violation(qp, f), complementarity }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::FrictionPyramid;

    /// One contact, capped at 2 N, that should push 5 N along its normal: alpha1 = alpha3 = 1, so that it would push
    /// 2.5 N, and does push 2 N with a multiplier of 1 N on the cap.
    fn qp() -> ForceQp {
        let mut qp = ForceQp::new(&[FrictionPyramid::inscribed(0.5, 4).unwrap()], 0, [1.0, 0.0, 1.0]);
        let mut G = [0.0; 18];
        (G[0], G[7], G[14]) = (1.0, 1.0, 1.0);
        qp.set_objective(&G, &[0.0, 0.0, 5.0, 0.0, 0.0, 0.0], &[0.0; 3], &[2.0]);
        qp.set_torques(&[], &[], &[]);
        qp
    }

    const CAP: usize = 4;

    fn at(z: f64, multipliers: &[(usize, f64)]) -> Residual {
        let mut f = [0.0; WIDTH];
        f[2] = z;
        residual(&qp(), &f, multipliers.iter().copied(), f64::INFINITY)
    }

    #[test]
    fn the_solution_has_none() {
        assert!(at(2.0, &[(CAP, -1.0)]).worst() < 1e-15);
    }

    #[test]
    fn each_condition_is_measured_in_newtons() {
        let without_multiplier = at(2.0, &[]);
        assert!((without_multiplier.stationarity - 1.0).abs() < 1e-15);
        let too_far = at(2.5, &[]);
        assert!(too_far.stationarity < 1e-15 && (too_far.primal - 0.5).abs() < 1e-15);
        let pushing_in_the_air = at(1.5, &[(CAP, -2.0)]);
        assert!(pushing_in_the_air.stationarity < 1e-15 && pushing_in_the_air.primal <= 0.0);
        assert!((pushing_in_the_air.complementarity - 0.5).abs() < 1e-15);
        // A multiplier that pulls at the cap acts at a lower bound which does not exist.
        let pulling = at(2.0, &[(CAP, 1.0)]);
        assert!((pulling.complementarity - 1.0).abs() < 1e-15);
    }

    #[test]
    fn what_is_not_a_number_is_infinitely_wrong() {
        assert!(at(f64::NAN, &[]).worst().is_infinite());
        assert!(at(2.0, &[(CAP, f64::NAN)]).worst().is_infinite());
        assert!(!at(f64::NAN, &[]).certifies(1.0, 1.0, || f64::INFINITY));
    }

    #[test]
    fn rounding_excuses_stationarity_alone() {
        let stationarity = Residual { stationarity: 1e-6, primal: 0.0, complementarity: 0.0 };
        assert!(!stationarity.certifies(1e-7, 1e-5, || 0.0));
        assert!(stationarity.certifies(1e-7, 1e-5, || 2e-6));
        assert!(!Residual { stationarity: 1e-4, ..stationarity }.certifies(1e-7, 1e-5, || 1.0));
        assert!(!Residual { primal: 1e-6, ..stationarity }.certifies(1e-7, 1e-5, || 1.0));
    }
}
