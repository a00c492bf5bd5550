//! The optimality check that an answer of any solver must pass.

use super::qp::{dot, ForceQp, Forces, WIDTH};

/// How far forces and multipliers are from satisfying the KKT conditions of [`ForceQp`]. Everything is in newtons.
///
/// With H = s I + alpha3 G'G, s = alpha1 + alpha2, and signed multipliers mu_i (positive: the lower bound pushes,
/// negative: the upper bound):
///
/// - `stationarity` = `|f - prior - (alpha3/s) G'(F_des - G f) - sum mu_i a_i|_2`. As H >= s I, this alone moves the
///   minimiser by no more than itself.
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
    /// make of an exact solution, up to `loose`.
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

/// The residual at forces `f` with multipliers given as (row, mu), mu = 0 for all other rows.
pub fn residual(
    qp: &ForceQp,
    f: &Forces,
    multipliers: impl Iterator<Item = (usize, f64)> + Clone,
) -> Residual {
    let gradient = gradient(qp, f, multipliers.clone());
    let mut complementarity = 0.0_f64;
    for (index, mu) in multipliers {
        let row = &qp.rows[index];
        let along = qp.along(row, f);
        let slack = if mu > 0.0 { along - row.lower } else { row.upper - along };
        complementarity = complementarity.max(mu.abs().min(slack.abs()));
    }
    let stationarity = dot(&gradient, &gradient).sqrt();
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
        residual(&qp(), &f, multipliers.iter().copied())
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
