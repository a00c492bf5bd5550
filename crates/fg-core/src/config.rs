//! Every parameter of the control step, once. `Default` is the paper's parameter list (Section V-B).

use crate::error::Error;
use crate::manipulation::force::SolverChoice;
use crate::regrasp::config::{Change, RegraspConfig};
use crate::safety::config::SafetyConfig;
use serde::{Deserialize, Serialize};

/// All parameters of [`crate::dual_stage::DualStagePlanner`] and [`crate::torque::TorquePid`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Rate of the control step, Hz. The paper: 500.
    pub rate_hz: f64,
    /// Nominal mass of the object for the compensation of gravity, kg; `null`: the artefact's nominal mass.
    pub mass: Option<f64>,
    /// Section III: the gait planner.
    pub gait: GaitConfig,
    /// Section IV-B: the force optimiser.
    pub force: ForceConfig,
    /// Section IV-A: what surrounds K at run time.
    pub robust: RobustConfig,
    /// Section II: the joint torque controller.
    pub torque: TorqueConfig,
    /// The second way to change contacts: set down, take again. Deviation: not in the paper.
    pub regrasp: RegraspConfig,
    /// When a measurement is not believed, and what then happens. Deviation: the paper's sensors work.
    pub safety: SafetyConfig,
    /// Marks of the [`crate::rules`] whose fields were stated.
    #[serde(skip)]
    pub(crate) stated: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            rate_hz: 500.0,
            mass: None,
            gait: GaitConfig::default(),
            force: ForceConfig::default(),
            robust: RobustConfig::default(),
            torque: TorqueConfig::default(),
            regrasp: RegraspConfig::default(),
            safety: SafetyConfig::default(),
            stated: 0,
        }
    }
}

/// The plane on which the contacts are projected for Q_o.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QualityPlane {
    /// The paper's: the plane through the contacts themselves.
    Contacts,
    /// The plane of the first grasp, fixed in the object.
    Object,
}

/// Parameters of the velocity-level gait planner, eqs. (1) to (5).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GaitConfig {
    /// False: all fingers always hold the object.
    pub enabled: bool,
    /// How contacts are changed: "auto", "gait" or "regrasp". Deviation: the paper's hand has gaits only.
    pub change: Change,
    /// Weight of the object grasp quality Q_o, 1/m^2, eq. (1).
    pub w1: f64,
    /// Weight of the hand manipulability Q_h, eq. (1).
    ///
    /// Deviation: the paper has 0.01. Q_o alone ends a gait 14 degrees short of the finger's middle position; only Q_h
    /// pulls it further, and with 0.02 the planner has capacity to spare.
    pub w2: f64,
    /// Weight of the height term -w_z/2 (h - h_ref)^2, 1/m^2. Deviation: not in the paper, where nothing holds the
    /// contacts' heights on the object; zero turns it off.
    pub w_z: f64,
    /// Look-ahead of the height term, s.
    pub height_horizon: f64,
    /// Plane of Q_o. Deviation: the paper's plane tilts when contact heights differ, and the heights run away.
    pub plane: QualityPlane,
    /// q_thres as a fraction of half the joint range, where c_k starts to grow.
    pub q_thres: f64,
    /// Joint speed limit of the gait, rad/s, (4b).
    pub qd_max: f64,
    /// Largest change of the desired joint velocity in one step of 2 ms, rad/s, (4d); scaled with the control period.
    ///
    /// Deviation: the paper has 0.002. It makes a gait of 0.8 s: at 0.2 rad/s the planner never rests, and 0.4 rad/s is out
    /// of reach.
    pub sigma: f64,
    /// Deviation: centre the box (4d) on the previous velocity projected onto the present tangent plane, so that the LP
    /// is always feasible. False: the paper's box.
    pub project_rate_box: bool,
    /// Quality rate below which a gait ends, 1/s.
    pub delta: f64,
    /// Velocity gain of eq. (5), N m s/rad; `null`: the damping of each joint, with which K_v qd_des turns it at qd_des.
    pub K_v: Option<f64>,
    /// Bandwidth of the loop that closes the free finger's velocity on the encoders, 1/s; zero: K_v alone, as in the paper,
    /// where a finger whose damping is not as modelled runs ahead or stays behind.
    pub velocity_bandwidth: f64,
    /// Time constant of the filter on the differences of the encoders, s.
    pub velocity_filter: f64,
    /// Force gain of eq. (5).
    pub K_f: f64,
    /// Desired normal force of a sliding finger, N. The paper: "a constant small force".
    pub f_des: f64,
    /// Let (4c) follow the desired motion of the surface. Deviation: the paper's surface stands still.
    pub follow_surface: bool,
    /// Speed towards the surface of a finger that has lost it, m/s. Deviation: the paper relies on the force term.
    pub approach_speed: f64,
    /// Time constant of the filter on the measured normal force, s.
    pub force_filter: f64,
    /// delta_Q = Q(first grasp) - margin, eq. (1).
    pub threshold_margin: f64,
    /// Time over which a finger is unloaded before it slides, s.
    pub unload_time: f64,
    /// Time over which a finger is loaded after it has slid, s.
    pub load_time: f64,
    /// A gait lasts at least this long, s: Q-dot is below delta while the finger accelerates.
    pub min_slide_time: f64,
    /// A gait lasts at most this long, s.
    pub max_slide_time: f64,
    /// A gait also ends when Q exceeds its threshold by this much. The paper ends it at the threshold.
    pub hysteresis: f64,
    /// Largest force that the remaining fingers may fail to deliver when a finger is freed, N.
    pub slack_force: f64,
    /// Largest torque that the remaining fingers may fail to deliver when a finger is freed, N m.
    pub slack_torque: f64,
    /// A gait is broken off when the slack exceeds this multiple of the two limits above.
    pub abort_factor: f64,
    /// The desired motion stands where Q is below its threshold by more than this ... Deviation: not in the paper, where
    /// the object turns on though no finger can be freed.
    pub overdue_margin: f64,
    /// ... and no finger could be freed for this long, s.
    pub overdue_time: f64,
    /// Normal force below which a tactile reading counts as no contact, N.
    pub contact_force: f64,
}

