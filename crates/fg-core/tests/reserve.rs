//! How far fingers can follow: clearances against exact distances, marches against the geometry of rolling, schedules against
//! what a person would decide.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

mod instances;

use fg_core::config::GaitConfig;
use fg_core::gait::march::{March, MarchEnd};
use fg_core::gait::schedule::Schedule;
use fg_core::gait::surface::Surface;
use fg_core::grasp::Contact;
use fg_core::hand::{separation, Block, Finger, HandModel, HandState, Joint, Part, Tip};
use instances::Random;
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector6};

const RADIUS: f64 = 0.03;
const TIP: f64 = 0.012;

/// A contact at `p` with the inward normal `n`.
fn contact(p: Vector3<f64>, n: Vector3<f64>) -> Contact {
    let mut grasp = fg_core::grasp::Grasp::new(&planar(1.0), 0.01);
    let mut contact = *grasp.contact(0);
    grasp.G.fill(0.0);
    contact.p_WC = p;
    contact.n_W = n;
    contact.R_WC = Matrix3::identity();
    contact.touching = true;
    contact
}

fn spin(rate: f64) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, rate)
}

/// Four contacts round the z axis on a cylinder, or on a ball at different heights.
fn contacts(random: &mut Random, ball: bool) -> Vec<Contact> {
    (0..4)
        .map(|j| {
            let angle = 1.5 * f64::from(j) + random.uniform(-0.3, 0.3);
            let z = random.uniform(-0.5, 0.5);
            let rho = if ball { (1.0 - z * z).sqrt() } else { 1.0 };
            let out = Vector3::new(rho * angle.cos(), rho * angle.sin(), z);
            let n = if ball { -out } else { -Vector3::new(angle.cos(), angle.sin(), 0.0) };
            contact(out * RADIUS, n)
        })
        .collect()
}

/// Two fingers of three joints about z in the plane: the first along x, its links as long as one another; all weightless.
fn planar(scale: f64) -> HandModel {
    let joint = |x: f64| Joint { position: [x, 0.0, 0.0], ..Joint::default() };
    let finger = |x: f64| Finger {
        name: "f".into(),
        joints: vec![joint(x), joint(0.05 * scale), joint(0.04 * scale)],
        tip: Tip { position: [0.03 * scale, 0.0, 0.0], radius: TIP },
        outline: vec![Block {
            joint: 2,
            position: [0.01 * scale, 0.0, 0.0],
            quaternion: [1.0, 0.0, 0.0, 0.0],
            half: [0.01 * scale, 0.008, 0.008],
            radius: 0.0,
        }],
    };
    HandModel::new(vec![finger(0.0), finger(0.5)], [0.0, 0.0, -9.81]).unwrap()
}

/// Any box, with its corner points.
fn any_box(random: &mut Random, centre: Vector3<f64>) -> (Part, Vec<Vector3<f64>>) {
    let turn = UnitQuaternion::from_scaled_axis(random.vector(2.0));
    let half =
        Vector3::new(random.uniform(0.002, 0.02), random.uniform(0.002, 0.02), random.uniform(0.002, 0.02));
    // A finger that is at `turn` where its joints are at zero is a way to a box in W that every user has.
    let q = turn.into_inner().coords;
    let joint = Joint { position: centre.into(), quaternion: [q.w, q.x, q.y, q.z], ..Joint::default() };
    let block = Block {
        joint: 0,
        position: [0.0; 3],
        quaternion: [1.0, 0.0, 0.0, 0.0],
        half: half.into(),
        radius: 0.0,
    };
    let finger = Finger {
        name: "f".into(),
        joints: vec![joint],
        tip: Tip { position: [0.0; 3], radius: 0.001 },
        outline: vec![block],
    };
    let hand = HandModel::new(vec![finger.clone(), finger], [0.0; 3]).unwrap();
    let mut state = HandState::new(&hand);
    state.update(&hand, &[0.0, 0.0]);
    let points = (0..8)
        .map(|k| {
            let sign = |bit: u32| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
            centre + turn * Vector3::new(sign(0) * half.x, sign(1) * half.y, sign(2) * half.z)
        })
        .collect();
    (state.part(&hand, 0, 1), points)
}

