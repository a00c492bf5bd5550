//! The second way to change contacts: set the object down, take it again elsewhere, go on.
//!
//! Not in the paper, whose gait needs a finger that the others can do without. Hands of three fingers have none to spare, nor
//! has a hand at the limit of friction or torque. Here the object is set down on what it was lifted from, all fingers go
//! back round it, and lift it again. Only the paper's sensors are used: that the object lies is felt, in the wrench that K
//! asks for and in how far the object stays behind its reference, both at once; how high the support is, is known from the
//! first lift, and then from each time it was felt.
//!
//! | file | what |
//! |---|---|
//! | [`phase`] | the phases |
//! | [`config`] | every length, force and time, as shares of contact radius and weight |
//! | [`governor`] | the reference: what is asked, with the turn that was missed while the object lay |
//! | [`path`] | the way of a fingertip round the object |
//! | [`arms`] | the servo of fingers that are off the object |
//! | [`reach`] | the fingers between two grasps: return, approach, wait |
//! | [`spares`] | whether any finger can be spared |
//! | [`view`], `cycle` | what a step looks at; the phases between two turns |

pub mod arms;
pub mod config;
mod cycle;
pub mod governor;
pub mod path;
pub mod phase;
pub mod reach;
pub mod spares;
pub mod view;

use crate::hand::HandModel;
use crate::signals::Reference;
use crate::spatial::{angular, linear};
use config::{Change, RegraspConfig};
use governor::Governor;
use nalgebra::{Isometry3, Vector3, Vector6};
use phase::Phase;
use reach::Reach;
use spares::Spares;
use view::View;

/// Standard acceleration of gravity, the unit of accelerations, m/s^2.
const G: f64 = 9.81;
/// Time constant of the filters on forces, torques and the set-down's signs, s.
const FILTER: f64 = 0.01;
/// Time constant of the filter on torques that are close to their limits, s.
const TORQUE_FILTER: f64 = 0.05;
/// Time for which the signs of a set-down must last, s.
const FELT: f64 = 0.006;
/// Share of a lift after which the object turns again.
const TURNS_FROM: f64 = 0.4;
/// The object stands still this long before it goes down, s.
const CALM: f64 = 0.05;

/// Sizes of the first grasp, from which every length and force follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Mean distance of the contacts from the axis, m.
    pub radius: f64,
    /// Nominal weight, N.
    pub weight: f64,
}

/// See the module. All memory is allocated in [`Regrasp::new`].
#[derive(Debug, Clone)]
pub struct Regrasp {
    config: RegraspConfig,
    change: Change,
    dt: f64,
    phase: Phase,
    /// Time in the phase, s.
    elapsed: f64,
    governor: Governor,
    reach: Reach,
    up: Vector3<f64>,
    scale: Option<Scale>,
    /// Height of the object's origin when it lay last, m.
    rest: f64,
    spares: Spares,
    /// Where its origin is, behind the noise, m.
    place: Vector3<f64>,
    /// Where the fingers are, against the first grasp, rad: they turn with the object.
    azimuth: f64,
    /// Grasps that have failed in a row.
    failed: u32,
    /// Duration of this lift, s.
    lift_time: f64,
    /// No support was found by this lowering.
    unsupported: bool,
    /// Filtered vertical force, N, and for how long the signs of a set-down have lasted, s.
    force: f64,
    felt: f64,
    /// Vertical force in the air, N.
    force_in_air: f64,
    /// Filtered torques, N m.
    tau: Vec<f64>,
    /// Share of the weight that the fingers carry.
    share: f64,
    share_from: f64,
    /// Normal force on top of what the wrench needs, N.
    squeeze: f64,
    squeeze_from: f64,
    /// Set-downs so far.
    count: u64,
    out: Reference,
}

/// What a step of [`Regrasp`] tells the control step to do at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Orders {
    /// The object is about to go down: learn the wrench that holds it.
    pub learn: bool,
    /// The fingers press again: start from the forces that they feel.
    pub seize: bool,
    /// K is out of the loop, or in it again: it starts at rest.
    pub restart: bool,
}