impl Default for GaitConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            change: Change::Gait,
            w1: 0.99,
            w2: 0.02,
            w_z: 8.0,
            height_horizon: 0.1,
            plane: QualityPlane::Object,
            q_thres: 0.5,
            qd_max: 1.0,
            sigma: 0.008,
            project_rate_box: true,
            delta: 1e-5,
            K_v: None,
            velocity_bandwidth: 4.0,
            velocity_filter: 0.005,
            K_f: 1.5,
            f_des: 0.15,
            follow_surface: true,
            approach_speed: 0.02,
            force_filter: 0.02,
            threshold_margin: 1.2e-3,
            unload_time: 0.08,
            load_time: 0.1,
            min_slide_time: 0.1,
            max_slide_time: 1.5,
            hysteresis: f64::MAX,
            slack_force: 0.4,
            slack_torque: 0.0125,
            abort_factor: 4.0,
            overdue_margin: 1.2e-3,
            overdue_time: 0.3,
            contact_force: 0.01,
        }
    }
}

/// Parameters of the force optimisation QP, eq. (8).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForceConfig {
    /// Weight of |f|^2.
    pub alpha1: f64,
    /// Weight of |f - f_prev|^2.
    pub alpha2: f64,
    /// Weight of |Psi|^2.
    pub alpha3: f64,
    /// Length that weighs torques against forces in Psi, m: |Psi|^2 counts Psi_torque / length. Deviation: the paper adds
    /// newtons and newton metres (length 1 m), which leaves a torque of 3 mN m, 10 mrad of the object, undelivered.
    pub torque_length: f64,
    /// Assumed friction coefficient: should be below the true one, because the optimum lies on the cone's edge. At a true
    /// friction of 1 the cautious 0.65 costs no accuracy against 0.8.
    pub friction: f64,
    /// Edges of the friction pyramid.
    pub edges: usize,
    /// Largest torque of any joint, either way, N m. It caps the limits that the hand's model states, and is the limit of
    /// joints of which it states none; `null`: the model's own limits, and none may be missing.
    pub tau_max: Option<f64>,
    /// Largest normal force of a finger, N. Deviation: the paper bounds torques only.
    pub f_n_max: f64,
    /// Largest change of a joint torque command in a second, N m/s.
    pub tau_rate_max: f64,
    /// Which solver answers first.
    pub solver: SolverChoice,
    /// KKT residual up to which an answer is certified, relative to its largest contact force.
    pub tolerance: f64,
    /// Lower the assumed friction while fingers slip. Deviation: the paper relocates the slipping finger only.
    pub adapt_friction: bool,
    /// Slip speed of a holding finger above which the assumed friction is lowered, m/s.
    pub slip_speed: f64,
    /// Factor by which it is lowered.
    pub slip_factor: f64,
    /// Shortest time between two reductions, s.
    pub slip_hold: f64,
    /// Time constant with which the assumed friction recovers, s.
    pub friction_recovery: f64,
    /// The assumed friction is never lowered below this.
    pub friction_floor: f64,
}

