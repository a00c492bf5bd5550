//! The gait LP, eq. (4), in closed form.

use crate::error::Error;

/// What [`gait_lp`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LpOutcome {
    /// c . x.
    pub value: f64,
    /// a . x: zero but for rounding where feasible.
    pub residual: f64,
    /// False where no x in the box has a . x = 0; x is then a vertex of the box with the smallest |a . x|.
    pub feasible: bool,
}

/// |a_i| below this part of max|a| counts as zero: joint i does not move the contact along the normal.
const ZERO: f64 = 1e-12;

/// Writes the x that maximises `c . x` subject to `a . x = 0` and `lower <= x <= upper`, eq. (4), into `x`.
///
/// In eq. (4) c is the gradient of Q̇ by the joint velocities, a = J' n, and the box is the velocity limits (4a) cut with
/// the rate limits (4c) about the last velocities. With one equality the LP is a continuous knapsack: start each x_i at its
/// better bound, then restore a . x = 0 with the variables that lose least value per unit of a . x, the last one partially.
/// Exact, without tolerance on optimality; ties go to the lower index; x_i without influence (c_i = a_i = 0) is the value
/// of its interval nearest zero. Allocates nothing; the work is quadratic in the number of joints.
///
/// The slices have equal length, all numbers are finite and lower <= upper; otherwise x is still within each interval's
/// bounds where it has any, and nothing panics.
pub fn gait_lp(c: &[f64], a: &[f64], lower: &[f64], upper: &[f64], x: &mut [f64]) -> LpOutcome {
    let n = x.len().min(c.len()).min(a.len()).min(lower.len()).min(upper.len());
    let (c, a, lower, upper) = (&c[..n], &a[..n], &lower[..n], &upper[..n]);
    let x = &mut x[..n];
    let zero = ZERO * a.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
    let mut r = 0.0;
    let mut scale = 0.0;
    for i in 0..n {
        x[i] = match c[i].partial_cmp(&0.0) {
            Some(std::cmp::Ordering::Greater) => upper[i],
            Some(std::cmp::Ordering::Less) => lower[i],
            _ => 0.0_f64.max(lower[i]).min(upper[i]),
        };
        if a[i].abs() > zero {
            r += a[i] * x[i];
            scale += a[i].abs() * lower[i].abs().max(upper[i].abs());
        }
    }
    // Selection in place of a sort: the next candidate is the smallest (loss, index) above the last one.
    let mut done: Option<(f64, usize)> = None;
    while r != 0.0 {
        let mut next: Option<(f64, usize)> = None;
        for i in 0..n {
            if a[i].abs() <= zero {
                continue;
            }
            let key = ((c[i] / a[i]).abs(), i);
            if done.is_none_or(|d| key > d) && next.is_none_or(|b| key < b) {
                next = Some(key);
            }
        }
        let Some((_, i)) = next else { break };
        done = next;
        // The bound towards which x_i reduces |r|, and where r would cross zero.
        let bound = if (r > 0.0) == (a[i] > 0.0) { lower[i] } else { upper[i] };
        let crossing = x[i] - r / a[i];
        let moved = a[i] * (bound - x[i]);
        if moved.abs() >= r.abs() {
            x[i] = crossing.max(lower[i]).min(upper[i]);
            r = 0.0;
        } else {
            x[i] = bound;
            r += moved;
        }
    }
    let sum = |y: &[f64]| y.iter().zip(x.iter()).map(|(y, x)| y * x).sum::<f64>();
    LpOutcome { value: sum(c), residual: sum(a), feasible: r.abs() <= ZERO * scale }
}

/// An error unless the arguments are what [`gait_lp`] asks for: equal lengths, finite numbers, lower <= upper.
pub fn check(c: &[f64], a: &[f64], lower: &[f64], upper: &[f64]) -> Result<(), Error> {
    for (field, values) in [("a", a), ("lower", lower), ("upper", upper)] {
        if values.len() != c.len() {
            return Err(Error::shape(field, format!("({},) as c", c.len()), format!("({},)", values.len())));
        }
    }
    for (field, values) in [("c", c), ("a", a), ("lower", lower), ("upper", upper)] {
        if let Some(i) = values.iter().position(|x| !x.is_finite()) {
            return Err(Error::config(format!("{field}[{i}]"), "a finite number", values[i]));
        }
    }
    match lower.iter().zip(upper).position(|(l, u)| l > u) {
        Some(i) => {
            Err(Error::config(format!("lower[{i}]"), format!("at most upper[{i}] = {}", upper[i]), lower[i]))
        }
        None => Ok(()),
    }
}
