//! The dual-stage planner: one control step from sensors to torques. The only file that knows the order.

mod fallback;
mod regrasping;
mod report;

use crate::config::Config;
use crate::diagnostics::Diagnostics;
use crate::error::Error;
use crate::friction::FrictionPyramid;
use crate::gait::planner::{GaitPlanner, GaitRate};
use crate::gait::quality::QualityModel;
use crate::gait::supervisor::{Phase, Supervisor};
use crate::gait::velocity_force::VelocityForceController;
use crate::grasp::{Grasp, Scene};
use crate::hand::{HandModel, HandState, TorqueLimits};
use crate::manipulation::feedforward::drag_torque;
use crate::manipulation::force::{ForceOptimizer, ForceProblem, ForceSettings, ForceStatus, SolverUsed};
use crate::manipulation::posture::Posture;
use crate::manipulation::robust::{Controller, RobustController};
use crate::manipulation::slip::{AdaptiveFriction, SlipDetector};
use crate::regrasp::Regrasp;
use crate::rules::{self, Scale};
use crate::safety::guard::{Course, Guard, Plan};
use crate::safety::limiter::TorqueLimiter;
use crate::safety::steady::SteadyWrench;
use crate::signals::{Command, Measurement, Reference};
use crate::spatial::{angular, linear};
use nalgebra::{DMatrix, DVector, Vector6};

/// The whole controller. All memory is allocated in [`DualStagePlanner::new`].
pub struct DualStagePlanner {
    hand: HandModel,
    /// As it was given, and as it fits the grasp: [`rules`].
    given: Config,
    config: Config,
    dt: f64,
    guard: Guard,
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
    regrasp: Regrasp,
    posture: Posture,
    /// Contact forces of the last step in their contact frames, N.
    f_prev: DVector<f64>,
    /// Grasp map with its torque rows weighted, for the force optimiser.
    G: DMatrix<f64>,
    f_limit: Vec<f64>,
    /// Psi behind a low pass: a single noisy sample breaks off no gait.
    psi_filtered: Vector6<f64>,
    tau_min: DVector<f64>,
    tau_max: DVector<f64>,
    /// Torques that the fingers need for themselves: their weight, their springs, and their damping along the desired
    /// motion, N m.
    tau_own: DVector<f64>,
    tau_free: Vec<f64>,
    steady: SteadyWrench,
    limiter: TorqueLimiter,
    /// Some torque of the last step was at its limit.
    at_limit: bool,
    /// Share of the torques that is left after one step in which nothing is held.
    fade: f64,
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

/// Eq. (8) for the weighted wrench `F`; a macro for the same reason.
macro_rules! force_problem {
    ($planner:ident, $F:ident) => {
        ForceProblem {
            G: &$planner.G,
            J: &$planner.grasp.J,
            F_des: &$F,
            f_prev: &$planner.f_prev,
            tau_min: &$planner.tau_min,
            tau_max: &$planner.tau_max,
            f_normal_max: &$planner.f_limit,
        }
    };
}

impl DualStagePlanner {
    /// The planner for `hand` with the robust controller `K`.
    pub fn new(hand: HandModel, K: Controller, mut config: Config) -> Result<Self, Error> {
        config.validate()?;
        // A force that may be commanded is not full scale.
        config.safety.tactile_max = config.safety.tactile_max.max(1.2 * config.force.f_n_max);
        let dt = 1.0 / config.rate_hz;
        let (n, n_q) = (hand.n_fingers(), hand.n_q());
        let limits = TorqueLimits::of(&hand, config.force.tau_max)?;
        let pyramid = FrictionPyramid::inscribed(config.force.friction, config.force.edges)?;
        let settings = ForceSettings {
            alpha: [config.force.alpha1, config.force.alpha2, config.force.alpha3],
            solver: config.force.solver,
            tolerance: config.force.tolerance,
            raw_tolerance: 100.0 * config.force.tolerance,
            ..ForceSettings::default()
        };
        let pyramids = vec![pyramid.clone(); n];
        let mut diagnostics = Diagnostics::new(&hand.counts());
        diagnostics.friction = config.force.friction;
        Ok(Self {
            dt,
            guard: Guard::new(&hand, &config.safety, config.gait.contact_force, dt),
            state: HandState::new(&hand),
            grasp: Grasp::new(&hand, config.gait.contact_force),
            quality: QualityModel::new(&hand, &config.gait),
            supervisor: Supervisor::new(&hand, &config.gaits(), dt),
            robust: RobustController::new(K, &config.robust, config.mass, &hand.gravity(), dt)?,
            forces: ForceOptimizer::new(&pyramids, n_q, settings.clone())?,
            probe: ForceOptimizer::new(&pyramids, n_q, settings)?,
            slip: SlipDetector::new(&hand, dt),
            friction: AdaptiveFriction::new(&config.force, dt),
            pyramid,
            planner: GaitPlanner::new(&hand, &config.gait, dt),
            regrasp: Regrasp::new(&hand, &config.regrasp, config.gait.change, dt),
            velocity_force: VelocityForceController::new(&config, dt),
            posture: Posture::new(&hand, &config.robust),
            f_prev: DVector::zeros(3 * n),
            G: DMatrix::zeros(6, 3 * n),
            f_limit: vec![0.0; n],
            psi_filtered: Vector6::zeros(),
            tau_min: DVector::zeros(n_q),
            tau_max: DVector::zeros(n_q),
            tau_own: DVector::zeros(n_q),
            tau_free: vec![0.0; hand.most_joints()],
            steady: SteadyWrench::new(dt),
            limiter: TorqueLimiter::new(limits, config.force.tau_rate_max, dt),
            at_limit: false,
            fade: (-dt / config.safety.stop_time).exp(),
            command: Command { tau: DVector::zeros(n_q) },
            diagnostics,
            hand,
            given: config.clone(),
            config,
        })
    }

