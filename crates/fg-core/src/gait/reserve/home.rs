//! The way of each finger home: to where it was at the first grasp, as seen from the object, which has turned on since.

use super::Reserve;
use crate::grasp::Scene;
use crate::spatial::{angular, linear};
use nalgebra::Vector3;

impl Reserve {
    /// The vector from the contact of finger `j` to its home, where it was at the first grasp as seen from the object's origin,
    /// in W; m.
    pub fn way_home(&self, j: usize, scene: &Scene<'_>) -> Vector3<f64> {
        let home = self.first.contacts[j].p_WC - self.first.origin + scene.X_WO.translation.vector;
        home - scene.grasp.contact(j).p_WC
    }

    /// The way of finger `j` to the place that is `beyond` home, along the motion, m.
    pub fn way(&self, j: usize, beyond: f64, scene: &Scene<'_>) -> Vector3<f64> {
        self.way_home(j, scene) + self.direction(j, scene) * beyond
    }

    /// How far finger `j` has gone with the motion since it was at home, m; negative where it is behind.
    pub fn gone(&self, j: usize, scene: &Scene<'_>) -> f64 {
        -self.direction(j, scene).dot(&self.way_home(j, scene))
    }

    /// How far along the motion from home finger `j` should land, m: behind home by half of what it travels in `lead` seconds,
    /// but not so far that its march against the motion ends before.
    pub fn goal(&self, j: usize, lead: f64, scene: &Scene<'_>) -> f64 {
        let speed = self.velocity(j, scene).norm();
        let back = self.back[j].seconds;
        let farthest = if back.is_nan() { 0.0 } else { self.gone(j, scene) - back * speed };
        // Home itself has been reached before.
        farthest.max(-0.5 * lead * speed).min(0.0)
    }

    /// Velocity of the object at the contact of finger `j` in the motion that is coming, m/s.
    fn velocity(&self, j: usize, scene: &Scene<'_>) -> Vector3<f64> {
        let arm = scene.grasp.contact(j).p_WC - scene.X_WO.translation.vector;
        linear(&self.V[1]) + angular(&self.V[1]).cross(&arm)
    }

    fn direction(&self, j: usize, scene: &Scene<'_>) -> Vector3<f64> {
        self.velocity(j, scene).try_normalize(1e-9).unwrap_or_else(Vector3::zeros)
    }
}