/// Distance of the convex hulls of two sets of points, by Frank-Wolfe with the better of two steps: from above.
fn hull_distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let (mut p, mut q) = (a[0], b[0]);
    let far = |points: &[Vector3<f64>], d: &Vector3<f64>| {
        *points.iter().max_by(|x, y| x.dot(d).total_cmp(&y.dot(d))).unwrap()
    };
    for _ in 0..4000 {
        let d = q - p;
        let (dp, dq) = (far(a, &d) - p, far(b, &-d) - q);
        let (step, move_) = (dp - dq, d);
        let t = (move_.dot(&step) / step.norm_squared().max(1e-18)).clamp(0.0, 1.0);
        p += dp * t;
        q += dq * t;
    }
    (q - p).norm()
}

#[test]
fn separations_never_exceed_the_distance_and_are_mostly_it() {
    let mut random = Random(3);
    let (mut exact, mut tried) = (0, 0);
    for _ in 0..60 {
        let (a, points_a) = any_box(&mut random, Vector3::zeros());
        let centre = random.vector(1.0).normalize() * 0.06;
        let (b, points_b) = any_box(&mut random, centre);
        let distance = hull_distance(&points_a, &points_b);
        let bound = separation(&a, &b, f64::INFINITY);
        assert!(bound <= distance + 2e-5, "{bound} > {distance}");
        if distance > 1e-3 {
            tried += 1;
            exact += u32::from(bound > 0.8 * distance - 1e-4);
        }
    }
    assert!(tried > 30 && exact * 10 >= tried * 8, "{exact} of {tried}");
}

#[test]
fn clearances_never_exceed_the_distance_from_a_cylinder_or_a_ball() {
    let mut random = Random(5);
    let mut surface = Surface::new();
    let mut close = 0;
    for trial in 0..400 {
        let ball = trial % 2 == 0;
        let contacts = contacts(&mut random, ball);
        surface.learn(&contacts, &Vector3::zeros(), &spin(0.1));
        let spot = surface.spot(0, TIP);
        // Near the finger's own contact, where its links are.
        let away = random.uniform(0.012, 0.03);
        let centre = contacts[0].p_WC - contacts[0].n_W * away + random.vector(0.012);
        let (part, points) = any_box(&mut random, centre);
        let truth = if ball {
            hull_distance(&points, &[Vector3::zeros()]) - RADIUS
        } else {
            let axis = [Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.0, 0.0, 1.0)];
            hull_distance(&points, &axis) - RADIUS
        };
        let bound = surface.bounds(0, &spot, 0.0).clearance(&part, f64::INFINITY);
        if truth > 0.0 {
            assert!(bound <= truth + 3e-4, "ball {ball}: {bound} > {truth}");
            close += u32::from(bound > truth - 0.1 * RADIUS);
        }
    }
    assert!(close > 150, "{close}: too careful to be of use");
}

/// A planar finger's posture with its tip's centre at distance `far` from the object's axis, which is at `centre`.
fn touching(hand: &HandModel, centre: &Vector3<f64>, far: f64) -> Option<Vec<f64>> {
    let mut state = HandState::new(hand);
    let mut q = vec![0.5, 0.6, 0.5, 0.0, 0.0, 0.0];
    for _ in 0..100 {
        state.update(hand, &q);
        let tip = state.tip(0).translation.vector;
        let out = tip - centre;
        let error = out.norm() - far;
        if error.abs() < 1e-12 {
            return Some(q);
        }
        let J = state.jacobian(0, &tip);
        let gradient = J.transpose() * (out / out.norm());
        for i in 0..3 {
            q[i] -= error * gradient[i] / gradient.norm_squared();
        }
    }
    None
}

