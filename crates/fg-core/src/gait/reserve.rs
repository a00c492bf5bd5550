//! Each finger's reserve: for how long it can follow the object's coming motion, and how far back it can go home.
//!
//! A finger is marched ([`March`]) along the desired twist, and against it, until a joint, its own links or another finger end
//! it. A control step takes one step of one march, so that its time is bounded; each reach has an age.

mod home;

use crate::gait::march::{March, MarchEnd};
use crate::gait::surface::Surface;
use crate::grasp::{Contact, Scene};
use crate::hand::{separation, HandModel, HandState, Part};
use crate::spatial::angular;
use nalgebra::{Vector3, Vector6};

/// Steps of a march; the fastest contact moves by 1 / `PER_SIZE` of the contacts' radius in each.
const STEPS: usize = 24;
const PER_SIZE: f64 = 30.0;
/// One march in this many goes back.
const BACK: usize = 4;
/// Least distances of links from the object and from other fingers, by the contacts' radius.
const CLEAR_OF_OBJECT: f64 = 0.03;
const CLEAR_OF_FINGERS: f64 = 0.06;
/// What a grasp search leaves free between links and the object at the first grasp, by the contacts' radius.
const CLEAR_AT_FIRST: f64 = 0.06;
/// A link that is nearer may be what touches, by the contacts' radius.
const AT_OBJECT: f64 = 0.03;
/// Rate of the filter on the desired twist, rad/s: a swing passes, the turn that is coming stays.
const TURN: f64 = 1.5;
/// Contacts that move by less than this share of their radius in a second stand.
const STANDS: f64 = 5e-3;

/// How far a finger can go.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Seconds of the desired motion, when the march ended; NaN: not known.
    pub seconds: f64,
    /// What ended it.
    pub end: MarchEnd,
    /// Time since, s.
    pub age: f64,
}

impl Reach {
    const UNKNOWN: Self = Self { seconds: f64::NAN, end: MarchEnd::Open, age: 0.0 };
}

/// The first grasp.
#[derive(Debug, Clone)]
struct First {
    q: Vec<f64>,
    contacts: Vec<Contact>,
    origin: Vector3<f64>,
}

/// The reserves of all fingers. Allocated once.
#[derive(Debug, Clone)]
pub struct Reserve {
    hand: HandModel,
    dt: f64,
    /// Kinematics of the finger that is on its march.
    scratch: HandState,
    /// And of one that is looked at aside.
    aside: HandState,
    surface: Surface,
    /// Desired twist behind two low passes.
    V: [Vector6<f64>; 2],
    first: First,
    known: bool,
    /// The object has begun to turn since: home is where the contacts were then.
    begun: bool,
    /// Axis of motion for which the bounds at the first grasp were computed, and by how much they are below what must be so:
    /// by finger and part, and by pair of fingers, m.
    calibrated: Option<Vector3<f64>>,
    clearance_bias: Vec<Vec<f64>>,
    gap_bias: Vec<Vec<f64>>,
    ahead: Vec<Reach>,
    back: Vec<Reach>,
    /// Outlines by finger and step of the last march ahead, and its last step.
    parts: Vec<Vec<Vec<Part>>>,
    last: Vec<usize>,
    march: Option<March>,
    /// Marches begun, and whether the present one goes ahead.
    turn: usize,
    forward: bool,
}

impl Reserve {
    /// The reserves of `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, dt: f64) -> Self {
        let n = hand.n_fingers();
        let parts = |j: usize| vec![vec![Part::default(); hand.n_parts(j)]; STEPS + 1];
        Self {
            dt,
            scratch: HandState::new(hand),
            aside: HandState::new(hand),
            surface: Surface::new(),
            V: [Vector6::zeros(); 2],
            first: First {
                q: vec![0.0; hand.n_q()],
                contacts: Vec::with_capacity(n),
                origin: Vector3::zeros(),
            },
            known: false,
            begun: false,
            calibrated: None,
            clearance_bias: (0..n).map(|j| vec![0.0; hand.n_parts(j)]).collect(),
            gap_bias: vec![vec![0.0; n]; n],
            ahead: vec![Reach::UNKNOWN; n],
            back: vec![Reach::UNKNOWN; n],
            parts: (0..n).map(parts).collect(),
            last: vec![0; n],
            march: None,
            turn: 0,
            forward: true,
            hand: hand.clone(),
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.V = [Vector6::zeros(); 2];
        self.known = false;
        self.begun = false;
        self.calibrated = None;
        self.turn = 0;
        self.forget();
    }

    fn forget(&mut self) {
        self.march = None;
        self.ahead.fill(Reach::UNKNOWN);
        self.back.fill(Reach::UNKNOWN);
    }

    /// The first grasp is complete. Home is where the contacts are once the object is about to move, settled by then.
    pub fn set_first_grasp(&mut self, scene: &Scene<'_>) {
        self.take_home(scene);
        self.known = true;
        self.begun = false;
    }

