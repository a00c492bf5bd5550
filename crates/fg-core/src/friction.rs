//! Linearised friction cones.

use crate::error::Error;
use nalgebra::Vector3;

/// A pyramid inside the Coulomb cone of a contact, in the contact frame C (z along the inward normal).
///
/// The paper writes the cone as `f = B beta, beta >= 0` (8c, 8d), the columns of B being the pyramid's edges. The same
/// set in facet form is `n_k . f >= 0` with `n_k = e_k x e_{k+1}` of neighbouring edges; it needs no extra variables.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionPyramid {
    edges: Vec<Vector3<f64>>,
    facets: Vec<Vector3<f64>>,
}

impl FrictionPyramid {
    /// Largest number of edges that the solvers are built for.
    pub const MAX_EDGES: usize = 12;

    /// The pyramid with `n_edges` edges inscribed in the cone of friction coefficient `mu`, so that it is conservative.
    pub fn inscribed(mu: f64, n_edges: usize) -> Result<Self, Error> {
        if !(mu.is_finite() && mu > 0.0) {
            return Err(Error::config("friction", "a finite number > 0", mu));
        }
        let edges: Vec<_> = (0..n_edges).map(|k| inscribed_edge(mu, k, n_edges)).collect();
        Self::from_edges(&edges)
    }

    /// Makes this the inscribed pyramid of friction coefficient `mu`, with as many edges as now; allocates nothing.
    pub fn set_friction(&mut self, mu: f64) -> Result<(), Error> {
        if !(mu.is_finite() && mu > 0.0) {
            return Err(Error::config("friction", "a finite number > 0", mu));
        }
        let m = self.edges.len();
        for (k, edge) in self.edges.iter_mut().enumerate() {
            *edge = inscribed_edge(mu, k, m);
        }
        for k in 0..m {
            self.facets[k] = self.edges[k].cross(&self.edges[(k + 1) % m]).normalize();
        }
        Ok(())
    }

    /// The pyramid spanned by `edges`: all `f = B beta, beta >= 0`. Their order and length are free, and an edge inside the
    /// pyramid of the others adds no facet.
    ///
    /// A [`Error::Config`] unless there are 3 to 12 edges, which enclose a volume and lie within 90 degrees of their mean.
    pub fn from_edges(edges: &[Vector3<f64>]) -> Result<Self, Error> {
        if !(3..=Self::MAX_EDGES).contains(&edges.len()) {
            return Err(Error::config("edges", format!("3 to {} edges", Self::MAX_EDGES), edges.len()));
        }
        let mut mean = Vector3::zeros();
        for (k, edge) in edges.iter().enumerate() {
            let length = edge.norm();
            if !(length.is_finite() && length > 0.0) {
                let found = format!("{:?}", edge.as_slice());
                return Err(Error::config(format!("edges[{k}]"), "a finite vector that is not zero", found));
            }
            mean += edge / length;
        }
        let mean = mean / mean.norm();
        // Where the edges pierce the plane at distance 1 along their mean.
        let (x, y) = basis(&mean);
        let mut points = Vec::with_capacity(edges.len());
        for (k, edge) in edges.iter().enumerate() {
            let height = edge.dot(&mean);
            // Also refuses a mean that is not a number.
            if height.is_nan() || height <= 1e-6 * edge.norm() {
                let found = format!("{:?}", edge.as_slice());
                return Err(Error::config(
                    format!("edges[{k}]"),
                    "an edge within 90 degrees of the edges' mean",
                    found,
                ));
            }
            points.push([edge.dot(&x) / height, edge.dot(&y) / height]);
        }
        let hull = convex_hull(&points);
        if hull.len() < 3 {
            return Err(Error::config("edges", "edges that enclose a volume", "edges in one plane"));
        }
        let facets = (0..hull.len())
            .map(|k| edges[hull[k]].cross(&edges[hull[(k + 1) % hull.len()]]).normalize())
            .collect();
        Ok(Self { edges: edges.to_vec(), facets })
    }

    /// The pyramid's edges e_k, as given: the columns of B_i.
    pub fn edges(&self) -> &[Vector3<f64>] {
        &self.edges
    }

    /// Inward facet normals of unit length: the pyramid is `n_k . f >= 0` for all k.
    pub fn facets(&self) -> &[Vector3<f64>] {
        &self.facets
    }

    /// True where the force `f` lies in the pyramid, within `tolerance` newtons.
    pub fn contains(&self, f: &Vector3<f64>, tolerance: f64) -> bool {
        self.facets.iter().all(|n| n.dot(f) >= -tolerance)
    }
}

