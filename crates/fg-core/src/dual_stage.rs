//! The dual-stage planner: one control step from sensors to torques. The only file that knows the order.

use crate::config::Config;
use crate::diagnostics::Diagnostics;
use crate::error::Error;
use crate::friction::FrictionPyramid;
use crate::gait::planner::{GaitPlanner, GaitRate};
use crate::gait::quality::QualityModel;
use crate::gait::supervisor::{Phase, Supervisor};
use crate::gait::velocity_force::VelocityForceController;
use crate::grasp::{Grasp, Scene};
use crate::hand::{HandModel, HandState};
use crate::manipulation::feedforward::damping_torque;
use crate::manipulation::force::{ForceOptimizer, ForceProblem, ForceSettings};
use crate::manipulation::robust::{Controller, RobustController};
use crate::manipulation::slip::{AdaptiveFriction, SlipDetector};
use crate::signals::{Command, Measurement, Reference};
use crate::spatial::{angular, is_finite, linear};
use nalgebra::{DMatrix, DVector, Vector6};

/// The whole controller. All memory is allocated in [`DualStagePlanner::new`].
pub struct DualStagePlanner {
    hand: HandModel,
    config: Config,
    dt: f64,
    state: HandState,
    grasp: Grasp,
    quality: QualityModel,
    supervisor: Supervisor,
    robust: RobustController,
    forces: ForceOptimizer,
    /// Answers "could the others hold without finger k?" without touching the warm start of `forces`.
    probe: ForceOptimizer,
    slip: SlipDetector,
    friction: AdaptiveFriction,
    pyramid: FrictionPyramid,
    planner: GaitPlanner,
    velocity_force: VelocityForceController,
    /// Contact forces of the last step in their contact frames, N.
    f_prev: DVector<f64>,
    /// Grasp map with its torque rows weighted, for the force optimiser.
    G: DMatrix<f64>,
    f_limit: Vec<f64>,
    /// Psi behind a low pass: a single noisy sample breaks off no gait.
    psi_filtered: Vector6<f64>,
    tau_min: DVector<f64>,
    tau_max: DVector<f64>,
    /// Torques that the fingers need for themselves: their weight, and their damping along the desired motion, N m.
    tau_own: DVector<f64>,
    tau_free: Vec<f64>,
    command: Command,
    diagnostics: Diagnostics,
}

/// Time constant of the filter on Psi before it is compared with what a gait allows, s.
const PSI_FILTER: f64 = 0.03;

/// The present scene; a macro, so that only the fields it reads are borrowed.
macro_rules! scene {
    ($planner:ident, $measurement:ident) => {
        Scene {
            grasp: &$planner.grasp,
            state: &$planner.state,
            X_WO: &$measurement.X_WO,
            V_WD: $planner.robust.twist(),
            q: $measurement.q.as_slice(),
        }
    };
}

impl DualStagePlanner {
    /// The planner for `hand` with the robust controller `K`.
    pub fn new(hand: HandModel, K: Controller, config: Config) -> Result<Self, Error> {
        config.validate()?;
        let dt = 1.0 / config.rate_hz;
        let (n, n_joints) = (hand.n_fingers(), hand.n_joints());
        let n_q = n * n_joints;
        let pyramid = FrictionPyramid::inscribed(config.force.friction, config.force.edges)?;
        let settings = ForceSettings {
            alpha: [config.force.alpha1, config.force.alpha2, config.force.alpha3],
            solver: config.force.solver,
            ..ForceSettings::default()
        };
        let pyramids = vec![pyramid.clone(); n];
        let mut diagnostics = Diagnostics::new(n, n_joints);
        diagnostics.friction = config.force.friction;
        Ok(Self {
            dt,
            state: HandState::new(&hand),
            grasp: Grasp::new(&hand, config.gait.contact_force),
            quality: QualityModel::new(&hand, &config.gait),
            supervisor: Supervisor::new(&hand, &config.gait, dt),
            robust: RobustController::new(K, &config.robust, config.mass, dt)?,
            forces: ForceOptimizer::new(&pyramids, n_q, settings.clone())?,
            probe: ForceOptimizer::new(&pyramids, n_q, settings)?,
            slip: SlipDetector::new(&hand, dt),
            friction: AdaptiveFriction::new(&config.force, dt),
            pyramid,
            planner: GaitPlanner::new(&hand, &config.gait, dt),
            velocity_force: VelocityForceController::new(&config.gait, dt),
            f_prev: DVector::zeros(3 * n),
            G: DMatrix::zeros(6, 3 * n),
            f_limit: vec![0.0; n],
            psi_filtered: Vector6::zeros(),
            tau_min: DVector::zeros(n_q),
            tau_max: DVector::zeros(n_q),
            tau_own: DVector::zeros(n_q),
            tau_free: vec![0.0; n_joints],
            command: Command { tau: DVector::zeros(n_q) },
            diagnostics,
            hand,
            config,
        })
    }

