//! The last certified forces, made feasible: what is commanded where no solver certifies an answer.

use super::kkt::violation;
use super::qp::{ForceQp, Forces};

/// `last` with the least change, of a simple kind, that satisfies `qp`'s bounds, and its worst violation in N.
///
/// Pinned contacts drop to zero; a contact outside its pyramid loses tangential force, one above its cap shrinks; then all
/// forces shrink by one factor in 0..1 until the torques fit. Where no factor does (the box of torques excludes all of
/// them), the factor with the smallest violation is taken, and that violation returned.
pub fn hold(qp: &ForceQp, last: &Forces) -> (Forces, f64) {
    let mut f = *last;
    for contact in 0..qp.n_contacts() {
        let part = &mut f[3 * contact..3 * contact + 3];
        if qp.pinned[contact] {
            part.fill(0.0);
        } else {
            into_cone(qp, contact, part);
        }
    }
    let worst = |scale: f64| violation(qp, &f.map(|x| scale * x));
    let scale = longest(qp, &f).unwrap_or_else(|| least_violation(worst));
    let f = f.map(|x| scale * x);
    (f, violation(qp, &f))
}

/// Shrinks the tangential force into the pyramid, then the whole force under the cap.
fn into_cone(qp: &ForceQp, contact: usize, f: &mut [f64]) {
    let mut keep = 1.0_f64;
    for row in qp.facets(contact) {
        let n = &row.normal;
        let tangential = n[0] * f[0] + n[1] * f[1];
        let normal = n[2] * f[2];
        if normal + tangential < 0.0 {
            keep = keep.min(if normal > 0.0 { -normal / tangential } else { 0.0 });
        }
    }
    f[0] *= keep;
    f[1] *= keep;
    let cap = qp.rows[qp.torque_at() - qp.n_contacts() + contact].upper;
    let mut scale = if f[2] > cap { cap / f[2] } else { 1.0 };
    let rounding = 1e-12 * (f[0].abs() + f[1].abs() + f[2].abs());
    if qp
        .facets(contact)
        .iter()
        .any(|row| row.normal[2] * f[2] + row.normal[0] * f[0] + row.normal[1] * f[1] < -rounding)
    {
        // The normal itself is outside the pyramid, or the force pulls.
        scale = 0.0;
    }
    for x in f {
        *x *= scale;
    }
}

/// The largest factor in 0..1 that satisfies all torque rows.
fn longest(qp: &ForceQp, f: &Forces) -> Option<f64> {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for row in &qp.rows[qp.torque_at()..] {
        let along = qp.along(row, f);
        // scale * along in lower..upper
        let (a, b) = if along > 0.0 {
            (row.lower / along, row.upper / along)
        } else if along < 0.0 {
            (row.upper / along, row.lower / along)
        } else if row.lower <= 0.0 && row.upper >= 0.0 {
            continue;
        } else {
            return None;
        };
        low = low.max(a);
        high = high.min(b);
    }
    (low <= high).then_some(high)
}

/// Ternary search of the factor in 0..1 with the smallest violation, which is convex in the factor.
fn least_violation(worst: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..80 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if worst(a) <= worst(b) {
            high = b;
        } else {
            low = a;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::FrictionPyramid;
    use crate::solver::qp::WIDTH;

    /// Two contacts with one joint each that feels 0.1 m of the normal force.
    fn qp(mu: f64, caps: [f64; 2], tau_min: [f64; 2], tau_max: [f64; 2]) -> ForceQp {
        let pyramids = vec![FrictionPyramid::inscribed(mu, 4).unwrap(); 2];
        let mut qp = ForceQp::new(&pyramids, 2, [0.01, 0.01, 1000.0]);
        qp.set_objective(&[0.0; 36], &[0.0; 6], &[0.0; 6], &caps);
        let mut J = [0.0; 12];
        (J[2], J[11]) = (0.1, 0.1);
        qp.set_torques(&J, &tau_min, &tau_max);
        qp
    }

    fn forces(f: [f64; 6]) -> Forces {
        let mut padded = [0.0; WIDTH];
        padded[..6].copy_from_slice(&f);
        padded
    }

    const NONE: f64 = f64::INFINITY;

    fn close(held: (Forces, f64), f: [f64; 6], violation: f64) {
        assert!(held.0.iter().zip(forces(f)).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", held.0);
        assert!((held.1 - violation).abs() < 1e-12, "{}", held.1);
    }

    #[test]
    fn feasible_forces_stay() {
        let last = [0.5, 0.0, 2.0, 0.0, 0.0, 4.0];
        close(hold(&qp(0.5, [NONE; 2], [-0.5; 2], [0.5; 2]), &forces(last)), last, 0.0);
    }

    #[test]
    fn less_friction_takes_tangential_force() {
        let held = hold(&qp(0.25, [NONE; 2], [-0.5; 2], [0.5; 2]), &forces([1.0, 0.0, 2.0, 0.0, 0.0, 4.0]));
        close(held, [0.5, 0.0, 2.0, 0.0, 0.0, 4.0], 0.0);
    }

    #[test]
    fn caps_shrink_one_contact_and_pins_zero_it() {
        let held = hold(&qp(0.5, [1.0, 0.0], [-0.5; 2], [0.5; 2]), &forces([0.5, 0.0, 2.0, 0.0, 0.0, 4.0]));
        close(held, [0.25, 0.0, 1.0, 0.0, 0.0, 0.0], 0.0);
    }

    #[test]
    fn torques_shrink_all_contacts_alike() {
        let held = hold(&qp(0.5, [NONE; 2], [-0.5; 2], [0.5, 0.2]), &forces([0.5, 0.0, 2.0, 0.0, 0.0, 4.0]));
        close(held, [0.25, 0.0, 1.0, 0.0, 0.0, 2.0], 0.0);
    }

    #[test]
    fn torques_that_nothing_meets_are_missed_by_the_least() {
        // The first joint wants 3 N or more, the second 2 N or less: at 5/6 of the forces both miss by half a newton.
        let held =
            hold(&qp(0.5, [NONE; 2], [0.3, -0.5], [0.5, 0.2]), &forces([0.0, 0.0, 3.0, 0.0, 0.0, 3.0]));
        assert!((held.0[2] - 2.5).abs() < 1e-9 && (held.0[5] - 2.5).abs() < 1e-9, "{:?}", held.0);
        assert!((held.1 - 0.5).abs() < 1e-9, "{}", held.1);
    }

    #[test]
    fn a_box_that_excludes_zero_is_met_where_it_can_be() {
        let held = hold(&qp(0.5, [NONE; 2], [0.1, 0.1], [0.5, 0.2]), &forces([0.0, 0.0, 3.0, 0.0, 0.0, 4.0]));
        close(held, [0.0, 0.0, 1.5, 0.0, 0.0, 2.0], 0.0);
    }
}
