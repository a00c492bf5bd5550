//! The reference of an object that is set down and taken again.
//!
//! What is asked goes on turning while the object lies. The turn that it misses is its lag, about an axis that is fixed in
//! the object; it is made up for only once what is asked stands. Where the object is lifted or lowered, the reference is
//! also off by a displacement and a small rotation.

use crate::safety::odometry::moved;
use crate::signals::Reference;
use crate::spatial::{angular, linear, pose_error};
use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};

/// Asked turns slower than this are none, rad/s.
pub const STANDS: f64 = 1e-3;

/// See the module.
#[derive(Debug, Clone)]
pub struct Governor {
    dt: f64,
    /// Axis of the turn in the object's frame.
    axis_O: Vector3<f64>,
    /// How far the reference is behind what is asked, rad.
    lag: f64,
    /// Rate of the reference's turn, rad/s.
    rate: f64,
    /// Rate that was asked last, rad/s.
    asked: f64,
    /// The reference against the lagging one, m and rad in W, and its rate.
    offset: Vector6<f64>,
    offset_rate: Vector6<f64>,
    /// The offset at which a lift began.
    from: Vector6<f64>,
}

impl Governor {
    /// A governor at the control period `dt` that hands out what is asked.
    pub fn new(dt: f64) -> Self {
        let zero = Vector6::zeros();
        Self {
            dt,
            axis_O: Vector3::z(),
            lag: 0.0,
            rate: 0.0,
            asked: 0.0,
            offset: zero,
            offset_rate: zero,
            from: zero,
        }
    }

    /// Begins at what is `asked`, without lag, to turn about `up` as it lies in the object now.
    pub fn begin(&mut self, asked: &Reference, up: &Vector3<f64>) {
        *self = Self::new(self.dt);
        self.axis_O = asked.X_WD.rotation.inverse() * up;
        self.rate = self.asked_rate(asked);
        self.note(asked);
    }

    /// The rate of the turn that is asked, rad/s.
    fn asked_rate(&self, asked: &Reference) -> f64 {
        angular(&asked.V_WD).dot(&(asked.X_WD.rotation * self.axis_O))
    }

    fn note(&mut self, asked: &Reference) {
        let rate = self.asked_rate(asked);
        if rate.abs() > STANDS {
            self.asked = rate;
        }
    }

    /// Rate of the reference's turn, rad/s.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// How far the reference is behind what is asked, rad.
    pub fn lag(&self) -> f64 {
        self.lag
    }

    /// The sense in which the object is to be turned, +1 or -1.
    pub fn sense(&self) -> f64 {
        if self.asked < 0.0 {
            -1.0
        } else {
            1.0
        }
    }

    /// The rate to turn at: what is asked, or, where that stands, what makes up for the lag, and stops there at
    /// `acceleration` rad/s^2.
    pub fn wanted(&self, asked: &Reference, acceleration: f64) -> f64 {
        let rate = self.asked_rate(asked);
        if rate.abs() > STANDS {
            return rate;
        }
        let most = self.asked.abs().min((2.0 * acceleration * self.lag.abs()).sqrt());
        most * self.lag.signum()
    }

    /// Lets the rate approach `target` at `acceleration`, rad/s and rad/s^2.
    pub fn turn(&mut self, target: f64, acceleration: f64) {
        let change = acceleration * self.dt;
        self.rate += (target - self.rate).clamp(-change, change);
    }

    /// Stands still at once: the object lies.
    pub fn stand(&mut self) {
        self.rate = 0.0;
        self.offset_rate = Vector6::zeros();
    }

    /// Moves the reference off by `speed` along `up` from here on, m/s.
    pub fn drift(&mut self, up: &Vector3<f64>, speed: f64) {
        self.offset_rate = Vector6::new(up.x, up.y, up.z, 0.0, 0.0, 0.0) * speed;
    }

    /// Speed along `up` at which the reference moves off, m/s.
    pub fn drift_speed(&self, up: &Vector3<f64>) -> f64 {
        linear(&self.offset_rate).dot(up)
    }

    /// Starts a lift from the pose `X_WO` of an object that lies; returns its height, m.
    pub fn pick_up(&mut self, asked: &Reference, X_WO: &Isometry3<f64>) -> f64 {
        let turn = angular(&pose_error(X_WO, &self.lagging(asked))).dot(&(asked.X_WD.rotation * self.axis_O));
        self.lag -= turn;
        self.from = pose_error(X_WO, &self.lagging(asked));
        self.offset = self.from;
        linear(&self.from).norm()
    }

    /// Goes on with a lift, `share` of which is done, at `share_rate` 1/s.
    pub fn lift(&mut self, share: f64, share_rate: f64) {
        self.offset = self.from * (1.0 - share);
        self.offset_rate = -self.from * share_rate;
    }

    /// Starts a lift back from where the reference is.
    pub fn take_back(&mut self) -> f64 {
        self.from = self.offset;
        linear(&self.from).norm()
    }

    /// The reference of this step for what is `asked`.
    pub fn reference(&mut self, asked: &Reference) -> Reference {
        self.note(asked);
        let lag_rate = self.asked_rate(asked) - self.rate;
        self.lag += lag_rate * self.dt;
        self.offset += self.offset_rate * self.dt;
        let X = self.lagging(asked);
        let axis = asked.X_WD.rotation * self.axis_O;
        let mut V_WD = asked.V_WD + self.offset_rate;
        for (V, axis) in V_WD.iter_mut().skip(3).zip(&axis) {
            *V -= axis * lag_rate;
        }
        Reference { X_WD: moved(&X, &self.offset), V_WD }
    }

    /// What is asked for the step after a lift: the offset is done with.
    pub fn land(&mut self) {
        self.offset = Vector6::zeros();
        self.offset_rate = Vector6::zeros();
    }

    fn lagging(&self, asked: &Reference) -> Isometry3<f64> {
        let back = UnitQuaternion::from_scaled_axis(self.axis_O * -self.lag);
        Isometry3::from_parts(asked.X_WD.translation, asked.X_WD.rotation * back)
    }
}