    fn take_home(&mut self, scene: &Scene<'_>) {
        self.first.q.copy_from_slice(scene.q);
        self.first.contacts.clear();
        self.first.contacts.extend_from_slice(scene.grasp.contacts());
        self.first.origin = scene.X_WO.translation.vector;
        self.calibrated = None;
        self.forget();
    }

    /// How long finger `j` can follow from now on, s; infinite where nothing is known or nothing moves.
    pub fn seconds(&self, j: usize) -> f64 {
        let Reach { seconds, age, .. } = self.ahead[j];
        if seconds.is_nan() {
            return f64::INFINITY;
        }
        (seconds - age).max(0.0)
    }

    /// The last marches of finger `j`: along the motion and against it.
    pub fn reaches(&self, j: usize) -> (&Reach, &Reach) {
        (&self.ahead[j], &self.back[j])
    }

    /// The posture of the first grasp, of all fingers, rad.
    pub fn first_posture(&self) -> &[f64] {
        &self.first.q
    }

    /// The twist that is coming, without swings, m/s and rad/s.
    pub fn twist(&self) -> &Vector6<f64> {
        &self.V[1]
    }

    /// Mean distance of the contacts from their mean, m.
    pub fn size(&self) -> f64 {
        self.surface.size
    }

    /// True where the object is about to turn, and reserves mean something.
    pub fn turns(&self) -> bool {
        self.known && self.surface.size > 0.0 && self.surface.speed() > STANDS * self.surface.size
    }

    /// Takes note of the desired twist `V_WD` and marches on; `free` is the finger that is on its way.
    pub fn update(&mut self, scene: &Scene<'_>, V_WD: &Vector6<f64>, free: Option<usize>) {
        let share = 1.0 - (-TURN * self.dt).exp();
        let [first, second] = &mut self.V;
        *first += (V_WD - *first) * share;
        let before = *second;
        *second += (*first - *second) * share;
        if !self.known {
            return;
        }
        for reach in self.ahead.iter_mut().chain(&mut self.back) {
            reach.age += self.dt;
        }
        if self.march.is_none() {
            self.surface.learn(scene.grasp.contacts(), &scene.X_WO.translation.vector, &self.V[1]);
        }
        if before.dot(&self.V[1]) < 0.0 || !self.turns() {
            self.forget();
            return;
        }
        if !self.begun && scene.grasp.n_touching() == self.hand.n_fingers() {
            self.begun = true;
            self.take_home(scene);
        }
        let axis = angular(&self.V[1]).try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
        if self.calibrated.is_none_or(|known| (known - axis).norm() > 0.2) {
            self.calibrate(axis);
            return;
        }
        if let Some(k) = free {
            self.ahead[k] = Reach::UNKNOWN;
            self.record(k, 0, scene.state);
            self.last[k] = 0;
        }
        self.march_on(scene, free);
    }

    /// One step of the march under way, or the beginning of the next one.
    fn march_on(&mut self, scene: &Scene<'_>, free: Option<usize>) {
        let Some(mut march) = self.march.take() else {
            self.begin(scene, free);
            return;
        };
        let (j, forward) = (march.finger, self.forward);
        let joints = self.hand.joints(j);
        let ended = march.step(&self.hand, &mut self.scratch, &self.surface, &self.first.q[joints]);
        let ended = ended.or_else(|| self.blocked(&march, forward));
        if ended.is_none() && forward {
            for i in 0..self.hand.n_parts(j) {
                self.parts[j][march.steps][i] = self.scratch.part(&self.hand, j, i);
            }
            self.last[j] = self.last[j].max(march.steps);
        }
        if ended.is_none() && march.steps < STEPS {
            self.march = Some(march);
            return;
        }
        // The step that ended it is not one that can be taken.
        let blocked = matches!(ended, Some(MarchEnd::Link | MarchEnd::Neighbour));
        let seconds = march.seconds() - if blocked { march.stride } else { 0.0 };
        let reach = Reach { seconds, end: ended.unwrap_or(MarchEnd::Open), age: 0.0 };
        if forward {
            self.last[j] = march.steps.min(STEPS) - usize::from(blocked);
            self.ahead[j] = reach;
        } else {
            self.back[j] = reach;
        }
    }

