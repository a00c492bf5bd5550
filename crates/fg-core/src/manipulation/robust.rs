//! The robust controller: K, the feedback linearisation, the reference prefilter and the anti-windup.

use crate::config::RobustConfig;
use crate::error::Error;
use crate::manipulation::lti::{StateSpace, StateSpaceSpec};
use crate::signals::Reference;
use crate::spatial::{integrate, pose_error};
use nalgebra::{Isometry3, Vector3, Vector6};
use serde::Deserialize;

const FORMAT: &str = "fingergait-controller/1";

/// A controller artefact as it is written (format in ARCHITECTURE.md).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Artefact {
    format: String,
    kind: String,
    description: String,
    sample_time: f64,
    delay: f64,
    nominal: Nominal,
    K: K,
    prefilter: Option<f64>,
    #[serde(default)]
    #[allow(dead_code, reason = "for people and reports, not for the controller")]
    provenance: serde_json::Value,
}

/// The nominal model of the feedback linearisation.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nominal {
    /// Mass m0, kg.
    pub mass: f64,
    /// Principal moments of inertia I0, kg m^2.
    pub inertia: [f64; 3],
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
enum K {
    Axes(Vec<StateSpaceSpec>),
    Full(StateSpaceSpec),
}

/// A controller artefact, read and checked: K at rest, with its nominal model.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    /// "mu-synthesis" or "hand-tuned".
    pub kind: String,
    /// One line for people.
    pub description: String,
    /// Sample time of K, s.
    pub sample_time: f64,
    /// Dead time that the design allowed for, s.
    pub delay: f64,
    /// The nominal model that K was designed with.
    pub nominal: Nominal,
    /// Bandwidth of the reference prefilter, rad/s.
    pub prefilter: Option<f64>,
    systems: Vec<StateSpace>,
}

impl Controller {
    /// The controller in the artefact `json`.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let artefact: Artefact =
            serde_json::from_str(json).map_err(|e| Error::artifact("JSON", "a controller artefact", e))?;
        if artefact.format != FORMAT {
            return Err(Error::artifact("format", FORMAT, artefact.format));
        }
        if !matches!(artefact.kind.as_str(), "mu-synthesis" | "hand-tuned") {
            return Err(Error::artifact("kind", "mu-synthesis or hand-tuned", artefact.kind));
        }
        let nominal = artefact.nominal;
        let [I1, I2, I3] = nominal.inertia;
        for (field, value) in [
            ("sample_time", artefact.sample_time),
            ("nominal.mass", nominal.mass),
            ("nominal.inertia[0]", I1),
            ("nominal.inertia[1]", I2),
            ("nominal.inertia[2]", I3),
            ("prefilter", artefact.prefilter.unwrap_or(1.0)),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::artifact(field, "a finite number > 0", value));
            }
        }
        if !(artefact.delay.is_finite() && artefact.delay >= 0.0) {
            return Err(Error::artifact("delay", "a finite number >= 0", artefact.delay));
        }
        let systems = match &artefact.K {
            K::Full(spec) => vec![StateSpace::new("K.full", spec, 6, 6)?],
            K::Axes(specs) if specs.len() == 6 => specs
                .iter()
                .enumerate()
                .map(|(axis, spec)| StateSpace::new(&format!("K.axes[{axis}]"), spec, 1, 1))
                .collect::<Result<_, _>>()?,
            K::Axes(specs) => {
                return Err(Error::artifact("K.axes", "6 systems: x y z rx ry rz", specs.len()))
            }
        };
        Ok(Self {
            kind: artefact.kind,
            description: artefact.description,
            sample_time: artefact.sample_time,
            delay: artefact.delay,
            nominal,
            prefilter: artefact.prefilter,
            systems,
        })
    }

    /// Returns K to rest.
    pub fn reset(&mut self) {
        self.systems.iter_mut().for_each(StateSpace::reset);
    }

    /// The output u for the pose error e: accelerations, m/s^2 and rad/s^2.
    pub fn output(&self, e: &Vector6<f64>) -> Vector6<f64> {
        let mut u = Vector6::zeros();
        let width = 6 / self.systems.len();
        for (axis, system) in self.systems.iter().enumerate() {
            let at = axis * width..(axis + 1) * width;
            system.output(&e.as_slice()[at.clone()], &mut u.as_mut_slice()[at]);
        }
        u
    }

    /// Advances K by one sample; `deficit` is u_realised - u.
    pub fn advance(&mut self, e: &Vector6<f64>, deficit: &Vector6<f64>) {
        let width = 6 / self.systems.len();
        for (axis, system) in self.systems.iter_mut().enumerate() {
            let at = axis * width..(axis + 1) * width;
            system.advance(&e.as_slice()[at.clone()], &deficit.as_slice()[at]);
        }
    }
}