    /// The hand that is controlled.
    pub fn hand(&self) -> &HandModel {
        &self.hand
    }

    /// The configuration in use, fitted to the grasp since the first.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the last step decided.
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.diagnostics
    }

    /// The torques to track until the next step, every 1 / `rate_hz` seconds.
    ///
    /// The robust controller and the force optimiser run at every step in every mode, so that K's state is continuous
    /// when fingers come and go. An error is a caller's mistake, an array of the wrong length, and changes nothing;
    /// whatever else is wrong with the measurement, the command is finite and inside its limits, and
    /// [`Diagnostics::faults`] says what was wrong.
    pub fn step(&mut self, measurement: &Measurement, reference: &Reference) -> Result<&Command, Error> {
        self.guard.check(measurement)?;
        let phase = self.supervisor.phase();
        let plan = Plan {
            f: self.f_prev.as_slice(),
            tau: self.command.tau.as_slice(),
            free: self.supervisor.free_finger(),
            qd_des: (phase == Phase::Slide).then(|| self.planner.qd_des()),
            pressing: phase == Phase::Press,
            open: (!self.controls()).then(|| self.regrasp.reach().qd_des()),
            grasped: self.supervisor.threshold().is_some(),
            own: self.tau_own.as_slice(),
            J: &self.grasp.J,
        };
        match self.guard.admit(&self.hand, &mut self.state, measurement, reference, &plan) {
            Course::Run => {
                let (measurement, reference) = self.guard.take();
                self.run(&measurement, &reference);
                self.guard.put_back(measurement);
            }
            Course::Stop => {
                self.regrasp.lose();
                self.stop();
            }
            Course::Repeat => {}
        }
        self.diagnostics.faults = self.guard.faults();
        self.diagnostics.safe_mode = self.guard.mode();
        Ok(&self.command)
    }

    /// The step on a measurement that can be used.
    fn run(&mut self, measurement: &Measurement, reference: &Reference) {
        self.grasp.update(&self.hand, &self.state, measurement);
        let reference = &self.regrasp(measurement, reference);
        if !self.allows_gaits() {
            self.supervisor.abort();
        }
        self.supervise(measurement);
        self.feel_slip();
        let F_des = self.wrench(measurement, reference);
        self.bound_torques(measurement);
        self.weigh_wrench();
        self.judge_spares();
        if self.allows_gaits() {
            self.choose_finger(measurement, &F_des);
        }
        self.optimise_forces(&F_des);
        if !self.guard.blind() && self.controls() {
            self.robust.advance(&self.diagnostics.psi);
        }
        self.command.tau += &self.tau_own;
        self.drive_free_finger(measurement);
        self.drive_arms();
        self.damp_fingers();
        self.test_motors();
        self.at_limit = self.limiter.apply(&mut self.command.tau);
        self.diagnose(&F_des);
        self.report();
    }

    /// Quality, first grasp, and the gait's phases.
    fn supervise(&mut self, measurement: &Measurement) {
        let scene = scene!(self, measurement);
        let first = self.supervisor.observe(&self.grasp);
        if first {
            self.quality.set_first_grasp(&scene);
            self.posture.set_home(scene.q);
        }
        let quality = self.quality.quality(&scene);
        if first {
            self.supervisor.set_threshold(quality.Q);
        }
        self.supervisor.await_gait(quality.Q);
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
        if first {
            let scale = Scale::of(&self.grasp, self.robust.weight());
            self.fit(rules::fitted(&self.given, &scale));
        }
    }

    /// Takes the configuration that fits the grasp.
    pub(super) fn fit(&mut self, config: Config) {
        self.guard.fit(&config.safety);
        self.planner.fit(&config.gait);
        self.config = config;
    }

