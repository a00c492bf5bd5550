//! The outline of a finger's links: boxes with round edges, and how far these are from planes and from each other.

use super::layout::finite;
use super::HandModel;
use crate::error::Error;
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A box with round edges that moves with a link: all points within `radius` of a box. A box where `radius` is zero, a
/// capsule where two half-sides are, a ball where all are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Index in the finger's list of the joint whose link carries the block.
    pub joint: usize,
    /// Centre in the link's frame, m.
    pub position: [f64; 3],
    /// Orientation in the link's frame, wxyz.
    #[serde(default = "upright")]
    pub quaternion: [f64; 4],
    /// Half-sides of the box, m.
    #[serde(default)]
    pub half: [f64; 3],
    /// Radius of the edges, m.
    #[serde(default)]
    pub radius: f64,
}

fn upright() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl Block {
    /// The block in W where its link's frame is `X`.
    pub(super) fn at(&self, X: &Isometry3<f64>) -> Part {
        let [w, x, y, z] = self.quaternion;
        let own = Isometry3::from_parts(
            Translation3::from(Vector3::from(self.position)),
            UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
        );
        let X = X * own;
        let R = X.rotation.to_rotation_matrix();
        let half = Vector3::from(self.half);
        Part {
            centre: X.translation.vector,
            axes: R.matrix() * Matrix3::from_diagonal(&half),
            radius: self.radius,
            reach: half.norm() + self.radius,
        }
    }
}

/// An error that names the first field of `outline` that cannot be used; the finger has `joints` joints.
pub(super) fn check(field: &str, outline: &[Block], joints: usize) -> Result<(), Error> {
    if outline.len() > HandModel::MAX_BLOCKS {
        return Err(Error::config(field, format!("at most {} boxes", HandModel::MAX_BLOCKS), outline.len()));
    }
    for (i, block) in outline.iter().enumerate() {
        let at = format!("{field}[{i}]");
        if block.joint >= joints {
            let expected = format!("a joint of the finger, 0 to {}", joints.saturating_sub(1));
            return Err(Error::config(format!("{at}.joint"), expected, block.joint));
        }
        finite(&format!("{at}.position"), &block.position)?;
        finite(&format!("{at}.quaternion"), &block.quaternion)?;
        let norm = Vector3::from_column_slice(&block.quaternion[1..]).norm().hypot(block.quaternion[0]);
        if (norm - 1.0).abs() > 1e-3 {
            let found = format!("{:?}", block.quaternion);
            return Err(Error::config(format!("{at}.quaternion"), "a unit quaternion (wxyz)", found));
        }
        for (name, values) in [("half", &block.half[..]), ("radius", &[block.radius])] {
            if !values.iter().all(|x| x.is_finite() && *x >= 0.0) {
                let found = format!("{values:?}");
                return Err(Error::config(format!("{at}.{name}"), "finite lengths >= 0 m", found));
            }
        }
    }
    Ok(())
}

/// A block in W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Part {
    centre: Vector3<f64>,
    /// Half-sides as vectors, m.
    axes: Matrix3<f64>,
    radius: f64,
    /// Radius of the ball about the centre that holds it all, m.
    reach: f64,
}

impl Part {
    /// A ball.
    pub fn ball(centre: Vector3<f64>, radius: f64) -> Self {
        Self { centre, axes: Matrix3::zeros(), radius, reach: radius }
    }

    /// Its centre, m.
    pub fn centre(&self) -> &Vector3<f64> {
        &self.centre
    }

    /// Radius about its centre of the ball that holds it, m.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// How far it reaches from its centre along the unit vector `n`, m.
    #[inline]
    pub fn extent(&self, n: &Vector3<f64>) -> f64 {
        self.axes.tr_mul(n).abs().sum() + self.radius
    }

    /// Distance of all of it from the half-space n . (x - p) >= 0, m; negative where it reaches in.
    #[inline]
    pub fn from_plane(&self, p: &Vector3<f64>, n: &Vector3<f64>) -> f64 {
        -n.dot(&(self.centre - p)) - self.extent(n)
    }

    /// The point of its box that is nearest to `p`, m.
    pub fn nearest(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let offset = p - self.centre;
        let mut nearest = self.centre;
        for axis in self.axes.column_iter() {
            let square = axis.norm_squared();
            if square > 0.0 {
                nearest += axis * (offset.dot(&axis) / square).clamp(-1.0, 1.0);
            }
        }
        nearest
    }

    /// Distance from the point `p`, m; minus the radius of the edges inside the box.
    pub fn from_point(&self, p: &Vector3<f64>) -> f64 {
        (p - self.nearest(p)).norm() - self.radius
    }
}

/// A lower bound of the distance between two parts, m: the largest gap along the normals of their faces, the products of
/// their edges and the line between their centres. Exact where a face is nearest, and for balls. No more than `enough` is
/// looked for.
pub fn separation(a: &Part, b: &Part, enough: f64) -> f64 {
    let between = b.centre - a.centre;
    let distance = between.norm();
    let mut best = distance - a.reach - b.reach;
    if best > enough {
        return best;
    }
    let gap = |n: &Vector3<f64>| {
        let square = n.norm_squared();
        if square < 1e-24 {
            return f64::NEG_INFINITY;
        }
        let n = n / square.sqrt();
        n.dot(&between).abs() - a.extent(&n) - b.extent(&n)
    };
    best = best.max(gap(&between));
    for axis in a.axes.column_iter().chain(b.axes.column_iter()) {
        if best > enough {
            return best;
        }
        best = best.max(gap(&axis.into_owned()));
    }
    for u in a.axes.column_iter() {
        for v in b.axes.column_iter() {
            if best > enough {
                return best;
            }
            best = best.max(gap(&u.cross(&v)));
        }
    }
    best
}