/// K in the loop: pose error in, desired wrench F_des out.
#[derive(Debug, Clone)]
pub struct RobustController {
    K: Controller,
    config: RobustConfig,
    dt: f64,
    /// Force that holds the object's nominal weight, N: what the linearisation compensates.
    lift: Vector3<f64>,
    /// What else K was found to ask for in the steady state, N and N m.
    learnt: Vector6<f64>,
    e: Vector6<f64>,
    u: Vector6<f64>,
    V_WD: Vector6<f64>,
    /// The filtered reference: pose, twist and the twist of the unfiltered reference one step ago.
    filtered: Option<(Isometry3<f64>, Vector6<f64>, Vector6<f64>)>,
}

impl RobustController {
    /// `K` at the control period `dt` under the acceleration of gravity `g_W` in W, m/s^2; `mass` is the object's nominal mass
    /// where it differs from the artefact's.
    pub fn new(
        K: Controller,
        config: &RobustConfig,
        mass: Option<f64>,
        g_W: &Vector3<f64>,
        dt: f64,
    ) -> Result<Self, Error> {
        if (K.sample_time - dt).abs() > 1e-9 {
            let expected = format!("{dt} s, the control period (synthesise for this rate)");
            return Err(Error::artifact("sample_time", expected, K.sample_time));
        }
        let lift = -g_W * mass.unwrap_or(K.nominal.mass);
        let zero = Vector6::zeros();
        Ok(Self {
            K,
            config: config.clone(),
            dt,
            lift,
            learnt: zero,
            e: zero,
            u: zero,
            V_WD: zero,
            filtered: None,
        })
    }

    /// Returns to rest.
    pub fn reset(&mut self) {
        self.K.reset();
        self.filtered = None;
    }

    /// Nominal weight of the object, N.
    pub fn weight(&self) -> f64 {
        self.lift.norm()
    }

    /// Takes the wrench `F` at which the object has been at rest for what holds it from here on: K, which starts at rest
    /// with each grasp, need not find the weight and its place anew.
    pub fn learn(&mut self, F: &Vector6<f64>) {
        self.learnt = *F;
        for (learnt, lift) in self.learnt.iter_mut().zip(&self.lift) {
            *learnt -= lift;
        }
    }

    /// Forgets what [`RobustController::learn`] took.
    pub fn forget(&mut self) {
        self.learnt = Vector6::zeros();
    }

    /// Pose error of the last step against the filtered reference, m and rad.
    pub fn error(&self) -> &Vector6<f64> {
        &self.e
    }

    /// Desired twist of the object behind the reference filter [m/s; rad/s] in W.
    pub fn twist(&self) -> &Vector6<f64> {
        &self.V_WD
    }