impl Default for ForceConfig {
    fn default() -> Self {
        Self {
            alpha1: 0.01,
            alpha2: 0.01,
            alpha3: 1000.0,
            torque_length: 0.05,
            friction: 0.65,
            edges: 8,
            tau_max: None,
            f_n_max: 25.0,
            tau_rate_max: 100.0,
            solver: SolverChoice::ActiveSet,
            tolerance: 1e-8,
            adapt_friction: true,
            slip_speed: 0.012,
            slip_factor: 0.9,
            slip_hold: 0.03,
            friction_recovery: 20.0,
            friction_floor: 0.36,
        }
    }
}

/// What surrounds K at run time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobustConfig {
    /// Share of the artefact's anti-windup gain with which the wrench that the force optimiser could not deliver is fed back
    /// into K; zero: none. The full gain lets go of the object while a hard push lasts, none loses a slippery one.
    pub anti_windup: f64,
    /// Use the artefact's reference prefilter.
    pub prefilter: bool,
    /// Share of the joints' nominal damping and dry friction that is overcome along the desired motion; zero: none.
    /// Deviation: not in the paper.
    pub feedforward: f64,
    /// Desired joint speed from which dry friction is overcome in full, rad/s.
    pub friction_speed: f64,
    /// Rate at which a finger with more joints than the contact needs returns to its posture of the first grasp, 1/s: the
    /// stiffness over the joint's damping. Zero: not at all. Deviation: the paper's fingers have no spare joints.
    pub posture_rate: f64,
}

impl Default for RobustConfig {
    fn default() -> Self {
        Self { anti_windup: 0.1, prefilter: true, feedforward: 1.0, friction_speed: 0.05, posture_rate: 2.0 }
    }
}

/// Parameters of the joint torque PID.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TorqueConfig {
    /// Proportional gain.
    pub K_p: f64,
    /// Integral gain, 1/s.
    pub K_i: f64,
    /// Derivative gain, s.
    pub K_d: f64,
    /// Time constant of the derivative's filter, s.
    pub derivative_filter: f64,
}

impl Default for TorqueConfig {
    fn default() -> Self {
        Self { K_p: 2.0, K_i: 20.0, K_d: 0.0, derivative_filter: 0.002 }
    }
}