impl Regrasp {
    /// A state machine for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &RegraspConfig, change: Change, dt: f64) -> Self {
        let still = Reference { X_WD: Isometry3::identity(), V_WD: Vector6::zeros() };
        Self {
            config: config.clone(),
            change,
            dt,
            phase: Phase::Idle,
            elapsed: 0.0,
            governor: Governor::new(dt),
            reach: Reach::new(hand, config, dt),
            up: hand.up(),
            scale: None,
            rest: 0.0,
            spares: Spares::default(),
            place: Vector3::zeros(),
            azimuth: 0.0,
            failed: 0,
            lift_time: 0.0,
            unsupported: false,
            force: 0.0,
            felt: 0.0,
            force_in_air: 0.0,
            tau: vec![0.0; hand.n_q()],
            share: 1.0,
            share_from: 1.0,
            squeeze: 0.0,
            squeeze_from: 0.0,
            count: 0,
            out: still,
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.enter(Phase::Idle);
        self.reach.reset();
        self.scale = None;
        self.spares = Spares::default();
        self.failed = 0;
        self.force = 0.0;
        self.tau.fill(0.0);
        self.share = 1.0;
        self.squeeze = 0.0;
        self.count = 0;
    }

    /// The present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// True where gaits are to be kept from starting: regrasping has taken over, for good.
    pub fn excludes_gaits(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// Share of the object's weight that the fingers carry.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Normal force of each finger on top of what the wrench needs, N.
    pub fn squeeze(&self) -> f64 {
        self.squeeze
    }

    /// Set-downs so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The reference of this step.
    pub fn reference(&self) -> &Reference {
        &self.out
    }

    /// The fingers between two grasps.
    pub fn reach(&self) -> &Reach {
        &self.reach
    }

    /// Which finger is in doubt.
    pub fn spares(&mut self) -> &mut Spares {
        &mut self.spares
    }

    /// True where a grasp that fails to deliver `psi` holds the object well enough.
    pub fn delivers(&self, psi: &Vector6<f64>) -> bool {
        self.scale.is_some_and(|scale| {
            let most = self.config.slack * scale.weight;
            linear(psi).norm() <= most && angular(psi).norm() <= most * scale.radius
        })
    }

    /// The object has slipped out of the fingers: it lies, somewhere, and is taken again.
    pub fn lose(&mut self) {
        if self.phase != Phase::Idle && !self.phase.is_open() {
            self.fail();
            self.enter(Phase::Release);
            self.share = 0.0;
            self.squeeze = 0.0;
        }
    }

    /// Goes through one step; [`Regrasp::reference`] is then what the object is to do.
    pub fn step(&mut self, view: &View<'_>) -> Orders {
        self.reach.observe(view.q);
        let before = self.phase;
        self.filter(view);
        if self.phase == Phase::Idle {
            self.idle(view);
        } else if view.fit {
            self.elapsed += self.dt;
            self.advance(view);
        } else {
            self.freeze(view);
        }
        self.out = if self.phase == Phase::Idle {
            *view.asked
        } else {
            let reference = self.governor.reference(view.asked);
            match self.phase {
                Phase::Check if before == Phase::Check => self.out,
                phase if phase.lies() => Reference { X_WD: *view.X_WO, V_WD: Vector6::zeros() },
                _ => reference,
            }
        };
        let entered = |phase| self.phase == phase && before != phase;
        Orders {
            learn: entered(Phase::Lower) && before == Phase::Brake,
            seize: entered(Phase::Preload),
            restart: entered(Phase::Release) || entered(Phase::Check),
        }
    }

    fn filter(&mut self, view: &View<'_>) {
        let share = 1.0 - (-self.dt / FILTER).exp();
        self.force += (linear(view.F_des).dot(&self.up) - self.force) * share;
        self.place += (view.X_WO.translation.vector - self.place) * share;
        let share = 1.0 - (-self.dt / TORQUE_FILTER).exp();
        for (filtered, tau) in self.tau.iter_mut().zip(view.tau) {
            *filtered += (tau - *filtered) * share;
        }
    }

    /// Before regrasping has begun: takes the measure of the first grasp, and waits until it is needed.
    fn idle(&mut self, view: &View<'_>) {
        if self.change == Change::Gait || !view.grasped {
            return;
        }
        let height = view.X_WO.translation.vector.dot(&self.up);
        let Some(scale) = self.scale else {
            self.scale = self.reach.measure(view, &self.up);
            self.rest = height;
            return;
        };
        let asked = view.asked.X_WD.translation.vector.dot(&self.up);
        let lifted = (asked - self.rest).min(height - self.rest) > self.config.lift_min * scale.radius;
        let stands = linear(&view.asked.V_WD).norm() < 1e-3 * scale.radius;
        let ready = lifted && stands && view.fit;
        let turns = angular(&view.asked.V_WD).dot(&self.up).abs() > governor::STANDS;
        self.spares.ask(self.change == Change::Auto && turns && ready, view.hand.n_fingers());
        let wanted =
            self.change == Change::Regrasp || view.overdue || self.spares.none(view.hand.n_fingers());
        if ready && wanted {
            self.governor.begin(view.asked, &self.up);
            self.azimuth = 0.0;
            self.enter(Phase::Turn);
        }
    }

    /// Moves on by one step of a phase.
    fn advance(&mut self, view: &View<'_>) {
        let Some(scale) = self.scale else { return };
        let c = &self.config;
        let turn_acceleration = c.acceleration * G / scale.radius;
        match self.phase {
            Phase::Turn => {
                let wanted = self.wanted(view, turn_acceleration);
                let over = self.turn(wanted, turn_acceleration);
                if over || view.strained || self.at_limits(view) {
                    self.enter(Phase::Brake);
                }
            }
            Phase::Brake | Phase::Stand => {
                self.turn(0.0, turn_acceleration);
                if self.governor.rate().abs() > 0.0 {
                    self.elapsed = 0.0;
                } else if self.phase == Phase::Brake && self.elapsed > CALM {
                    self.force_in_air = linear(view.steady).dot(&self.up);
                    self.enter(Phase::Lower);
                }
            }
            Phase::Lower => self.lower(view, scale),
            Phase::Release => {
                let s = (self.elapsed / c.release_time.max(1e-9)).min(1.0);
                self.share = self.share_from * (1.0 - s);
                self.squeeze = self.squeeze_from * (1.0 - s);
                if s >= 1.0 {
                    self.let_go(view);
                }
            }
            Phase::Return => {
                if self.reach.go(view, self.elapsed) {
                    self.enter(Phase::Approach);
                }
            }
            Phase::Approach => self.approach(view, scale),
            Phase::Rest => {
                self.reach.go(view, self.elapsed);
            }
            Phase::Preload => {
                let s = (self.elapsed / c.preload_time.max(1e-9)).min(1.0);
                let full = self.force_share(c.preload, view.friction) * scale.weight;
                self.squeeze = self.squeeze_from + (full - self.squeeze_from) * s;
                if s >= 1.0 {
                    self.enter(Phase::Check);
                }
            }
            Phase::Check => self.check(view),
            Phase::Lift => self.lift(view, scale, turn_acceleration),
            Phase::Idle => {}
        }
    }

    fn wanted(&self, view: &View<'_>, acceleration: f64) -> f64 {
        if view.stands {
            return 0.0;
        }
        self.governor.wanted(view.asked, acceleration)
    }

    /// Turns the reference at `wanted` rad/s as far as this grasp allows; true where it is at its end.
    fn turn(&mut self, wanted: f64, acceleration: f64) -> bool {
        let sense = if wanted < 0.0 { -1.0 } else { 1.0 };
        let left = (0.5 * self.config.stroke - self.azimuth * sense).max(0.0);
        let rate = wanted.abs().min((2.0 * acceleration * left).sqrt());
        self.governor.turn(sense * rate, acceleration);
        let step = self.governor.rate() * self.dt;
        self.azimuth += step;
        wanted != 0.0 && left < 1e-2
    }

    /// True where a joint is near the limit that it turns to, or a torque near its own.
    fn at_limits(&self, view: &View<'_>) -> bool {
        let c = &self.config;
        let joint = |(at, q): (usize, &f64)| {
            let coordinate = view.hand.coordinate(at);
            let to = if self.reach.velocity(at) > 0.0 { coordinate.upper - q } else { q - coordinate.lower };
            to < c.joint_margin
        };
        let torque = |(at, tau): (usize, &f64)| {
            let (min, max) = (view.limits.min()[at], view.limits.max()[at]);
            let limit = if *tau < 0.0 { -min } else { max };
            limit > 0.0 && tau.abs() > c.torque_share * limit
        };
        view.q.iter().enumerate().any(joint) || self.tau.iter().enumerate().any(torque)
    }

    fn fail(&mut self) {
        self.failed = self.failed.saturating_add(1);
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.elapsed = 0.0;
        self.felt = 0.0;
        self.share_from = self.share;
        self.squeeze_from = self.squeeze;
        if matches!(phase, Phase::Turn | Phase::Idle) {
            self.unsupported = false;
        }
    }
}