    /// Desired wrench [N; N m] on the object at Oo in W: alpha(x) + beta(x) u with u = K e.
    ///
    /// Deviation: the torque is I0 u_r in W, not in the object's principal axes. The fingers' damping and inertia, which
    /// stay with the hand and not with the object, make most of the rotational plant; and K's states, which hold the
    /// weight of a centre of mass that is off, need not turn with the object.
    pub fn wrench(&mut self, reference: &Reference, X_WO: &Isometry3<f64>) -> Vector6<f64> {
        let X_WD = self.filter(reference, X_WO);
        self.e = pose_error(&X_WD, X_WO);
        self.u = self.K.output(&self.e);
        let mut F = self.u.component_mul(&self.beta()) + self.learnt;
        for (F, lift) in F.iter_mut().zip(&self.lift) {
            *F += lift;
        }
        F
    }

    /// Advances K, told by how much (`psi` = F_des - G f) the force optimiser fell short.
    pub fn advance(&mut self, psi: &Vector6<f64>) {
        let deficit = -psi.component_div(&self.beta()) * self.config.anti_windup;
        self.K.advance(&self.e, &deficit);
    }

    fn beta(&self) -> Vector6<f64> {
        let Nominal { mass, inertia: [I1, I2, I3] } = self.K.nominal;
        Vector6::new(mass, mass, mass, I1, I2, I3)
    }

    /// The reference behind a critically damped second-order filter: steps are softened, and a motion whose twist is
    /// given passes without lag.
    fn filter(&mut self, reference: &Reference, X_WO: &Isometry3<f64>) -> Isometry3<f64> {
        self.V_WD = reference.V_WD;
        let (Some(w), true) = (self.K.prefilter, self.config.prefilter) else { return reference.X_WD };
        let (X, V, V_D) = self.filtered.unwrap_or((*X_WO, Vector6::zeros(), reference.V_WD));
        let a_D = (reference.V_WD - V_D) / self.dt;
        let a = a_D + pose_error(&reference.X_WD, &X) * (w * w) + (reference.V_WD - V) * (2.0 * w);
        let V = V + a * self.dt;
        let X = integrate(&X, &V, self.dt);
        self.V_WD = V;
        self.filtered = Some((X, V, reference.V_WD));
        X
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn artefact(D: f64) -> String {
        let axis = format!(r#"{{"A": [], "B": [], "C": [[]], "D": [[{D}]]}}"#);
        let axes = vec![axis; 6].join(",");
        format!(
            r#"{{"format": "{FORMAT}", "kind": "hand-tuned", "description": "test", "sample_time": 0.002, "delay": 0,
                "nominal": {{"mass": 0.5, "inertia": [0.1, 0.2, 0.3]}}, "K": {{"axes": [{axes}]}}, "prefilter": null}}"#
        )
    }

    #[test]
    fn wrench_holds_the_weight_and_pulls_towards_the_reference() {
        let K = Controller::from_json(&artefact(10.0)).unwrap();
        let g_W = Vector3::new(1.0, -2.0, -9.81);
        let mut robust = RobustController::new(K, &RobustConfig::default(), None, &g_W, 0.002).unwrap();
        let X_WD = Isometry3::new([0.1, 0.0, 0.0].into(), [0.0, 0.0, 0.2].into());
        let reference = Reference { X_WD, V_WD: Vector6::zeros() };
        let F = robust.wrench(&reference, &Isometry3::identity());
        let expected =
            Vector6::new(0.5 * (10.0 * 0.1 - 1.0), 0.5 * 2.0, 0.5 * 9.81, 0.0, 0.0, 0.3 * 10.0 * 0.2);
        assert!((F - expected).norm() < 1e-12);
    }

    #[test]
    fn bad_artefacts_name_the_field() {
        let good = artefact(1.0);
        for (from, to, field) in [
            ("fingergait-controller/1", "other/2", "format"),
            ("hand-tuned", "guess", "kind"),
            (r#""mass": 0.5"#, r#""mass": -1"#, "nominal.mass"),
            (r#""D": [[1]]"#, r#""D": [[1, 2]]"#, "K.axes[0].D"),
            (r#""delay": 0"#, r#""dealy": 0"#, "dealy"),
        ] {
            let message = Controller::from_json(&good.replace(from, to)).unwrap_err().to_string();
            assert!(message.contains(field), "{message}");
        }
    }
}