impl Config {
    /// The configuration written in `json`; absent fields keep their defaults, which [`crate::rules`] fits to the grasp.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let wrong = |e| Error::config("config", "the fields and types of Config", e);
        let mut config: Self = serde_json::from_str(json).map_err(wrong)?;
        config.stated = crate::rules::stated(&serde_json::from_str(json).map_err(wrong)?);
        config.validate()?;
        Ok(config)
    }

    /// The gaits' parameters, gaits off where contacts are changed by regrasping only.
    pub(crate) fn gaits(&self) -> GaitConfig {
        let regrasps = self.gait.change == Change::Regrasp;
        GaitConfig { enabled: self.gait.enabled && !regrasps, ..self.gait.clone() }
    }

    /// An error that names the first field out of its range.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = f64::MIN_POSITIVE;
        let (g, f, t) = (&self.gait, &self.force, &self.torque);
        let ranges = [
            ("rate_hz", self.rate_hz, 20.0, 20_000.0),
            ("mass", self.mass.unwrap_or(1.0), positive, 1e3),
            ("gait.w1", g.w1, 0.0, 1e6),
            ("gait.w2", g.w2, 0.0, 1e6),
            ("gait.w_z", g.w_z, 0.0, 1e6),
            ("gait.height_horizon", g.height_horizon, 0.0, 10.0),
            ("gait.q_thres", g.q_thres, 0.0, 0.999),
            ("gait.qd_max", g.qd_max, positive, 100.0),
            ("gait.sigma", g.sigma, positive, 100.0),
            ("gait.delta", g.delta, -1e3, 1e3),
            ("gait.K_v", g.K_v.unwrap_or(0.0), 0.0, 100.0),
            ("gait.velocity_bandwidth", g.velocity_bandwidth, 0.0, 1e3),
            ("gait.velocity_filter", g.velocity_filter, 0.0, 1.0),
            ("gait.K_f", g.K_f, 0.0, 100.0),
            ("gait.f_des", g.f_des, 0.0, 100.0),
            ("gait.approach_speed", g.approach_speed, 0.0, 1.0),
            ("gait.force_filter", g.force_filter, 0.0, 10.0),
            ("gait.threshold_margin", g.threshold_margin, -1e3, 1e3),
            ("gait.unload_time", g.unload_time, 0.0, 10.0),
            ("gait.load_time", g.load_time, 0.0, 10.0),
            ("gait.min_slide_time", g.min_slide_time, 0.0, 10.0),
            ("gait.max_slide_time", g.max_slide_time, g.min_slide_time, 100.0),
            ("gait.hysteresis", g.hysteresis, -1e3, f64::MAX),
            ("gait.slack_force", g.slack_force, 0.0, 1e3),
            ("gait.slack_torque", g.slack_torque, 0.0, 1e3),
            ("gait.abort_factor", g.abort_factor, 1.0, 1e6),
            ("gait.overdue_margin", g.overdue_margin, 0.0, 1e6),
            ("gait.overdue_time", g.overdue_time, 0.0, 1e6),
            ("gait.contact_force", g.contact_force, 0.0, 10.0),
            ("force.alpha1", f.alpha1, 1e-9, 1e9),
            ("force.alpha2", f.alpha2, 0.0, 1e9),
            ("force.alpha3", f.alpha3, 1e-9, 1e9),
            ("force.torque_length", f.torque_length, 1e-3, 1e3),
            ("force.friction", f.friction, 0.01, 10.0),
            ("force.tau_max", f.tau_max.unwrap_or(1.0), positive, 1e3),
            ("force.f_n_max", f.f_n_max, positive, 1e6),
            ("force.tau_rate_max", f.tau_rate_max, positive, 1e9),
            ("force.tolerance", f.tolerance, positive, 1.0),
            ("force.slip_speed", f.slip_speed, positive, 1e3),
            ("force.slip_factor", f.slip_factor, 0.01, 1.0),
            ("force.slip_hold", f.slip_hold, 0.0, 1e3),
            ("force.friction_recovery", f.friction_recovery, 1e-3, 1e9),
            ("force.friction_floor", f.friction_floor, 0.01, 10.0),
            ("robust.anti_windup", self.robust.anti_windup, 0.0, 1.0),
            ("robust.feedforward", self.robust.feedforward, 0.0, 10.0),
            ("robust.friction_speed", self.robust.friction_speed, positive, 1e3),
            ("robust.posture_rate", self.robust.posture_rate, 0.0, 1e3),
            ("torque.K_p", t.K_p, 0.0, 1e3),
            ("torque.K_i", t.K_i, 0.0, 1e5),
            ("torque.K_d", t.K_d, 0.0, 10.0),
            ("torque.derivative_filter", t.derivative_filter, positive, 10.0),
        ];
        for (field, value, low, high) in ranges {
            if !(value >= low && value <= high) {
                return Err(Error::config(field, format!("a number from {low:e} to {high:e}"), value));
            }
        }
        if !(3..=12).contains(&f.edges) {
            return Err(Error::config("force.edges", "3 to 12 edges", f.edges));
        }
        self.regrasp.validate()?;
        self.safety.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_is_valid_and_survives_json() {
        let config = Config::default();
        config.validate().unwrap();
        let json = serde_json::to_string(&config).unwrap();
        // All of it is stated now, and stays.
        let read = Config::from_json(&json).unwrap();
        assert_eq!(Config { stated: 0, ..read }, config);
    }

    #[test]
    fn bad_fields_are_named() {
        for (json, field) in [
            (r#"{"gait": {"w3": 1}}"#, "w3"),
            (r#"{"gait": {"sigma": -1}}"#, "gait.sigma"),
            (r#"{"force": {"edges": 2}}"#, "force.edges"),
            (r#"{"rate_hz": 0}"#, "rate_hz"),
        ] {
            let message = Config::from_json(json).unwrap_err().to_string();
            assert!(message.contains(field), "{message}");
        }
    }
}