#[test]
fn a_march_rolls_as_a_circle_rolls_on_a_circle() {
    let hand = planar(1.0);
    let centre = Vector3::new(0.06, 0.09, 0.0);
    let q = touching(&hand, &centre, RADIUS + TIP).unwrap();
    let mut state = HandState::new(&hand);
    state.update(&hand, &q);
    let begin = state.tip(0).translation.vector - centre;
    // Three more contacts of the same cylinder.
    let mut all = vec![contact(centre + begin.normalize() * RADIUS, -begin.normalize())];
    for k in 1..4 {
        let out = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.5 * f64::from(k)) * begin.normalize();
        all.push(contact(centre + out * RADIUS, -out));
    }
    for rate in [0.1, -0.1] {
        let mut surface = Surface::new();
        surface.learn(&all, &centre, &spin(rate));
        let stride = surface.size / (30.0 * surface.speed());
        state.update(&hand, &q);
        let mut march = March::new(&hand, 0, &q[..3], &surface, stride);
        let mut steps = 0;
        while steps < 12 && march.step(&hand, &mut state, &surface, &q[..3]).is_none() {
            steps += 1;
        }
        assert_eq!(steps, 12, "ended early at rate {rate}");
        let now = state.tip(0).translation.vector - centre;
        // The tip stays on the surface, and rolls without slip: equal arcs on the object and on the tip.
        assert!((now.norm() - RADIUS - TIP).abs() < 1e-4, "{}", now.norm());
        let azimuth = (begin.x * now.y - begin.y * now.x).atan2(begin.dot(&now));
        let tip_turn: f64 = (0..3).map(|i| march.q[i] - q[i]).sum();
        let object_turn = rate * march.seconds();
        let (on_object, on_tip) = (RADIUS * (object_turn - azimuth), TIP * (azimuth - tip_turn));
        // Each step of 2 degrees is straight, and the inverse a little damped.
        assert!((on_object - on_tip).abs() < 0.05 * RADIUS * object_turn.abs(), "{on_object} {on_tip}");
        assert!((march.spot.p_W - centre - now.normalize() * RADIUS).norm() < 1e-4);
    }
}

#[test]
fn a_march_ends_at_a_joint_before_its_limit() {
    let hand = planar(1.0);
    let centre = Vector3::new(0.06, 0.09, 0.0);
    let q = touching(&hand, &centre, RADIUS + TIP).unwrap();
    let mut fingers = hand.fingers().to_vec();
    fingers[0].joints[0].upper = q[0] + 0.1;
    fingers[0].joints[0].lower = q[0] - 0.1;
    let hand = HandModel::new(fingers, [0.0; 3]).unwrap();
    let mut state = HandState::new(&hand);
    let out = {
        state.update(&hand, &q);
        (state.tip(0).translation.vector - centre).normalize()
    };
    let all: Vec<_> = (0..4)
        .map(|k| {
            let out = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.5 * f64::from(k)) * out;
            contact(centre + out * RADIUS, -out)
        })
        .collect();
    for rate in [0.1, -0.1] {
        let mut surface = Surface::new();
        surface.learn(&all, &centre, &spin(rate));
        state.update(&hand, &q);
        let mut march = March::new(&hand, 0, &q[..3], &surface, 0.3);
        let end = (0..200).find_map(|_| march.step(&hand, &mut state, &surface, &q[..3]));
        if end == Some(MarchEnd::Joint) {
            let joint = hand.coordinate(0);
            assert!(march.q[0] - joint.lower > -0.02 && joint.upper - march.q[0] > -0.02);
            return;
        }
    }
    panic!("no march ended at the joint");
}

