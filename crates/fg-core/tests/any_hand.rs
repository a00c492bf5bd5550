//! What holds of every hand: kinematics against matrices and finite differences, and each step of the controller.
#![allow(non_snake_case)] // the paper's letters, as in fg-core
#![allow(unsafe_code)] // an allocator cannot be written without

mod chaos;
mod counting;
mod hands;
mod instances;
#[path = "../benches/recording/mod.rs"]
mod recording;

use counting::allocations;
use fg_core::config::Config;
use fg_core::dual_stage::DualStagePlanner;
use fg_core::hand::{Finger, Follows, HandModel, HandState};
use fg_core::manipulation::force::{ForceStatus, SolverUsed};
use instances::Random;
use nalgebra::Vector3;
use proptest::prelude::*;
use recording::{Recording, ROTATE};
use std::sync::LazyLock;

static RECORDING: LazyLock<Recording> = LazyLock::new(|| Recording::parse(ROTATE));

/// Step of the central differences, rad.
const STEP: f64 = 1e-6;

fn hand(random: &mut Random) -> (HandModel, Vec<Finger>, [f64; 3]) {
    let (fingers, gravity) = hands::any(random);
    (HandModel::new(fingers.clone(), gravity).unwrap(), fingers, gravity)
}

fn planner(hand: &HandModel) -> DualStagePlanner {
    let mut config = Config::default();
    if hand.coordinates()[0].tau_max.is_none() {
        config.force.tau_max = Some(0.7);
    }
    DualStagePlanner::new(hand.clone(), RECORDING.controller.clone(), config).unwrap()
}

