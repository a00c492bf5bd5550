//! The way of a fingertip round an object that lies: out, round, and in again.

use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// A place about the axis through the object's origin along `up`: distance from it, angle, rad, and height over the origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Distance from the axis, m.
    pub radius: f64,
    /// Angle about the axis, rad.
    pub angle: f64,
    /// Height over the object's origin, m.
    pub height: f64,
}

/// The axis at one instant, with a direction across it from which angles count.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    origin: Vector3<f64>,
    up: Vector3<f64>,
    x: Vector3<f64>,
    y: Vector3<f64>,
}

impl Axis {
    /// The axis along the unit vector `up` through `origin`; angles count in W.
    pub fn new(origin: &Vector3<f64>, up: &Vector3<f64>) -> Self {
        let across = if up.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let x = (across - up * up.dot(&across)).normalize();
        Self { origin: *origin, up: *up, x, y: up.cross(&x) }
    }

    /// The place of the point `p_W`.
    pub fn place(&self, p_W: &Vector3<f64>) -> Place {
        let p = p_W - self.origin;
        let (x, y) = (p.dot(&self.x), p.dot(&self.y));
        Place { radius: x.hypot(y), angle: y.atan2(x), height: p.dot(&self.up) }
    }

    /// The point at `place` in W.
    pub fn point(&self, place: &Place) -> Vector3<f64> {
        self.origin + self.outward(place.angle) * place.radius + self.up * place.height
    }

    /// The unit vector away from the axis at `angle`.
    pub fn outward(&self, angle: f64) -> Vector3<f64> {
        self.x * angle.cos() + self.y * angle.sin()
    }
}

/// The angle `a` shifted by whole turns to within half a turn of `near`.
pub fn unwrapped(a: f64, near: f64) -> f64 {
    near + (a - near + PI).rem_euclid(TAU) - PI
}

/// The quintic from 0 to 1 over s in 0..1 without velocity or acceleration at its ends (minimum jerk), and its derivative.
pub fn smooth(s: f64) -> (f64, f64) {
    let s = s.clamp(0.0, 1.0);
    (s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * (1.0 - s) * (1.0 - s))
}

/// Largest second derivative of [`smooth`].
pub const PEAK: f64 = 5.774;

/// Shares of the way's time: until it is clear of the object, from when and until when it goes round, and from when it goes
/// in.
const OUT: f64 = 0.4;
const ROUND: (f64, f64) = (0.1, 0.95);
const IN: f64 = 0.6;

/// Out to the radius `clear`, round to `to`, and in.
#[derive(Debug, Clone, Copy, Default)]
pub struct Way {
    /// Where it begins.
    pub from: Place,
    /// Where it ends.
    pub to: Place,
    /// Radius that is clear of the object, m.
    pub clear: f64,
}

impl Way {
    /// The place after the share `s` of the time.
    pub fn at(&self, s: f64) -> Place {
        let (out, _) = smooth(s / OUT);
        let (round, _) = smooth((s - ROUND.0) / (ROUND.1 - ROUND.0));
        let (inward, _) = smooth((s - IN) / (1.0 - IN));
        Place {
            radius: self.from.radius
                + (self.clear - self.from.radius) * out
                + (self.to.radius - self.clear) * inward,
            angle: self.from.angle + (self.to.angle - self.from.angle) * round,
            height: self.from.height + (self.to.height - self.from.height) * smooth(s).0,
        }
    }

    /// The shortest time in which no part of the way takes more than `acceleration` m/s^2, s.
    pub fn time(&self, acceleration: f64) -> f64 {
        let legs = [
            ((self.clear - self.from.radius).abs(), OUT),
            (self.clear * (self.to.angle - self.from.angle).abs(), ROUND.1 - ROUND.0),
            ((self.clear - self.to.radius).abs(), 1.0 - IN),
            ((self.to.height - self.from.height).abs(), 1.0),
        ];
        legs.into_iter()
            .map(|(length, share)| (PEAK * length / acceleration).sqrt() / share)
            .fold(0.0, f64::max)
    }
}
