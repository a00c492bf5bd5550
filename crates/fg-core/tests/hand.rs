//! Kinematics and gravity of the hand against matrices and finite differences.

#![allow(non_snake_case)] // the paper's letters, as in fg-core

mod common;

use fg_core::hand::{HandModel, HandState};
use nalgebra::Vector3;
use proptest::prelude::*;

fn angles() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..2.0, 12)
}

fn at(hand: &HandModel, q: &[f64]) -> HandState {
    let mut state = HandState::new(hand);
    state.update(hand, q);
    state
}

/// Potential energy of all links, their centres of mass placed by homogeneous matrices.
fn potential_energy(n: usize, q: &[f64]) -> f64 {
    (0..n).flat_map(|j| common::com_heights(n, j, q)).map(|z| common::LINK_MASS * 9.81 * z).sum()
}

proptest! {
    #[test]
    fn tips_agree_with_homogeneous_matrices(q in angles()) {
        let hand = common::hand(4);
        let state = at(&hand, &q);
        for j in 0..4 {
            let difference = state.tip(j).translation.vector - common::tip_by_matrices(4, j, &q);
            prop_assert!(difference.norm() < 1e-12);
        }
    }

    #[test]
    fn jacobian_agrees_with_finite_differences(q in angles(), offset in prop::array::uniform3(-0.02..0.02)) {
        let hand = common::hand(4);
        let state = at(&hand, &q);
        let p_F = Vector3::from(offset);
        for j in 0..4 {
            let point = |q: &[f64]| (at(&hand, q).tip(j) * nalgebra::Point3::from(p_F)).coords;
            let J = state.jacobian(j, &point(&q));
            for i in 0..3 {
                let step = 1e-6;
                let (mut low, mut high) = (q.clone(), q.clone());
                low[3 * j + i] -= step;
                high[3 * j + i] += step;
                let numeric = (point(&high) - point(&low)) / (2.0 * step);
                prop_assert!((numeric - J.column(i)).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn gravity_torque_is_the_gradient_of_the_potential_energy(q in angles()) {
        let hand = common::hand(4);
        let mut tau = vec![0.0; 12];
        at(&hand, &q).gravity_torque(&hand, &mut tau);
        for i in 0..12 {
            let step = 1e-6;
            let (mut low, mut high) = (q.clone(), q.clone());
            low[i] -= step;
            high[i] += step;
            let numeric = (potential_energy(4, &high) - potential_energy(4, &low)) / (2.0 * step);
            prop_assert!((numeric - tau[i]).abs() < 1e-8, "{numeric} {}", tau[i]);
        }
    }
}