/// d f / d q_i at `q`.
fn slope(q: &[f64], i: usize, f: impl Fn(&[f64]) -> f64) -> f64 {
    let (mut low, mut high) = (q.to_vec(), q.to_vec());
    low[i] -= STEP;
    high[i] += STEP;
    (f(&high) - f(&low)) / (2.0 * STEP)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn kinematics_and_torques_agree_with_matrices(seed in any::<u64>()) {
        let mut random = Random(seed);
        let (hand, fingers, gravity) = hand(&mut random);
        let q = hands::posture(&mut random, &hand);
        let mut state = HandState::new(&hand);
        state.update(&hand, &q);
        let (mut weight, mut springs) = (vec![0.0; hand.n_q()], vec![0.0; hand.n_q()]);
        state.gravity_torque(&hand, &mut weight);
        state.add_spring_torque(&hand, &mut springs);
        for (j, finger) in fingers.iter().enumerate() {
            let (joints, p_F) = (hand.joints(j), random.vector(0.02));
            let own = &q[joints.clone()];
            let p_W = hands::tip(finger, own, &p_F);
            prop_assert!((state.tip(j) * nalgebra::Point3::from(p_F) - p_W).coords.norm() < 1e-12);
            let J = state.jacobian(j, &p_W);
            for (i, at) in joints.enumerate() {
                for r in 0..3 {
                    let numeric = slope(own, i, |q| hands::tip(finger, q, &p_F)[r]);
                    prop_assert!((numeric - J[(r, i)]).abs() < 1e-8, "J {numeric} {}", J[(r, i)]);
                }
                let numeric = slope(own, i, |q| hands::weight_energy(finger, &gravity, q));
                prop_assert!((numeric - weight[at]).abs() < 1e-8, "weight {numeric} {}", weight[at]);
                let numeric = slope(own, i, |q| hands::spring_energy(finger, q));
                prop_assert!((numeric - springs[at]).abs() < 1e-8, "spring {numeric} {}", springs[at]);
                // Power and kinetic energy of the motors at unit speed, their joints' speeds by differences.
                let speed = |k: usize| slope(own, i, |q| hands::angle(finger, q, k));
                let sum = |of: &dyn Fn(usize) -> f64| (0..finger.joints.len()).map(of).sum::<f64>();
                let damping = sum(&|k| finger.joints[k].damping * speed(k).powi(2));
                let armature = sum(&|k| finger.joints[k].armature * speed(k).powi(2));
                let friction = sum(&|k| finger.joints[k].frictionloss * speed(k).abs());
                let c = hand.coordinate(at);
                for (numeric, found) in [(damping, c.damping), (armature, c.armature), (friction, c.frictionloss)] {
                    prop_assert!((numeric - found).abs() < 1e-8, "reflected {numeric} {found}");
                }
            }
            for (i, joint) in finger.joints.iter().enumerate() {
                let angle = hands::angle(finger, own, i);
                prop_assert!(angle >= joint.lower - 1e-9 && angle <= joint.upper + 1e-9);
            }
        }
    }

    /// A point of the last link goes where the finger's other posture has it.
    #[test]
    fn turning_joints_moves_the_tip_to_the_other_posture(seed in any::<u64>()) {
        let mut random = Random(seed);
        let (hand, fingers, _) = hand(&mut random);
        let (q, to) = (hands::posture(&mut random, &hand), hands::posture(&mut random, &hand));
        let mut state = HandState::new(&hand);
        state.update(&hand, &q);
        for (j, finger) in fingers.iter().enumerate() {
            let (joints, p_F) = (hand.joints(j), Vector3::new(0.01, -0.02, 0.005));
            let p_W = hands::tip(finger, &q[joints.clone()], &p_F);
            let turn = |i: usize| Some(to[joints.start + i] - q[joints.start + i]);
            let found = state.turned(j, turn, &p_W).unwrap();
            prop_assert!((found - hands::tip(finger, &to[joints.clone()], &p_F)).norm() < 1e-12);
            prop_assert!(state.turned(j, |_| None, &p_W).is_none());
        }
    }

    /// Every command is finite and within each joint's limits, whatever comes in.
    #[test]
    fn commands_are_limited_on_any_hand(seed in any::<u64>()) {
        let mut random = Random(seed);
        let (hand, ..) = hand(&mut random);
        let rows = hands::rows(&mut random, &hand, 300);
        let data: Vec<u8> = (0..40).flat_map(|_| random.bits().to_le_bytes()).collect();
        chaos::drive(&mut planner(&hand), &rows, &data);
    }

    /// A step allocates nothing, its forces are certified wherever they are new, and it gives the same again.
    #[test]
    fn steps_are_certified_deterministic_and_allocate_nothing(seed in any::<u64>()) {
        let mut random = Random(seed);
        let (hand, ..) = hand(&mut random);
        let rows = hands::rows(&mut random, &hand, 150);
        let (mut first, mut second) = (planner(&hand), planner(&hand));
        let tolerance = 100.0 * first.config().force.tolerance;
        for (measurement, reference) in &rows {
            let ((), count) = allocations(|| {
                first.step(measurement, reference).unwrap();
            });
            let d = first.diagnostics();
            prop_assert!(count == 0 || d.solver != SolverUsed::ActiveSet, "{count} allocations");
            prop_assert!(d.status == ForceStatus::Held || d.kkt <= tolerance, "{} N", d.kkt);
            let again = second.step(measurement, reference).unwrap();
            prop_assert!(again.tau.iter().zip(d.tau.iter()).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
        prop_assert_eq!(first.diagnostics().slips, second.diagnostics().slips);
    }
}

#[test]
fn gaits_run_on_hands_with_few_and_many_joints() {
    let (mut slid, mut gaits) = ([false; HandModel::MAX_JOINTS + 1], 0);
    let mut random = Random(3);
    for _ in 0..60 {
        let (hand, ..) = hand(&mut random);
        let mut config = Config::default();
        config.mass = Some(0.01);
        config.force.tau_max = Some(1.0);
        // Every grasp is to be mended, by any finger, whether it helps or not: all that is asked is that it runs.
        (config.gait.threshold_margin, config.gait.delta) = (-1e3, -1e3);
        (config.gait.slack_force, config.gait.slack_torque) = (1e3, 1e3);
        let mut planner = DualStagePlanner::new(hand.clone(), RECORDING.controller.clone(), config).unwrap();
        let mut tau = nalgebra::DVector::zeros(hand.n_q());
        for (mut measurement, reference) in hands::rows(&mut random, &hand, 400) {
            // Motors that do as they are told.
            measurement.tau.copy_from(&tau);
            tau.copy_from(&planner.step(&measurement, &reference).unwrap().tau);
            let d = planner.diagnostics();
            if let ("slide", Some(k)) = (d.phase.as_str(), d.free_finger) {
                let n = hand.joints(k).len();
                slid[n] = true;
                assert!(d.qd_des.iter().skip(n).all(|qd| *qd == 0.0));
            }
        }
        gaits += planner.diagnostics().gaits;
    }
    println!("{gaits} gaits, of fingers with joints: {slid:?}");
    assert!(gaits > 0 && slid[1..].iter().filter(|slid| **slid).count() >= 4, "{gaits} {slid:?}");
}

#[test]
fn the_weight_of_the_object_is_held_against_the_hands_gravity() {
    let (mut fingers, _) = hands::any(&mut Random(5));
    for joint in fingers.iter_mut().flat_map(|finger| &mut finger.joints) {
        (joint.tau_min, joint.tau_max) = (None, None);
    }
    for gravity in [[0.0, 0.0, -9.81], [0.0, 0.0, 9.81], [3.0, -9.0, 1.0], [0.0; 3]] {
        let hand = HandModel::new(fingers.clone(), gravity).unwrap();
        let rows = hands::rows(&mut Random(1), &hand, 1);
        let mut planner = planner(&hand);
        planner.step(&rows[0].0, &rows[0].1).unwrap();
        let lift = planner.diagnostics().F_des.fixed_rows::<3>(0) / RECORDING.controller.nominal.mass;
        assert!((lift + Vector3::from(gravity)).norm() < 1e-9, "{lift}");
    }
}

/// Spoils a hand.
type Change<'a> = &'a dyn Fn(&mut Vec<Finger>);

#[test]
fn bad_fields_are_named() {
    let good = || {
        let (mut fingers, gravity) = hands::any(&mut Random(11));
        fingers.truncate(2);
        for finger in &mut fingers {
            finger.joints.truncate(3);
            for joint in &mut finger.joints {
                joint.follows = None;
                (joint.tau_min, joint.tau_max) = (Some(-1.0), Some(1.0));
            }
            while finger.joints.len() < 3 {
                finger.joints.push(finger.joints[0].clone());
            }
        }
        (fingers, gravity)
    };
    let message = |change: &dyn Fn(&mut Vec<Finger>)| {
        let (mut fingers, gravity) = good();
        change(&mut fingers);
        HandModel::new(fingers, gravity).unwrap_err().to_string()
    };
    let follows = |joint, ratio| Some(Follows { joint, ratio, offset: 0.0 });
    let follow = move |fingers: &mut Vec<Finger>, i: usize, leader, ratio| {
        let joint = &mut fingers[1].joints[i];
        (joint.follows, joint.tau_min, joint.tau_max) = (follows(leader, ratio), None, None);
    };
    let (fingers, gravity) = good();
    HandModel::new(fingers, gravity).unwrap();
    let cases: [(&str, Change); 14] = [
        ("hand.fingers[1].joints[2].follows.joint: expected 0 to 2, found 3", &|f| follow(f, 2, 3, 1.0)),
        ("hand.fingers[1].joints[2].follows.joint: expected a joint that", &|f| follow(f, 2, 2, 1.0)),
        ("hand.fingers[1].joints[1].follows.joint: expected a joint that", &|f| {
            follow(f, 1, 2, 1.0);
            follow(f, 2, 1, 1.0);
        }),
        ("hand.fingers[1].joints[2].follows: expected a finite ratio", &|f| follow(f, 2, 0, 0.0)),
        ("hand.fingers[1].joints[2].follows: expected a ratio and an offset that leave", &|f| {
            follow(f, 2, 0, 1.0);
            f[1].joints[2].lower = f[1].joints[0].upper + 0.1;
            f[1].joints[2].upper = f[1].joints[0].upper + 0.2;
        }),
        ("hand.fingers[1].joints[2].tau_max: expected none", &|f| {
            f[1].joints[2].follows = follows(0, 1.0);
            f[1].joints[2].tau_min = None;
        }),
        ("hand.fingers[0].joints[1].tau_max: expected a finite torque >= 0", &|f| {
            f[0].joints[1].tau_max = Some(-1.0);
        }),
        ("hand.fingers[0].joints[1].tau_min: expected a finite torque <= 0", &|f| {
            f[0].joints[1].tau_min = Some(f64::NAN);
        }),
        ("hand.fingers[0].joints[1].reference: expected an angle from", &|f| {
            f[0].joints[1].reference = Some(9.0);
        }),
        ("hand.fingers[0].joints[1].armature", &|f| f[0].joints[1].armature = -1.0),
        ("hand.fingers[0].joints[1].frictionloss", &|f| f[0].joints[1].frictionloss = f64::INFINITY),
        ("hand.fingers[0].joints[1].stiffness", &|f| f[0].joints[1].stiffness = f64::NAN),
        ("hand.fingers[0].joints[1].inertia", &|f| f[0].joints[1].inertia[0] = -1.0),
        ("hand.fingers[1].joints: expected 1 to 7", &|f| f[1].joints.clear()),
    ];
    for (expected, change) in cases {
        let found = message(change);
        assert!(found.starts_with(expected), "{found}");
    }
    let (mut fingers, gravity) = good();
    fingers[1].joints[1].tau_min = None;
    fingers[1].joints[1].name = "pip".into();
    let hand = HandModel::new(fingers, gravity).unwrap();
    let error = DualStagePlanner::new(hand, RECORDING.controller.clone(), Config::default()).err().unwrap();
    assert!(error.to_string().starts_with("hand: tau_min of the joint pip: expected a torque"), "{error}");
}
