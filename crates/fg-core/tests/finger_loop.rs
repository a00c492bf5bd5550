//! What drives a finger by itself: its inertia, the free finger's velocity loop, and the posture of spare joints.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

mod hands;
mod instances;

use fg_core::config::Config;
use fg_core::gait::velocity_force::VelocityForceController;
use fg_core::grasp::{Grasp, Scene};
use fg_core::hand::{Finger, HandModel, HandState};
use fg_core::manipulation::posture::Posture;
use fg_core::signals::Measurement;
use instances::Random;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};
use proptest::prelude::*;

const DT: f64 = 0.002;

/// Kinetic energy of `finger` at `q` with the joint velocities `qd`, J, from differences of its matrices.
fn kinetic_energy(finger: &Finger, q: &[f64], qd: &[f64]) -> f64 {
    let step = 1e-5;
    let at = |sign: f64| {
        let moved: Vec<_> = q.iter().zip(qd).map(|(q, qd)| q + sign * step * qd).collect();
        let angles: Vec<_> = (0..finger.joints.len()).map(|i| hands::angle(finger, &moved, i)).collect();
        (hands::frames(finger, &moved), angles)
    };
    let ((low, angles_low), (high, angles_high)) = (at(-1.0), at(1.0));
    let mut energy = 0.0;
    for (i, joint) in finger.joints.iter().enumerate() {
        let com = |X: &nalgebra::Matrix4<f64>| {
            X.transform_point(&nalgebra::Point3::from(Vector3::from(joint.com))).coords
        };
        let v = (com(&high[i]) - com(&low[i])) / (2.0 * step);
        let rotation = |X: &nalgebra::Matrix4<f64>| X.fixed_view::<3, 3>(0, 0).into_owned();
        let (a, b) = (rotation(&low[i]), rotation(&high[i]));
        let spin = (b - a) * (0.5 * (a + b)).transpose() / (2.0 * step);
        let w = Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
        let [xx, yy, zz, xy, xz, yz] = joint.inertia;
        let R = 0.5 * (a + b);
        let I_W = R * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * R.transpose();
        let turning = (angles_high[i] - angles_low[i]) / (2.0 * step);
        energy +=
            0.5 * (joint.mass * v.norm_squared() + w.dot(&(I_W * w)) + joint.armature * turning * turning);
    }
    energy
}

/// The hand at `q`, with an object in the middle of its tips that nobody touches.
fn standing(hand: &HandModel, q: &[f64]) -> (HandState, Grasp, Measurement) {
    let mut state = HandState::new(hand);
    state.update(hand, q);
    let mut measurement = Measurement::zeros(hand.n_fingers(), hand.n_q());
    measurement.q = DVector::from_column_slice(q);
    let centre = (0..hand.n_fingers()).map(|j| state.tip(j).translation.vector).sum::<Vector3<f64>>();
    measurement.X_WO.translation.vector = centre / hand.n_fingers() as f64;
    let mut grasp = Grasp::new(hand, 0.01);
    grasp.update(hand, &state, &measurement);
    (state, grasp, measurement)
}

fn hand(seed: u64) -> (HandModel, Vec<Finger>, Random) {
    let mut random = Random(seed);
    let (fingers, gravity) = hands::any(&mut random);
    (HandModel::new(fingers.clone(), gravity).unwrap(), fingers, random)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn inertia_is_that_of_the_kinetic_energy(seed in any::<u64>()) {
        let (hand, fingers, mut random) = hand(seed);
        let q = hands::posture(&mut random, &hand);
        let mut state = HandState::new(&hand);
        state.update(&hand, &q);
        for (j, finger) in fingers.iter().enumerate() {
            let joints = hand.joints(j);
            let qd = DVector::from_fn(joints.len(), |_, _| random.uniform(-1.0, 1.0));
            let M = state.inertia(&hand, j);
            let M = M.view((0, 0), (joints.len(), joints.len()));
            let found = 0.5 * qd.dot(&(M * &qd));
            let expected = kinetic_energy(finger, &q[joints], qd.as_slice());
            prop_assert!((found - expected).abs() < 1e-7 * (1.0 + expected), "{found} {expected}");
        }
    }

    /// What is fed back neither presses on the surface nor lifts the finger off it.
    #[test]
    fn feedback_leaves_the_normal_alone(seed in any::<u64>()) {
        let (hand, _, mut random) = hand(seed);
        let q = hands::posture(&mut random, &hand);
        let (mut state, mut grasp, mut measurement) = standing(&hand, &q);
        let X_WO = measurement.X_WO;
        for k in 0..hand.n_fingers() {
            let joints = hand.joints(k);
            let mut torques = [vec![0.0; hand.most_joints()], vec![0.0; hand.most_joints()]];
            let qd_des: Vec<_> = joints.clone().map(|_| random.uniform(-1.0, 1.0)).collect();
            for (bandwidth, tau) in [0.0, 10.0].into_iter().zip(&mut torques) {
                let mut config = Config::default();
                config.gait.velocity_bandwidth = bandwidth;
                let mut controller = VelocityForceController::new(&config, DT);
                // Two steps, in which the finger turns otherwise than it should.
                for share in [0.0, 0.3] {
                    for (i, at) in joints.clone().enumerate() {
                        measurement.q[at] = q[at] + share * DT * qd_des[i];
                    }
                    state.update(&hand, measurement.q.as_slice());
                    grasp.update(&hand, &state, &measurement);
                    let scene = Scene { grasp: &grasp, state: &state, X_WO: &X_WO, V_WD: &Vector6::zeros(), q: measurement.q.as_slice() };
                    controller.update(k, &hand, &scene, &qd_des, 0.1, tau);
                }
            }
            let M = state.inertia(&hand, k);
            let M: DMatrix<f64> = M.view((0, 0), (joints.len(), joints.len())).into_owned();
            let feedback = DVector::from_fn(joints.len(), |i, _| torques[1][i] - torques[0][i]);
            let contact = grasp.contact(k);
            let normal = DVector::from_iterator(joints.len(), joints.clone().map(|at| contact.n_W.dot(&state.jacobian_column(at, &contact.p_WC))));
            let Some(factor) = M.cholesky() else { continue };
            let acceleration = factor.solve(&feedback);
            prop_assert!(normal.dot(&acceleration).abs() < 1e-6 * (1.0 + acceleration.norm()), "{acceleration}");
        }
    }

    /// The pull to the reference posture is no force at the contact.
    #[test]
    fn posture_torque_is_no_force(seed in any::<u64>()) {
        let (hand, _, mut random) = hand(seed);
        let q = hands::posture(&mut random, &hand);
        let (state, grasp, measurement) = standing(&hand, &q);
        let scene = Scene { grasp: &grasp, state: &state, X_WO: &measurement.X_WO, V_WD: &Vector6::zeros(), q: &q };
        let posture = Posture::new(&hand, &Config::default().robust);
        let (low, high) = (vec![-1.0; hand.n_q()], vec![1.0; hand.n_q()]);
        let mut tau = vec![0.0; hand.n_q()];
        for k in 0..hand.n_fingers() {
            posture.add_torque(&hand, k, &scene, (&low, &high), &mut tau);
            let J = state.jacobian(k, &grasp.contact(k).p_WC);
            let own = DVector::from_column_slice(&tau[hand.joints(k)]);
            if hand.joints(k).len() <= 3 {
                prop_assert!(own.norm() == 0.0);
            }
            prop_assert!((&J * &own).norm() < 1e-2 * J.norm() * 0.1, "{own}");
        }
    }
}