/// Two unit vectors that make a right-handed frame with the unit vector `z`.
fn basis(z: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let other = if z.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let x = other.cross(z).normalize();
    (x, z.cross(&x))
}

/// Indices of the corners of the points' convex hull, anticlockwise from the corner that comes first in `points`.
fn convex_hull(points: &[[f64; 2]]) -> Vec<usize> {
    let size = points.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    // Twice the area of a triangle; one below this part of the whole counts as flat.
    let area = |i: usize, j: usize, k: usize| {
        let ([ax, ay], [bx, by], [cx, cy]) = (points[i], points[j], points[k]);
        (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    };
    let flat = 1e-9 * size * size;
    let mut order: Vec<_> = (0..points.len()).collect();
    order.sort_by(|a, b| {
        points[*a][0].total_cmp(&points[*b][0]).then(points[*a][1].total_cmp(&points[*b][1]))
    });
    let half = |order: &mut dyn Iterator<Item = usize>| {
        let mut chain: Vec<usize> = Vec::new();
        for k in order {
            while chain.len() >= 2 && area(chain[chain.len() - 2], chain[chain.len() - 1], k) <= flat {
                chain.pop();
            }
            chain.push(k);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut order.iter().copied());
    hull.extend(half(&mut order.iter().rev().copied()));
    let first = hull.iter().enumerate().min_by_key(|(_, k)| **k).map_or(0, |(at, _)| at);
    hull.rotate_left(first);
    hull
}

fn inscribed_edge(mu: f64, k: usize, n_edges: usize) -> Vector3<f64> {
    let angle = std::f64::consts::TAU * k as f64 / n_edges as f64;
    Vector3::new(mu * angle.cos(), mu * angle.sin(), 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changing_the_friction_equals_a_fresh_pyramid() {
        let mut pyramid = FrictionPyramid::inscribed(0.8, 8).unwrap();
        pyramid.set_friction(0.5).unwrap();
        assert_eq!(pyramid, FrictionPyramid::inscribed(0.5, 8).unwrap());
    }
    #[test]
    fn order_length_and_inner_edges_do_not_change_the_set() {
        let mu = 0.5;
        let pyramid = FrictionPyramid::inscribed(mu, 4).unwrap();
        let e = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let shuffled = [
            e(mu, 0.0, 1.0),
            e(-2.0 * mu, 0.0, 2.0),
            e(0.1, 0.1, 1.0),
            e(0.0, mu, 1.0),
            e(0.0, -mu, 1.0),
            e(mu, 0.0, 1.0),
        ];
        let other = FrictionPyramid::from_edges(&shuffled).unwrap();
        assert_eq!(other.facets().len(), 4);
        assert_eq!(other.edges().len(), 6);
        for facet in pyramid.facets() {
            assert!(other.facets().iter().any(|n| (n - facet).norm() < 1e-12), "{facet}");
        }
        let clockwise: Vec<_> = pyramid.edges().iter().rev().copied().collect();
        assert_eq!(FrictionPyramid::from_edges(&clockwise).unwrap().facets().len(), 4);
    }

    #[test]
    fn every_edge_lies_in_the_pyramid_and_the_cone() {
        for (mu, m) in [(0.1, 3), (0.5, 4), (1.0, 7), (3.0, 12)] {
            let pyramid = FrictionPyramid::inscribed(mu, m).unwrap();
            assert_eq!(pyramid.facets().len(), m);
            for edge in pyramid.edges() {
                assert!(pyramid.contains(edge, 1e-12));
                assert!(edge.xy().norm() <= mu * edge.z + 1e-12);
            }
            assert!(pyramid.contains(&Vector3::z(), 0.0));
            assert!(!pyramid.contains(&-Vector3::z(), 1e-3));
        }
    }

    #[test]
    fn edges_that_make_no_pyramid_are_refused_by_name() {
        let e = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let message = |edges: &[Vector3<f64>]| FrictionPyramid::from_edges(edges).unwrap_err().to_string();
        assert!(message(&[e(1.0, 0.0, 1.0), e(0.0, 1.0, 1.0)]).starts_with("edges: expected 3 to 12 edges"));
        assert!(
            message(&[e(1.0, 0.0, 1.0), e(0.0, f64::NAN, 1.0), e(-1.0, 0.0, 1.0)]).starts_with("edges[1]")
        );
        assert!(message(&[e(1.0, 0.0, 1.0), e(0.0, 0.0, 1.0), e(-1.0, 0.0, 1.0)]).contains("volume"));
        assert!(message(&[e(1.0, 0.0, 0.0), e(-1.0, 1.0, 0.0), e(0.0, -1.0, 0.0)]).contains("90 degrees"));
        assert!(FrictionPyramid::inscribed(0.0, 4).is_err());
    }
}