    /// Adapts the assumed friction to the slip of the fingers that hold the object.
    fn feel_slip(&mut self) {
        let free = self.supervisor.free_finger();
        if self.guard.discontinuous() {
            self.slip.skip();
        }
        // Its filters start while a new grasp is checked, so that they have settled when it counts.
        let (guard, settles) = (&self.guard, self.controls());
        let holds = |j| settles && Some(j) != free && guard.trusts(j) && guard.drives(j);
        self.slip.update(&self.grasp, &self.state, self.guard.sensed_pose(), holds);
        if !self.slip_tells() {
            return;
        }
        let fastest = self.slip.fastest(self.config.force.slip_speed);
        if self.friction.update(fastest) {
            self.assume_friction();
        }
    }

    /// Tells the force optimisers the friction coefficient to assume.
    fn assume_friction(&mut self) {
        // The coefficient is positive and the number of edges stays, so nothing here can fail.
        let mut outcome = self.pyramid.set_friction(self.friction.mu());
        for j in 0..self.hand.n_fingers() {
            outcome = outcome.and(self.forces.set_pyramid(j, &self.pyramid));
            outcome = outcome.and(self.probe.set_pyramid(j, &self.pyramid));
        }
        debug_assert!(outcome.is_ok());
    }

    /// What the fingers fail to deliver, as a multiple of what a gait allows.
    pub(super) fn overload(&self, psi: &Vector6<f64>) -> f64 {
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
        self.hold_up();
        let scene = scene!(self, measurement);
        let (limits, tau) = (self.limiter.limits(), self.tau_own.as_mut_slice());
        // The finger that slides has its own velocity term, eq. (5), and its posture from the LP.
        let sliding = self.supervisor.sliding_finger();
        for k in (0..self.hand.n_fingers()).filter(|k| Some(*k) != sliding) {
            drag_torque(&self.hand, k, &scene, &self.config.robust, tau);
            self.posture.add_torque(&self.hand, k, &scene, (limits.min(), limits.max()), tau);
        }
        for (at, tau_own) in self.tau_own.iter().enumerate() {
            self.tau_min[at] = limits.min()[at] - tau_own;
            self.tau_max[at] = limits.max()[at] - tau_own;
        }
    }

    /// The torques that hold the fingers' own weight and their springs.
    fn hold_up(&mut self) {
        self.state.gravity_torque(&self.hand, self.tau_own.as_mut_slice());
        self.state.add_spring_torque(&self.hand, self.tau_own.as_mut_slice());
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
        let psi = self.slack_without(k, F_des);
        if psi.is_some_and(|psi| self.overload(&psi) <= 1.0) {
            self.supervisor.start(k, &self.grasp);
        } else {
            self.supervisor.refuse(k);
        }
    }

    /// What the others fail to deliver of the wrench `F` without finger `k`; None where no solver says.
    pub(super) fn slack_without(&mut self, k: usize, F: &Vector6<f64>) -> Option<Vector6<f64>> {
        self.f_limit.fill(self.config.force.f_n_max);
        self.f_limit[k] = 0.0;
        let scale = self.wrench_scale();
        let F = F.component_mul(&scale);
        self.probe.solve(&force_problem!(self, F)).map(|solution| solution.psi.component_div(&scale)).ok()
    }

    /// Eq. (8), with the free finger's force ramped or taken out.
    fn optimise_forces(&mut self, F_des: &Vector6<f64>) {
        for (j, limit) in self.f_limit.iter_mut().enumerate() {
            let open = self.regrasp.phase().is_open();
            let holds = self.guard.drives(j) && !self.guard.damps(j) && !open;
            *limit = if holds { self.supervisor.force_limit(j, self.config.force.f_n_max) } else { 0.0 };
            self.f_prev[3 * j + 2] += self.guard.squeeze() + self.regrasp.squeeze();
        }
        let scale = self.wrench_scale();
        let F = F_des.component_mul(&scale);
        let solution = self.forces.solve(&force_problem!(self, F));
        let d = &mut self.diagnostics;
        if let Ok(solution) = solution {
            self.f_prev.copy_from(&solution.f);
            self.command.tau.copy_from(&solution.tau);
            d.psi = solution.psi.component_div(&scale);
            self.psi_filtered += (d.psi - self.psi_filtered) * (self.dt / PSI_FILTER).min(1.0);
            d.status = solution.status;
            d.solver = solution.solver;
            d.kkt = solution.kkt;
            d.iterations = solution.iterations;
        } else {
            // Refused for numbers that the guard should have kept out: the last torques.
            self.command.tau.copy_from(self.limiter.previous());
            self.command.tau -= &self.tau_own;
            d.status = ForceStatus::Held;
            d.solver = SolverUsed::Held;
        }
        d.solver_counts = *self.forces.counts();
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
        self.velocity_force.update(k, &self.hand, &scene, qd_des, f_des, &mut self.tau_free);
        for (at, tau) in self.hand.joints(k).zip(&self.tau_free) {
            self.command.tau[at] = tau + self.tau_own[at];
        }
    }
}
