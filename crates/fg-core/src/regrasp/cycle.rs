//! The phases between two turns: down, off, round, on, up; and what a fault leaves of them.

use super::path::{self, smooth, Axis};
use super::phase::Phase;
use super::view::View;
use super::{Regrasp, Scale, FELT, G, TURNS_FROM};
use crate::spatial::{linear, pose_error};

impl Regrasp {
    pub(super) fn lower(&mut self, view: &View<'_>, scale: Scale) {
        let c = &self.config;
        let r = scale.radius;
        let slower = self.governor.drift_speed(&self.up) - 2.0 * c.acceleration * G * self.dt;
        self.governor.drift(&self.up, slower.max(-c.lower_speed * r));
        let height = view.X_WO.translation.vector.dot(&self.up);
        let reference = self.out.X_WD.translation.vector.dot(&self.up);
        let lags = height - reference > c.down_lag * r;
        let light = self.force < c.down_share * self.force_in_air;
        self.felt = if lags && light { self.felt + self.dt } else { 0.0 };
        if self.felt >= FELT {
            self.rest = height;
            self.count += 1;
            self.governor.stand();
            self.reach.halt(view);
            // The support has taken over already.
            self.share = (self.force / self.force_in_air.max(1e-9)).clamp(0.0, 1.0);
            self.enter(Phase::Release);
        } else if reference < self.rest - c.down_search * r {
            self.unsupported = true;
            let height = self.governor.take_back();
            self.begin_lift(height);
        }
    }

    /// The fingers leave the object, for the next grasp or for good.
    pub(super) fn let_go(&mut self, view: &View<'_>) {
        let sense = self.governor.sense();
        let spread = f64::from(self.failed.div_ceil(2)) * self.config.retry_turn;
        let aside = if self.failed % 2 == 1 { spread } else { -spread };
        self.azimuth = -0.5 * self.config.stroke * sense + aside;
        let rests = self.failed > self.config.attempts;
        self.reach.leave(view, Axis::new(&self.place, &self.up), self.azimuth, rests);
        self.enter(if rests { Phase::Rest } else { Phase::Return });
    }

    pub(super) fn approach(&mut self, view: &View<'_>, scale: Scale) {
        let c = &self.config;
        let (touch, wait) = (c.touch_force, c.wait_force);
        let touch = self.force_share(touch, view.friction) * scale.weight;
        let wait = self.force_share(wait, view.friction) * scale.weight;
        self.reach.approach(view, c.approach_speed * scale.radius, touch, wait);
        if self.reach.waits() > c.touch_time {
            self.reach.halt(view);
            self.squeeze_from = wait;
            self.enter(Phase::Preload);
            self.squeeze = wait;
        } else if self.elapsed > c.approach_time {
            self.fail();
            self.share_from = 0.0;
            self.let_go(view);
        }
    }

    pub(super) fn check(&mut self, view: &View<'_>) {
        let c = &self.config;
        let s = (self.elapsed / c.check_time).min(1.0);
        self.share = s;
        if self.elapsed < 2.0 * c.check_time {
            return;
        }
        let delivered = self.delivers(view.psi);
        let touching = view.grasp.contacts().iter().all(|contact| contact.touching);
        if delivered && touching {
            self.reach.remember(view, &self.up);
            let height = self.governor.pick_up(view.asked, view.X_WO);
            self.begin_lift(height);
        } else {
            self.fail();
            self.enter(Phase::Release);
        }
    }

    pub(super) fn begin_lift(&mut self, height: f64) {
        self.lift_time = (path::PEAK * height / (self.config.acceleration * G)).sqrt().max(0.1);
        self.enter(Phase::Lift);
    }

    pub(super) fn lift(&mut self, view: &View<'_>, scale: Scale, acceleration: f64) {
        let s = self.elapsed / self.lift_time;
        let (share, rate) = smooth(s);
        self.governor.lift(share, rate / self.lift_time);
        self.squeeze = self.squeeze_from * (1.0 - s).max(0.0);
        if s > TURNS_FROM && !self.unsupported {
            let wanted = self.wanted(view, acceleration);
            self.turn(wanted, acceleration);
        }
        let error = linear(&pose_error(&self.out.X_WD, view.X_WO)).norm();
        if s >= 1.0 {
            self.governor.land();
            self.squeeze = 0.0;
            self.failed = 0;
            self.enter(if self.unsupported { Phase::Stand } else { Phase::Turn });
        } else if error > self.config.lift_error * scale.radius {
            self.fail();
            self.force_in_air = scale.weight;
            self.governor.drift(&self.up, 0.0);
            self.governor.stand();
            self.enter(Phase::Lower);
        }
    }

    /// What a fault leaves to do: what is in the air is held there, what lies is left alone.
    pub(super) fn freeze(&mut self, view: &View<'_>) {
        match self.phase {
            Phase::Return | Phase::Approach | Phase::Rest => self.reach.halt(view),
            Phase::Preload | Phase::Check => self.enter(Phase::Release),
            Phase::Release => {
                self.elapsed += self.dt;
                let left = (1.0 - self.elapsed / self.config.release_time.max(1e-9)).max(0.0);
                self.share = self.share_from * left;
                self.squeeze = self.squeeze_from * left;
            }
            Phase::Lower if view.weak => {
                if let Some(scale) = self.scale {
                    self.lower(view, scale);
                }
            }
            Phase::Turn | Phase::Brake | Phase::Lift if view.weak => {
                self.governor.stand();
                self.force_in_air = view.weight;
                self.enter(Phase::Lower);
            }
            _ => self.governor.stand(),
        }
    }

    /// A share of the weight that does not push the object over its support.
    pub(super) fn force_share(&self, share: f64, friction: f64) -> f64 {
        share * (friction / self.config.preload).min(1.0)
    }
}
