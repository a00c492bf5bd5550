//! Contact frames, grasp map, quality and its rate, against hand-made figures and finite differences.

#![allow(non_snake_case)] // the paper's letters, as in fg-core

mod common;

use fg_core::config::{GaitConfig, QualityPlane};
use fg_core::gait::quality::QualityModel;
use fg_core::grasp::{Grasp, Scene};
use fg_core::hand::HandState;
use fg_core::signals::Measurement;
use nalgebra::{DVector, Vector3, Vector6};
use proptest::prelude::*;

fn grasped(measurement: &Measurement) -> (HandState, Grasp) {
    let hand = common::hand(4);
    let mut state = HandState::new(&hand);
    state.update(&hand, measurement.q.as_slice());
    let mut grasp = Grasp::new(&hand, 0.01);
    grasp.update(&hand, &state, measurement);
    (state, grasp)
}

#[test]
fn normals_point_inwards_and_forces_push_the_object() {
    let hand = common::hand(4);
    let measurement = common::measurement(&hand, &common::grasp_angles(4), 1.0);
    let (_, grasp) = grasped(&measurement);
    // Finger 0 sits on the x axis, finger 1 on the y axis: their inward normals are -x and -y.
    for (j, inward) in [-Vector3::x(), -Vector3::y(), Vector3::x(), Vector3::y()].iter().enumerate() {
        let contact = grasp.contact(j);
        assert!(contact.touching);
        assert!((contact.n_W - inward).norm() < 1e-12, "{}", contact.n_W);
        let centre = common::tip_by_matrices(4, j, measurement.q.as_slice());
        assert!((contact.p_WC - centre - inward * common::TIP_RADIUS).norm() < 1e-12);
    }
    // One newton along the normal of finger 0 pushes the object along -x, and turns it about y by the height.
    let mut f = DVector::zeros(12);
    f[2] = 1.0;
    let wrench = &grasp.G * f;
    let arm = grasp.contact(0).p_WC.z - 0.06;
    let expected = Vector6::new(-1.0, 0.0, 0.0, 0.0, -arm, 0.0);
    assert!((wrench - DVector::from_column_slice(expected.as_slice())).norm() < 1e-12);
}

#[test]
fn equal_normal_forces_balance() {
    let hand = common::hand(4);
    let (_, grasp) = grasped(&common::measurement(&hand, &common::grasp_angles(4), 1.0));
    let f = DVector::from_fn(12, |i, _| if i % 3 == 2 { 2.0 } else { 0.0 });
    assert!((&grasp.G * f).norm() < 1e-12);
}

proptest! {
    /// Virtual work: the torques J^T f do on any joint motion the work that the forces do on the tips' motion.
    #[test]
    fn joint_torques_and_contact_forces_do_the_same_work(
        q in prop::collection::vec(-0.5..1.5, 12), qd in prop::collection::vec(-1.0..1.0, 12),
        f in prop::collection::vec(-3.0..3.0, 12),
    ) {
        let hand = common::hand(4);
        let (state, grasp) = grasped(&common::measurement(&hand, &q, 1.0));
        let (qd, f) = (DVector::from_vec(qd), DVector::from_vec(f));
        let joint_power = (grasp.J.transpose() * &f).dot(&qd);
        let mut tip_power = 0.0;
        for j in 0..4 {
            let contact = grasp.contact(j);
            let force = contact.R_WC * Vector3::new(f[3 * j], f[3 * j + 1], f[3 * j + 2]);
            tip_power += force.dot(&(state.jacobian(j, &contact.p_WC) * qd.rows(3 * j, 3)));
        }
        prop_assert!((joint_power - tip_power).abs() < 1e-9);
    }

    /// Q-dot of eq. (3) against the difference of Q itself, the free finger's contact moved by J qd.
    #[test]
    fn quality_rate_agrees_with_finite_differences(
        wiggle in prop::collection::vec(-0.2..0.2, 12), qd in prop::collection::vec(-1.0..1.0, 3), k in 0..4_usize,
    ) {
        let hand = common::hand(4);
        let q: Vec<f64> = common::grasp_angles(4).iter().zip(&wiggle).map(|(a, b)| a + b).collect();
        let measurement = common::measurement(&hand, &q, 1.0);
        let (state, grasp) = grasped(&measurement);
        // c_k^i = 1 and no height term: what is left is the gradient of eq. (1).
        let config =
            GaitConfig { q_thres: 0.99, w_z: 0.0, plane: QualityPlane::Object, ..GaitConfig::default() };
        let mut quality = QualityModel::new(&hand, &config);
        let scene = Scene { grasp: &grasp, state: &state, X_WO: &measurement.X_WO, V_WD: &Vector6::zeros(), q: &q };
        quality.set_first_grasp(&scene);
        let mut c = [0.0; 3];
        quality.rate_coefficients(k, &scene, &[0.0; 3], &mut c);
        let rate: f64 = c.iter().zip(&qd).map(|(c, qd)| c * qd).sum();

        let step = 1e-5;
        let at = |sign: f64| {
            let mut moved = measurement.clone();
            for (i, qd) in qd.iter().enumerate() {
                moved.q[3 * k + i] += sign * step * qd;
            }
            // The contact is a point of the tip: it keeps its place on the tip.
            let (state, grasp) = grasped(&moved);
            let scene =
                Scene { grasp: &grasp, state: &state, X_WO: &moved.X_WO, V_WD: &Vector6::zeros(), q: moved.q.as_slice() };
            quality.quality(&scene).Q
        };
        let numeric = (at(1.0) - at(-1.0)) / (2.0 * step);
        prop_assert!((numeric - rate).abs() < 1e-7 + 1e-5 * rate.abs(), "{numeric} {rate}");
    }
}

#[test]
fn a_square_grasp_has_the_area_of_the_square() {
    let hand = common::hand(4);
    let measurement = common::measurement(&hand, &common::grasp_angles(4), 1.0);
    let (state, grasp) = grasped(&measurement);
    let q = measurement.q.as_slice();
    let scene = Scene { grasp: &grasp, state: &state, X_WO: &measurement.X_WO, V_WD: &Vector6::zeros(), q };
    let radius = grasp.contact(0).p_WC.x;
    for plane in [QualityPlane::Object, QualityPlane::Contacts] {
        let config = GaitConfig { plane, ..GaitConfig::default() };
        let quality = QualityModel::new(&hand, &config);
        let Q = quality.quality(&scene);
        // Twice the area of a square with half-diagonal r is 4 r^2; of the triangle that remains, 2 r^2.
        assert!((Q.Q_o - 4.0 * radius * radius).abs() < 1e-12);
        let remaining = quality.remaining_quality(&scene, 2);
        assert!((remaining - 2.0 * radius * radius).abs() < 1e-12);
    }
}

#[test]
fn a_finger_off_the_object_keeps_its_last_normal() {
    let hand = common::hand(4);
    let mut measurement = common::measurement(&hand, &common::grasp_angles(4), 1.0);
    let (mut state, mut grasp) = grasped(&measurement);
    let before = grasp.contact(1).n_W;
    measurement.tactile[1].f_n = 0.0;
    state.update(&hand, measurement.q.as_slice());
    grasp.update(&hand, &state, &measurement);
    assert!(!grasp.contact(1).touching);
    assert!((grasp.contact(1).n_W - before).norm() < 1e-12);
}