    /// Begins the next finger's march from where it is now.
    fn begin(&mut self, scene: &Scene<'_>, free: Option<usize>) {
        let n = self.hand.n_fingers();
        self.turn += 1;
        let back = self.turn % BACK == 0;
        let j = if back { self.turn / BACK } else { self.turn - self.turn / BACK } % n;
        let forward = !back;
        self.forward = forward;
        if Some(j) == free || !scene.grasp.contact(j).touching {
            return;
        }
        let V = if forward { self.V[1] } else { -self.V[1] };
        self.surface.learn(scene.grasp.contacts(), &scene.X_WO.translation.vector, &V);
        let q = &scene.q[self.hand.joints(j)];
        self.scratch.update_finger(&self.hand, j, q);
        if forward {
            self.record(j, 0, scene.state);
        }
        let stride = self.surface.size / (PER_SIZE * self.surface.speed().max(1e-9));
        self.march = Some(March::new(&self.hand, j, q, &self.surface, stride));
    }

    fn record(&mut self, j: usize, step: usize, state: &HandState) {
        for i in 0..self.hand.n_parts(j) {
            self.parts[j][step][i] = state.part(&self.hand, j, i);
        }
    }

    /// What is too near the links of the finger on its march, if anything is.
    fn blocked(&self, march: &March, forward: bool) -> Option<MarchEnd> {
        let (j, size) = (march.finger, self.surface.size);
        let bounds = self.surface.bounds(j, &march.spot, march.seconds());
        for i in 0..self.hand.n_parts(j) {
            let part = self.scratch.part(&self.hand, j, i);
            let needed = CLEAR_OF_OBJECT * size + self.clearance_bias[j][i];
            if i > 0 && bounds.clearance(&part, needed) < needed {
                return Some(MarchEnd::Link);
            }
            for k in (0..self.hand.n_fingers()).filter(|k| *k != j) {
                let step = if forward { march.steps.min(self.last[k]) } else { 0 };
                let needed = CLEAR_OF_FINGERS * size + self.gap_bias[j][k];
                if self.parts[k][step].iter().any(|other| separation(&part, other, needed) < needed) {
                    return Some(MarchEnd::Neighbour);
                }
            }
        }
        None
    }

    /// True where nothing of another finger, as it is now, is in the way of finger `j` to its home: at home, and at two places
    /// between.
    pub fn way_clear(&mut self, j: usize, scene: &Scene<'_>) -> bool {
        let joints = self.hand.joints(j);
        let mut q = [0.0; HandModel::MAX_JOINTS];
        for share in [1.0 / 3.0, 2.0 / 3.0, 1.0] {
            for (i, at) in joints.clone().enumerate() {
                q[i] = scene.q[at] + share * (self.first.q[at] - scene.q[at]);
            }
            self.aside.update_finger(&self.hand, j, &q[..joints.len()]);
            for i in 0..self.hand.n_parts(j) {
                let part = self.aside.part(&self.hand, j, i);
                for k in (0..self.hand.n_fingers()).filter(|k| *k != j) {
                    let needed = CLEAR_OF_FINGERS * self.surface.size + self.gap_bias[j][k];
                    let near = |l| separation(&part, &scene.state.part(&self.hand, k, l), needed) < needed;
                    if (0..self.hand.n_parts(k)).any(near) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// True where a link of finger `j` is at the object or next to it, as far as its outline tells.
    pub fn link_near(&self, j: usize, scene: &Scene<'_>) -> bool {
        let bounds = self.surface.bounds(j, &self.surface.spot(j, self.hand.tip_radius(j)), 0.0);
        (1..self.hand.n_parts(j)).any(|i| {
            let part = scene.state.part(&self.hand, j, i);
            let near = AT_OBJECT * self.surface.size + self.clearance_bias[j][i];
            bounds.clearance(&part, near) < near
        })
    }

    /// Computes by how much the bounds of clearance are too careful at the first grasp, where nothing touched but the tips.
    fn calibrate(&mut self, axis: Vector3<f64>) {
        self.calibrated = Some(axis);
        self.surface.learn(&self.first.contacts, &self.first.origin, &self.V[1]);
        self.scratch.update(&self.hand, &self.first.q);
        let n = self.hand.n_fingers();
        for j in 0..n {
            let bounds = self.surface.bounds(j, &self.surface.spot(j, self.hand.tip_radius(j)), 0.0);
            for i in 0..self.hand.n_parts(j) {
                let part = self.scratch.part(&self.hand, j, i);
                let needed = CLEAR_AT_FIRST * self.surface.size;
                let bias = bounds.clearance(&part, needed) - needed;
                self.clearance_bias[j][i] = bias.min(0.0);
                self.parts[j][0][i] = part;
            }
            self.last[j] = 0;
        }
        let needed = 2.0 * CLEAR_OF_FINGERS * self.surface.size;
        for j in 0..n {
            for k in (0..n).filter(|k| *k != j) {
                let pairs =
                    self.parts[j][0].iter().flat_map(|a| self.parts[k][0].iter().map(move |b| (a, b)));
                let gap = pairs.map(|(a, b)| separation(a, b, needed)).fold(f64::INFINITY, f64::min);
                self.gap_bias[j][k] = (gap - needed).min(0.0);
            }
        }
        self.march = None;
    }
}