#[test]
fn a_ball_is_told_by_leaning_normals_and_a_cylinder_is_not() {
    let mut random = Random(11);
    let mut surface = Surface::new();
    // A small box right under the ball's equator, outside the ball and inside the cylinder about it.
    for ball in [true, false] {
        let contacts = contacts(&mut random, ball);
        surface.learn(&contacts, &Vector3::zeros(), &spin(0.1));
        let part = Part::ball(Vector3::new(0.8, 0.0, -0.8) * RADIUS, 0.05 * RADIUS);
        let clear = surface.bounds(0, &surface.spot(0, TIP), 0.0).clearance(&part, f64::INFINITY) > 0.0;
        assert_eq!(clear, ball);
    }
}

/// A schedule of four fingers that is told these reserves, s, and ways gone, radii, once.
fn schedule(seconds: [f64; 4], gone: [f64; 4]) -> Schedule {
    let mut schedule = Schedule::new(&four(), &GaitConfig::default(), 0.002);
    schedule.update(|j| seconds[j], |j| gone[j], None);
    schedule
}

fn four() -> HandModel {
    let hand = planar(1.0);
    let finger = hand.fingers()[0].clone();
    HandModel::new(vec![finger.clone(), finger.clone(), finger.clone(), finger], [0.0; 3]).unwrap()
}

#[test]
fn a_round_begins_when_the_last_finger_could_just_wait_for_the_others() {
    let g = schedule([9.0; 4], [0.0; 4]).gait_time();
    let unload = GaitConfig::default().unload_time;
    // All alike: the last of four waits for three gaits.
    let enough = 3.0 * g + unload + 0.55;
    assert!(!schedule([enough; 4], [0.5; 4]).in_round());
    assert!(schedule([enough - 0.1; 4], [0.5; 4]).in_round());
    // One alone is no hurry until its own reserve ends.
    assert!(!schedule([0.6 + unload, 99.0, 99.0, 99.0], [0.5; 4]).in_round());
    assert!(schedule([0.4 + unload, 99.0, 99.0, 99.0], [0.5; 4]).in_round());
    // Fingers at home have no way to go.
    assert!(!schedule([0.1; 4], [0.0; 4]).in_round());
}

#[test]
fn the_hardest_to_spare_goes_first_but_not_one_that_cannot_be_and_the_urgent_before_all() {
    let seconds = [2.0; 4];
    let mut hard = schedule(seconds, [0.5, 0.5, 0.5, 0.1]);
    for _ in 0..3 {
        assert!(hard.choice(|j| seconds[j]).is_none(), "before all are known");
        let asked = hard.asks().unwrap();
        hard.answer(asked, [0.2, 0.9, 1.5, 0.0][asked]);
    }
    assert_eq!(hard.asks(), None);
    assert_eq!(hard.choice(|j| seconds[j]), Some(1));
    let urgent = [0.3, 2.0, 2.0, 2.0];
    assert_eq!(hard.choice(|j| urgent[j]), Some(0));
    hard.start(1);
    hard.end(false);
    assert_eq!(hard.choice(|j| seconds[j]), Some(0));
    hard.start(0);
    hard.end(false);
    // Only the one that cannot be spared is left: the round waits.
    assert_eq!(hard.choice(|j| seconds[j]), None);
    assert!(hard.in_round());
}

#[test]
fn an_outline_that_cannot_be_used_is_named() {
    let good = planar(1.0).fingers().to_vec();
    for (change, field) in [
        ((|b: &mut Block| b.joint = 3) as fn(&mut Block), "outline[0].joint"),
        (|b| b.half[1] = -1.0, "outline[0].half"),
        (|b| b.radius = f64::NAN, "outline[0].radius"),
        (|b| b.quaternion = [0.0; 4], "outline[0].quaternion"),
        (|b| b.position[0] = f64::INFINITY, "outline[0].position"),
    ] {
        let mut fingers = good.clone();
        change(&mut fingers[1].outline[0]);
        let message = HandModel::new(fingers, [0.0; 3]).unwrap_err().to_string();
        assert!(message.contains(field), "{message}");
    }
}