/// Angle by which a finger turns in five time constants of the loop, or in half a second without one, as a share of what
/// it should: with its damping `scale` times what the model says, its inertia `weight` times, and 5 ms of lag of its motors.
fn travel(bandwidth: f64, scale: f64, weight: f64) -> f64 {
    let joint = |axis: [f64; 3], x: f64| fg_core::hand::Joint {
        name: "joint".into(),
        position: [x, 0.0, 0.0],
        axis,
        damping: 0.05,
        mass: 0.02,
        com: [0.025, 0.0, 0.0],
        armature: 5e-5,
        tau_min: Some(-0.5),
        tau_max: Some(0.5),
        lower: -3.0,
        upper: 3.0,
        ..fg_core::hand::Joint::default()
    };
    let finger = |name: &str| Finger {
        name: name.into(),
        joints: vec![joint([0.0, 0.0, 1.0], 0.0), joint([0.0, 1.0, 0.0], 0.0), joint([0.0, 1.0, 0.0], 0.05)],
        tip: fg_core::hand::Tip { position: [0.045, 0.0, 0.0], radius: 0.014 },
    };
    let hand = HandModel::new(vec![finger("a"), finger("b")], [0.0; 3]).unwrap();
    let mut config = Config::default();
    config.gait.velocity_bandwidth = bandwidth;
    let mut controller = VelocityForceController::new(&config, DT);
    let (mut q, mut qd) = (vec![0.0, 0.3, 0.6, 0.0, 0.0, 0.0], DVector::zeros(3));
    let mut motors = DVector::zeros(3);
    // The first joint moves the tip sideways, along the surface.
    let qd_des = [0.5, 0.0, 0.0];
    let mut tau = vec![0.0; 3];
    let time = if bandwidth > 0.0 { 5.0 / bandwidth } else { 0.5 };
    // The plant, ten times finer than the control step.
    let h = DT / 10.0;
    let mut t = 0.0;
    for step in 0.. {
        if t >= time {
            break;
        }
        t += h;
        if step % 10 == 0 {
            let (state, mut grasp, mut measurement) = standing(&hand, &q);
            measurement.X_WO.translation.vector =
                state.tip(0).translation.vector + Vector3::new(0.0, 0.0, 0.05);
            grasp.update(&hand, &state, &measurement);
            let scene = Scene {
                grasp: &grasp,
                state: &state,
                X_WO: &measurement.X_WO,
                V_WD: &Vector6::zeros(),
                q: &q,
            };
            controller.update(0, &hand, &scene, &qd_des, 0.0, &mut tau);
        }
        motors += (DVector::from_column_slice(&tau) - &motors) * (h / 0.005);
        let mut state = HandState::new(&hand);
        state.update(&hand, &q);
        let M = state.inertia(&hand, 0).view((0, 0), (3, 3)).into_owned() * weight;
        let force = &motors - &qd * (0.05 * scale);
        qd += M.cholesky().unwrap().solve(&force) * h;
        for i in 0..3 {
            q[i] += qd[i] * h;
        }
    }
    q[0] / (qd_des[0] * time)
}

#[test]
fn the_finger_goes_where_it_should_whatever_its_damping() {
    for (scale, weight) in
        [(1.0, 1.0), (0.1, 1.0), (0.3, 1.0), (2.0, 1.0), (1.0, 3.0), (0.1, 3.0), (2.0, 0.5)]
    {
        let share = travel(Config::default().gait.velocity_bandwidth, scale, weight);
        // The loop needs its time, and most is lost at the start.
        assert!((share - 1.0).abs() < 0.25, "damping x {scale}, inertia x {weight}: {share}");
    }
    // The paper's law, which closes no loop.
    assert!(travel(0.0, 0.1, 1.0) > 3.0);
    assert!(travel(0.0, 2.0, 1.0) < 0.6);
}
