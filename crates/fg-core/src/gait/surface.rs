//! What the contacts tell of the object's surface: a circle about the axis of the motion, and planes that bound the object.
//!
//! No mesh is known. Each contact gives a point and a normal of the surface; together they give the radius with which the
//! surface bends about the axis of the coming motion. An object that is convex lies behind each of its tangent planes.

use crate::grasp::Contact;
use crate::hand::{HandModel, Part};
use crate::spatial::{angular, linear};
use nalgebra::{Rotation3, Unit, Vector3, Vector6};

/// The part of a normal across the axis below which the surface counts as flat there.
const ACROSS: f64 = 0.3;
/// A translation of the contacts that is this many times their turn is no turn.
const TRANSLATES: f64 = 10.0;
/// Cosine of how far round the axis from its contact the surface is taken to bend alike: 75 degrees.
const AROUND: f64 = 0.2588;
/// Share of the variance of the normals along the axis that a ball must explain.
const BALL: f64 = 0.8;

/// The surface at all contacts, and how it is about to move. Overwritten by [`Surface::learn`].
#[derive(Debug, Clone)]
pub struct Surface {
    n: usize,
    /// Twist of the object in W, and its origin.
    V: Vector6<f64>,
    origin: Vector3<f64>,
    /// Direction of the axis of the motion; None where it does not turn.
    axis: Option<Unit<Vector3<f64>>>,
    /// Mean distance of the contacts from their mean, m: the length by which everything else is measured.
    pub size: f64,
    /// Radius of the surface about the axis, m.
    bend: f64,
    /// Centre and radius of a ball, where the contacts tell one.
    ball: Option<(Vector3<f64>, f64)>,
    points: [Vector3<f64>; HandModel::MAX_FINGERS],
    normals: [Vector3<f64>; HandModel::MAX_FINGERS],
}

/// The contact of one finger on its way along the motion.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Place in W, m.
    pub p_W: Vector3<f64>,
    /// Normal into the object in W.
    pub n_W: Vector3<f64>,
    /// The finger's own way round: centre of the circle on which the tip's centre runs about the axis, and its radius; None
    /// where the surface is flat.
    circle: Option<(Vector3<f64>, f64)>,
    /// How far the tip has come off the surface, m.
    pub gap: f64,
}

impl Surface {
    /// A surface of which nothing is known.
    pub fn new() -> Self {
        let zeros = [Vector3::zeros(); HandModel::MAX_FINGERS];
        Self {
            n: 0,
            V: Vector6::zeros(),
            origin: Vector3::zeros(),
            axis: None,
            size: 0.0,
            bend: 0.0,
            ball: None,
            points: zeros,
            normals: zeros,
        }
    }

