//! Linearised friction cones.

use crate::error::Error;
use nalgebra::Vector3;

/// A pyramid inside the Coulomb cone of a contact, in the contact frame C (z along the inward normal).
///
/// The paper writes the cone as `f = B beta, beta >= 0` (8c, 8d), the columns of B being the pyramid's edges. The same
/// set in facet form is `n_k . f >= 0` with `n_k = e_k x e_{k+1}`; the facets need no extra variables.
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

    /// The pyramid spanned by `edges`, in anticlockwise order seen against the normal.
    pub fn from_edges(edges: &[Vector3<f64>]) -> Result<Self, Error> {
        let m = edges.len();
        if !(3..=Self::MAX_EDGES).contains(&m) {
            return Err(Error::config("edges", format!("3 to {} edges", Self::MAX_EDGES), m));
        }
        let facets: Vec<_> = (0..m).map(|k| edges[k].cross(&edges[(k + 1) % m])).collect();
        let interior: Vector3<f64> = edges.iter().sum();
        for (k, facet) in facets.iter().enumerate() {
            if !facet.iter().all(|x| x.is_finite()) || facet.dot(&interior) <= 1e-12 {
                return Err(Error::config(
                    format!("edges[{k}]"),
                    "edges of a convex pyramid in anticlockwise order",
                    format!("{:?}", edges[k].as_slice()),
                ));
            }
        }
        let facets = facets.into_iter().map(|n| n.normalize()).collect();
        Ok(Self { edges: edges.to_vec(), facets })
    }

    /// The pyramid's edges e_k: the columns of B_i.
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
}
