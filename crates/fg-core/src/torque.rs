//! The joint torque controller: a PID around the motors at the faster torque rate, Section II.

use crate::config::TorqueConfig;
use crate::error::Error;
use crate::hand::TorqueLimits;

/// Share of the torque limit from which on a motor that is told a torque is expected to answer ...
const TOLD: f64 = 0.05;
/// ... with at least this share of it ...
const ANSWER: f64 = 0.25;
/// ... after this time, s: longer than any lag.
const LATE: f64 = 0.01;

/// Drives measured joint torques to desired ones. One instance serves all joints.
///
/// `tau_motor = tau_des + K_p e + K_i int(e) + K_d de/dt`, e = tau_des - tau, clipped to the torque limit; the integral
/// stands still while the output is clipped, and while the motor gives next to nothing of what it is told: what would
/// wind up while it has no power would come out once it has. A reading that is not finite leaves the feedforward alone.
#[derive(Debug, Clone)]
pub struct TorquePid {
    config: TorqueConfig,
    limits: TorqueLimits,
    dt: f64,
    integral: Vec<f64>,
    derivative: Vec<f64>,
    previous: Vec<Option<f64>>,
    /// What the motors were told last, N m.
    told: Vec<f64>,
    /// For how long each has given next to nothing of it, s.
    silent: Vec<f64>,
}

impl TorquePid {
    /// A controller for joints with `limits` at the period `dt`, s.
    pub fn new(limits: TorqueLimits, dt: f64, config: &TorqueConfig) -> Result<Self, Error> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(Error::config("dt", "a period > 0 s", dt));
        }
        let n = limits.n();
        let zeros = vec![0.0; n];
        let (integral, derivative, told) = (zeros.clone(), zeros.clone(), zeros.clone());
        let (previous, silent) = (vec![None; n], zeros);
        Ok(Self { config: config.clone(), limits, dt, integral, derivative, previous, told, silent })
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.integral.len()
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.integral.fill(0.0);
        self.derivative.fill(0.0);
        self.previous.fill(None);
        self.told.fill(0.0);
        self.silent.fill(0.0);
    }

    /// Writes the motor torques, N m, for the desired and the measured joint torques.
    pub fn step(&mut self, tau_des: &[f64], tau: &[f64], motor: &mut [f64]) -> Result<(), Error> {
        let n = self.n();
        for (field, found) in [("tau_des", tau_des.len()), ("tau", tau.len()), ("motor", motor.len())] {
            if found != n {
                return Err(Error::shape(field, n, found));
            }
        }
        for i in 0..n {
            motor[i] = self.joint(i, tau_des[i], tau[i]);
            self.told[i] = motor[i];
        }
        Ok(())
    }

    fn joint(&mut self, i: usize, tau_des: f64, tau: f64) -> f64 {
        let c = &self.config;
        let (min, max) = (self.limits.min()[i], self.limits.max()[i]);
        let limit = max.max(-min);
        // A command that is not finite commands nothing.
        let tau_des = if tau_des.is_finite() { tau_des.clamp(min, max) } else { 0.0 };
        if !tau.is_finite() {
            self.previous[i] = None;
            return tau_des;
        }
        let e = tau_des - tau.clamp(-4.0 * limit, 4.0 * limit);
        let rate = self.previous[i].map_or(0.0, |previous| (e - previous) / self.dt);
        self.previous[i] = Some(e);
        let memory = (-self.dt / c.derivative_filter).exp();
        self.derivative[i] = memory * self.derivative[i] + (1.0 - memory) * rate;
        let told = self.told[i];
        let answers = told.abs() <= TOLD * limit || tau * told.signum() >= ANSWER * told.abs();
        self.silent[i] = if answers { 0.0 } else { (self.silent[i] + self.dt).min(LATE) };
        let moves = self.silent[i] < LATE;
        let integral = self.integral[i] + if moves { c.K_i * e * self.dt } else { 0.0 };
        let wanted = tau_des + c.K_p * e + integral + c.K_d * self.derivative[i];
        let motor = wanted.clamp(min, max);
        if (wanted - motor) * e <= 0.0 {
            self.integral[i] = integral.clamp(-limit, limit);
        }
        motor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pid(n: usize) -> TorquePid {
        TorquePid::new(TorqueLimits::uniform(n, 0.5).unwrap(), 1e-3, &TorqueConfig::default()).unwrap()
    }

    #[test]
    fn tracks_a_step_through_a_lagging_motor() {
        let (mut pid, mut tau, mut motor) = (pid(1), [0.0], [0.0]);
        let share = 1.0 - (-1.0_f64 / 5.0).exp();
        let mut settled = 0.0;
        for k in 0..100 {
            pid.step(&[0.2], &tau, &mut motor).unwrap();
            tau[0] += share * (motor[0] - tau[0]);
            if (tau[0] - 0.2).abs() > 0.01 {
                settled = f64::from(k) * 1e-3;
            }
        }
        // The open motor needs 15 ms to come within 5 %.
        assert!(settled < 0.008, "{settled}");
        assert!((tau[0] - 0.2).abs() < 1e-3);
    }

    #[test]
    fn power_that_comes_back_finds_the_integral_as_it_was() {
        let (mut pid, mut motor) = (pid(1), [0.0]);
        for _ in 0..3000 {
            pid.step(&[0.1], &[0.0], &mut motor).unwrap();
        }
        let mut tau = [0.0];
        let share = 1.0 - (-1.0_f64 / 5.0).exp();
        for _ in 0..10 {
            pid.step(&[0.1], &tau, &mut motor).unwrap();
            tau[0] += share * (motor[0] - tau[0]);
            assert!(tau[0] < 0.13, "{}", tau[0]);
        }
        assert!((tau[0] - 0.1).abs() < 0.01, "{}", tau[0]);
    }

    #[test]
    fn nothing_but_finite_limited_torques_comes_out() {
        let mut pid = pid(4);
        let mut motor = [0.0; 4];
        let bad = [f64::NAN, f64::INFINITY, -1e300, 1e300];
        for _ in 0..10 {
            pid.step(&bad, &[0.1; 4], &mut motor).unwrap();
            assert!(motor.iter().all(|m| m.abs() <= 0.5));
            pid.step(&[0.1; 4], &bad, &mut motor).unwrap();
            assert!(motor.iter().all(|m| m.abs() <= 0.5));
        }
        pid.step(&[0.1; 3], &[0.1; 4], &mut motor).unwrap_err();
    }
}