    /// The hand that is controlled.
    pub fn hand(&self) -> &HandModel {
        &self.hand
    }

    /// The configuration in use.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the last step decided.
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.diagnostics
    }

    /// Returns to the state after construction.
    pub fn reset(&mut self) {
        self.grasp = Grasp::new(&self.hand, self.config.gait.contact_force);
        self.quality.reset();
        self.supervisor.reset();
        self.robust.reset();
        self.slip.reset();
        self.friction.reset();
        self.planner.reset();
        self.velocity_force.reset(0.0);
        self.f_prev.fill(0.0);
        self.psi_filtered.fill(0.0);
        self.command.tau.fill(0.0);
    }

    /// The torques to track until the next step, every 1 / `rate_hz` seconds.
    ///
    /// The robust controller and the force optimiser run at every step in every mode, so that K's state is continuous
    /// when fingers come and go.
    pub fn step(&mut self, measurement: &Measurement, reference: &Reference) -> Result<&Command, Error> {
        self.check(measurement, reference)?;
        self.state.update(&self.hand, measurement.q.as_slice());
        self.grasp.update(&self.hand, &self.state, measurement);
        self.supervise(measurement);
        self.feel_slip(measurement)?;
        let F_des = self.robust.wrench(reference, &measurement.X_WO);
        self.bound_torques(measurement);
        self.weigh_wrench();
        self.choose_finger(measurement, &F_des);
        self.optimise_forces(&F_des)?;
        self.robust.advance(&self.diagnostics.psi);
        self.map_torques();
        self.drive_free_finger(measurement);
        self.limit_torques();
        self.diagnose(&F_des);
        Ok(&self.command)
    }

    fn check(&self, measurement: &Measurement, reference: &Reference) -> Result<(), Error> {
        let n_q = self.command.tau.len();
        let lengths = [
            ("measurement.q", n_q, measurement.q.len()),
            ("measurement.tau", n_q, measurement.tau.len()),
            ("measurement.tactile", self.hand.n_fingers(), measurement.tactile.len()),
        ];
        for (field, expected, found) in lengths {
            if expected != found {
                return Err(Error::shape(field, expected, found));
            }
        }
        let tactile = |c: &crate::signals::Tactile| c.f_n.is_finite() && c.p_FC.iter().all(|x| x.is_finite());
        let finite = [
            ("measurement.q", measurement.q.iter().all(|x| x.is_finite())),
            ("measurement.pose", is_finite(&measurement.X_WO)),
            ("measurement.tactile", measurement.tactile.iter().all(tactile)),
            ("reference.pose", is_finite(&reference.X_WD)),
            ("reference.twist", reference.V_WD.iter().all(|x| x.is_finite())),
        ];
        match finite.iter().find(|(_, finite)| !finite) {
            Some((field, _)) => Err(Error::config(*field, "finite numbers", "NaN or infinity")),
            None => Ok(()),
        }
    }

    /// Quality, first grasp, and the gait's phases.
    fn supervise(&mut self, measurement: &Measurement) {
        let scene = scene!(self, measurement);
        let first = self.supervisor.observe(&self.grasp);
        if first {
            self.quality.set_first_grasp(&scene);
        }
        let quality = self.quality.quality(&scene);
        if first {
            self.supervisor.set_threshold(quality.Q);
        }
        self.diagnostics.quality = quality;
        for (j, h) in self.diagnostics.heights.iter_mut().enumerate() {
            *h = self.quality.height_error(&scene, j);
        }
        let before = self.supervisor.phase();
        let overload = self.overload(&self.psi_filtered);
        self.supervisor.advance(&self.grasp, quality.Q, self.diagnostics.rate.Q_dot, overload);
        if let (true, Some(k)) = (self.supervisor.phase() != before, self.supervisor.sliding_finger()) {
            self.planner.reset();
            self.velocity_force.reset(self.grasp.contact(k).f_n);
        }
    }

    /// Adapts the assumed friction to the slip of the fingers that hold the object.
    fn feel_slip(&mut self, measurement: &Measurement) -> Result<(), Error> {
        let free = self.supervisor.free_finger();
        self.slip.update(&self.grasp, &self.state, &measurement.X_WO, |j| Some(j) != free);
        let fastest = self.slip.fastest(self.config.force.slip_speed);
        if self.friction.update(fastest) {
            self.pyramid.set_friction(self.friction.mu())?;
            for j in 0..self.hand.n_fingers() {
                self.forces.set_pyramid(j, &self.pyramid)?;
                self.probe.set_pyramid(j, &self.pyramid)?;
            }
        }
        Ok(())
    }

    /// What the fingers fail to deliver, as a multiple of what a gait allows.
    fn overload(&self, psi: &Vector6<f64>) -> f64 {
        let gait = &self.config.gait;
        (linear(psi).norm() / gait.slack_force).max(angular(psi).norm() / gait.slack_torque)
    }

    /// Weights of force and torque in Psi.
    fn wrench_scale(&self) -> Vector6<f64> {
        let w = 1.0 / self.config.force.torque_length;
        Vector6::new(1.0, 1.0, 1.0, w, w, w)
    }

    /// Torques left for the contact forces, once the fingers' own weight and motion have had theirs.
    fn bound_torques(&mut self, measurement: &Measurement) {
        let n_joints = self.hand.n_joints();
        self.state.gravity_torque(&self.hand, self.tau_own.as_mut_slice());
        if self.config.robust.feedforward {
            let scene = scene!(self, measurement);
            // Eq. (5) has its own velocity term for the finger that slides.
            let sliding = self.supervisor.sliding_finger();
            for k in (0..self.hand.n_fingers()).filter(|k| Some(*k) != sliding) {
                damping_torque(&self.hand, k, &scene, &mut self.tau_free);
                for (i, tau) in self.tau_free.iter().enumerate() {
                    self.tau_own[k * n_joints + i] += tau;
                }
            }
        }
        for (i, tau_own) in self.tau_own.iter().enumerate() {
            self.tau_min[i] = -self.config.force.tau_max - tau_own;
            self.tau_max[i] = self.config.force.tau_max - tau_own;
        }
    }

    /// Grasp map with its torque rows weighted, for the force optimiser.
    fn weigh_wrench(&mut self) {
        let scale = self.wrench_scale();
        for (mut weighted, column) in self.G.column_iter_mut().zip(self.grasp.G.column_iter()) {
            weighted.copy_from(&column.component_mul(&scale));
        }
    }

    /// Frees a finger where the event asks for it and the force optimiser finds that the others can hold.
    fn choose_finger(&mut self, measurement: &Measurement, F_des: &Vector6<f64>) {
        let scene = scene!(self, measurement);
        let (delta, quality, planner) = (self.config.gait.delta, &self.quality, &mut self.planner);
        let promises = |k| planner.potential(k, quality, &scene) > delta;
        let now = self.diagnostics.quality;
        let Some(k) = self.supervisor.candidate(&now, quality, &scene, promises) else { return };
        self.f_limit.fill(self.config.force.f_n_max);
        self.f_limit[k] = 0.0;
        let scale = self.wrench_scale();
        let problem = ForceProblem {
            G: &self.G,
            J: &self.grasp.J,
            F_des: &F_des.component_mul(&scale),
            f_prev: &self.f_prev,
            tau_min: &self.tau_min,
            tau_max: &self.tau_max,
            f_normal_max: &self.f_limit,
        };
        let psi = self.probe.solve(&problem).map(|solution| solution.psi.component_div(&scale));
        if psi.is_ok_and(|psi| self.overload(&psi) <= 1.0) {
            self.supervisor.start(k, &self.grasp);
        } else {
            self.supervisor.refuse(k);
        }
    }

    /// Eq. (8), with the free finger's force ramped or taken out.
    fn optimise_forces(&mut self, F_des: &Vector6<f64>) -> Result<(), Error> {
        for (j, limit) in self.f_limit.iter_mut().enumerate() {
            *limit = self.supervisor.force_limit(j, self.config.force.f_n_max);
        }
        let scale = self.wrench_scale();
        let solution = self.forces.solve(&ForceProblem {
            G: &self.G,
            J: &self.grasp.J,
            F_des: &F_des.component_mul(&scale),
            f_prev: &self.f_prev,
            tau_min: &self.tau_min,
            tau_max: &self.tau_max,
            f_normal_max: &self.f_limit,
        })?;
        self.f_prev.copy_from(&solution.f);
        self.command.tau.copy_from(&solution.tau);
        let d = &mut self.diagnostics;
        d.psi = solution.psi.component_div(&scale);
        self.psi_filtered += (d.psi - self.psi_filtered) * (self.dt / PSI_FILTER).min(1.0);
        d.status = solution.status;
        d.solver = solution.solver;
        d.kkt = solution.kkt;
        d.iterations = solution.iterations;
        Ok(())
    }

    /// tau = J_h^T f, and what the fingers need for themselves.
    fn map_torques(&mut self) {
        self.command.tau += &self.tau_own;
    }

    /// Eqs. (4) and (5) for the finger that slides or presses.
    fn drive_free_finger(&mut self, measurement: &Measurement) {
        self.diagnostics.rate = GaitRate { Q_dot: 0.0, feasible: true };
        let Some(k) = self.supervisor.sliding_finger() else { return };
        let scene = scene!(self, measurement);
        if self.supervisor.phase() == Phase::Slide {
            self.diagnostics.rate = self.planner.update(k, &self.quality, &scene);
        } else {
            self.planner.press(k, &scene);
        }
        let (qd_des, f_des) = (self.planner.qd_des(), self.config.gait.f_des);
        self.velocity_force.update(k, &scene, qd_des, f_des, &mut self.tau_free);
        let n_joints = self.hand.n_joints();
        for (i, tau) in self.tau_free.iter().enumerate() {
            let at = k * n_joints + i;
            self.command.tau[at] = tau + self.tau_own[at];
        }
    }

    /// Every command is finite, inside the torque limits and the torque rate limit.
    fn limit_torques(&mut self) {
        let limit = self.config.force.tau_max;
        let change = self.config.force.tau_rate_max * self.dt;
        for (tau, previous) in self.command.tau.iter_mut().zip(self.diagnostics.tau.iter()) {
            let wanted = if tau.is_finite() { *tau } else { *previous };
            *tau = wanted.clamp(previous - change, previous + change).clamp(-limit, limit);
        }
    }

    fn diagnose(&mut self, F_des: &Vector6<f64>) {
        let d = &mut self.diagnostics;
        d.phase = self.supervisor.phase();
        d.free_finger = self.supervisor.free_finger();
        d.gaits = self.supervisor.gaits();
        d.last_end = self.supervisor.last_end();
        d.threshold = self.supervisor.threshold().unwrap_or(f64::NAN);
        d.e = *self.robust.error();
        d.F_des = *F_des;
        d.f.copy_from(&self.f_prev);
        for (f_n, contact) in d.f_n.iter_mut().zip(self.grasp.contacts()) {
            *f_n = contact.f_n;
        }
        for j in 0..self.hand.n_fingers() {
            d.slip[j] = self.slip.speed(j);
        }
        d.friction = self.friction.mu();
        d.slips = self.friction.slips();
        d.qd_des.copy_from_slice(self.planner.qd_des());
        d.tau.copy_from(&self.command.tau);
    }
}