    /// Takes the contacts, of an object with its origin at `origin` that is about to move at the twist `V` in W.
    pub fn learn(&mut self, contacts: &[Contact], origin: &Vector3<f64>, V: &Vector6<f64>) {
        self.n = contacts.len();
        self.V = *V;
        self.origin = *origin;
        for (j, contact) in contacts.iter().enumerate() {
            self.points[j] = contact.p_WC;
            self.normals[j] = contact.n_W;
        }
        let n = self.n as f64;
        let mean = self.points().iter().sum::<Vector3<f64>>() / n;
        self.size = (self.points().iter().map(|p| (p - mean).norm()).sum::<f64>() / n).max(1e-6);
        let turns = angular(V).norm() * self.size * TRANSLATES > linear(V).norm();
        self.axis = Unit::try_new(angular(V), 1e-9).filter(|_| turns);
        let Some(axis) = self.axis else {
            self.ball = None;
            return;
        };
        // On a surface of revolution, p = c - bend n across the axis, whatever the heights: a least-squares fit.
        let across = |x: Vector3<f64>| x - axis.into_inner() * axis.dot(&x);
        let n_mean = self.normals().iter().sum::<Vector3<f64>>() / n;
        let (mut covariance, mut variance, mut along, mut spread, mut heights) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, normal) in self.points().iter().zip(self.normals()) {
            let (dp, dn) = (p - mean, normal - n_mean);
            covariance += across(dp).dot(&across(dn));
            variance += across(dn).norm_squared();
            along += axis.dot(&dp) * axis.dot(&dn);
            spread += axis.dot(&dn).powi(2);
            heights += axis.dot(&dp).powi(2);
        }
        let bend = if variance > 0.1 * n { -covariance / variance } else { self.size };
        self.bend = bend.clamp(0.3 * self.size, 3.0 * self.size);
        // A ball bends along the axis as well; a cylinder, a cone or contacts at one height tell nothing of it.
        let explained = along * along > BALL * spread * heights && along < 0.0;
        let told = spread > 0.01 * n && explained && (-along / spread / self.bend - 1.0).abs() < 0.3;
        let centre = mean + n_mean * self.bend;
        self.ball = told.then_some((centre, self.bend));
    }

    fn points(&self) -> &[Vector3<f64>] {
        &self.points[..self.n]
    }

    fn normals(&self) -> &[Vector3<f64>] {
        &self.normals[..self.n]
    }

    /// Velocity of the object's point that is now at `p_W`, m/s, once its origin has moved for `t` seconds.
    pub fn velocity(&self, p_W: &Vector3<f64>, t: f64) -> Vector3<f64> {
        linear(&self.V) + angular(&self.V).cross(&(p_W - self.origin - linear(&self.V) * t))
    }

    /// The largest speed of a contact, m/s.
    pub fn speed(&self) -> f64 {
        self.points().iter().map(|p| self.velocity(p, 0.0).norm()).fold(0.0, f64::max)
    }

    /// Where the march of finger `j`, with a tip of this radius, begins.
    pub fn spot(&self, j: usize, tip_radius: f64) -> Spot {
        let (p_W, n_W) = (self.points[j], self.normals[j]);
        let circle = self.axis.and_then(|axis| {
            let n_across = n_W - axis.into_inner() * axis.dot(&n_W);
            let share = n_across.norm();
            (share > ACROSS).then(|| (p_W + n_across * self.bend, (self.bend + tip_radius) * share))
        });
        Spot { p_W, n_W, circle, gap: 0.0 }
    }

    /// Moves `spot` on: the object has moved from time `t` on for `dt` seconds, and the tip's centre is now at `tip`.
    pub fn roll(&self, spot: &mut Spot, tip: &Vector3<f64>, tip_radius: f64, t: f64, dt: f64) {
        if let (Some(axis), Some((centre, radius))) = (self.axis, &mut spot.circle) {
            *centre += self.velocity(centre, t) * dt;
            let offset = tip - *centre;
            let across = offset - axis.into_inner() * axis.dot(&offset);
            let along = axis.into_inner() * axis.dot(&spot.n_W);
            let share = (1.0 - along.norm_squared()).max(0.0).sqrt();
            if let Some(out) = across.try_normalize(1e-9) {
                spot.n_W = along - out * share;
                spot.gap = (across.norm() - *radius) / share.max(ACROSS);
            }
        } else {
            let moved = spot.p_W + self.velocity(&spot.p_W, t) * dt;
            spot.gap = -spot.n_W.dot(&(tip + spot.n_W * tip_radius - moved));
        }
        spot.p_W = tip + spot.n_W * tip_radius;
    }

    /// What is known to bound the object, after `t` seconds of its motion, from where finger `j` touches at `spot`.
    pub fn bounds(&self, j: usize, spot: &Spot, t: f64) -> Bounds {
        let mut bounds =
            Bounds { n: 1, planes: [(spot.p_W, spot.n_W); MOST_PLANES], round: None, ball: None };
        if let (Some(axis), Some((centre, _))) = (self.axis, spot.circle) {
            let axis = axis.into_inner();
            let along = axis * axis.dot(&spot.n_W);
            let share = (1.0 - along.norm_squared()).max(0.0).sqrt();
            let out = (along - spot.n_W) / share.max(1e-9);
            let centre = centre + axis * axis.dot(&(spot.p_W - centre));
            bounds.round =
                Some(Round { axis, centre, radius: out.dot(&(spot.p_W - centre)), along, share, out });
        }
        if let Some((centre, radius)) = self.ball {
            bounds.ball = Some((centre + self.velocity(&centre, 0.0) * t, radius));
        }
        let turn = Rotation3::new(angular(&self.V) * t);
        let origin = self.origin + linear(&self.V) * t;
        for k in (0..self.n).filter(|k| *k != j) {
            bounds.add(origin + turn * (self.points[k] - self.origin), turn * self.normals[k]);
        }
        bounds
    }
}

/// The most planes that bound an object: one at each contact.
const MOST_PLANES: usize = HandModel::MAX_FINGERS;

/// A surface of revolution about an axis: where it is touched, `radius` from the axis in the direction `out`, its normal has the
/// part `along` along the axis and one of length `share` across it.
#[derive(Debug, Clone, Copy)]
struct Round {
    axis: Vector3<f64>,
    centre: Vector3<f64>,
    radius: f64,
    along: Vector3<f64>,
    share: f64,
    out: Vector3<f64>,
}

impl Round {
    /// Distance of `part` from the tangent plane that faces it, m; None where that is too far round from the contact.
    fn clearance(&self, part: &Part) -> Option<f64> {
        let on_axis = |p: &Vector3<f64>| self.centre + self.axis * self.axis.dot(&(p - self.centre));
        let mut nearest = part.nearest(&on_axis(part.centre()));
        nearest = part.nearest(&on_axis(&nearest));
        let out = (nearest - on_axis(&nearest)).try_normalize(1e-9)?;
        (out.dot(&self.out) > AROUND)
            .then(|| part.from_plane(&(self.centre + out * self.radius), &(self.along - out * self.share)))
    }
}

/// What bounds a convex object: it lies behind planes, in a surface of revolution, and in a ball where one is known.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    n: usize,
    planes: [(Vector3<f64>, Vector3<f64>); MOST_PLANES],
    round: Option<Round>,
    ball: Option<(Vector3<f64>, f64)>,
}

impl Bounds {
    fn add(&mut self, p_W: Vector3<f64>, n_W: Vector3<f64>) {
        self.planes[self.n] = (p_W, n_W);
        self.n += 1;
    }

    /// A lower bound of the distance of `part` from the object, m; no more than `enough` is looked for.
    pub fn clearance(&self, part: &Part, enough: f64) -> f64 {
        let mut best = f64::NEG_INFINITY;
        if let Some((centre, radius)) = &self.ball {
            best = part.from_point(centre) - radius;
        }
        if let Some(clear) =
            self.round.as_ref().filter(|_| best < enough).and_then(|round| round.clearance(part))
        {
            best = best.max(clear);
        }
        for (p_W, n_W) in &self.planes[..self.n] {
            if best > enough {
                break;
            }
            best = best.max(part.from_plane(p_W, n_W));
        }
        best
    }
}

impl Default for Surface {
    fn default() -> Self {
        Self::new()
    }
}
