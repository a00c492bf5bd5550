//! The velocity-force controller of the free finger, eq. (5).
//!
//! Deviation: the paper's K_v qd_des is a torque and closes no loop: it turns a joint at qd_des where K_v happens to be the
//! joint's damping. Here damping and dry friction, known from the hand's model, are overcome along qd_des, and what the
//! model has wrong is closed on the encoders, with the model's inertia. What is fed back acts in the tangent plane: it
//! neither presses on the surface nor lifts off it.

use crate::config::Config;
use crate::grasp::Scene;
use crate::hand::HandModel;
use nalgebra::SVector;

/// One number for each joint of a finger, zero behind its last.
type PerJoint = SVector<f64, { HandModel::MAX_JOINTS }>;

/// Turns the desired joint velocity and normal force of the free finger into joint torques.
#[derive(Debug, Clone)]
pub struct VelocityForceController {
    config: Config,
    dt: f64,
    /// Share of the past in one step of the force filter, and of the velocity filter.
    force_memory: f64,
    velocity_memory: f64,
    /// Filtered normal force, N.
    f_act: f64,
    /// Joint angles one step ago, rad; None at the start.
    q: Option<PerJoint>,
    /// Filtered joint velocities, rad/s.
    qd: PerJoint,
    /// How far the joints are behind the angles that qd_des adds up to, rad.
    lag: PerJoint,
}

impl VelocityForceController {
    /// A controller at the control period `dt`.
    pub fn new(config: &Config, dt: f64) -> Self {
        let memory = |time: f64| if time > 0.0 { (-dt / time).exp() } else { 0.0 };
        Self {
            force_memory: memory(config.gait.force_filter),
            velocity_memory: memory(config.gait.velocity_filter),
            config: config.clone(),
            dt,
            f_act: 0.0,
            q: None,
            qd: PerJoint::zeros(),
            lag: PerJoint::zeros(),
        }
    }

    /// Starts from the normal force `f_n`, N, and a finger that follows as it should.
    pub fn reset(&mut self, f_n: f64) {
        self.f_act = f_n;
        self.q = None;
        self.qd.fill(0.0);
        self.lag.fill(0.0);
    }

    /// Filtered normal force, N.
    pub fn f_act(&self) -> f64 {
        self.f_act
    }

    /// Writes the torques of the joints of finger `k`, N m:
    ///
    /// tau_des,k = D qd_des + tau_c sat(qd_des / v_c) + P (M w (qd_des - qd) + D w lag) + K_f J^T (f_des - f_act) n,
    ///
    /// with D the joints' damping (K_v, where one is given), tau_c their dry friction, M the finger's inertia, w the bandwidth
    /// of the loop and lag the integral of qd_des - qd. On a finger that is as modelled, M qdd + D qd = tau, the loop is w / s
    /// whatever M and D are. P takes the acceleration along the normal out.
    ///
    /// The force term pushes along the inward normal. Its static force is f_des K_f / (1 + K_f), as in the paper.
    pub fn update(
        &mut self,
        k: usize,
        hand: &HandModel,
        scene: &Scene<'_>,
        qd_des: &[f64],
        f_des: f64,
        tau: &mut [f64],
    ) {
        let (gait, contact) = (&self.config.gait, scene.grasp.contact(k));
        let first = hand.joints(k).start;
        self.f_act = self.force_memory * self.f_act + (1.0 - self.force_memory) * contact.f_n;
        let push = gait.K_f * (f_des - self.f_act);
        let (mut drag, mut damping) = (PerJoint::zeros(), PerJoint::zeros());
        let (mut normal, mut q, mut wanted) = (PerJoint::zeros(), PerJoint::zeros(), PerJoint::zeros());
        for (i, at) in hand.joints(k).enumerate() {
            let mut joint = *hand.coordinate(at);
            joint.damping = gait.K_v.unwrap_or(joint.damping);
            drag[i] = joint.drag(qd_des[i], self.config.robust.friction_speed);
            damping[i] = joint.damping;
            normal[i] = contact.n_W.dot(&scene.state.jacobian_column(at, &contact.p_WC));
            q[i] = scene.q[at];
            wanted[i] = qd_des[i];
        }
        let feedback = if gait.velocity_bandwidth > 0.0 {
            self.feedback(k, hand, scene, &q, &wanted, &damping, &normal)
        } else {
            PerJoint::zeros()
        };
        for at in hand.joints(k) {
            let i = at - first;
            tau[i] = drag[i] + feedback[i] + push * normal[i];
        }
    }

    /// P (M w (qd_des - qd) + D w lag), with the loop moved on by one step.
    #[allow(clippy::too_many_arguments, reason = "one call, all of it at hand there")]
    fn feedback(
        &mut self,
        k: usize,
        hand: &HandModel,
        scene: &Scene<'_>,
        q: &PerJoint,
        wanted: &PerJoint,
        damping: &PerJoint,
        normal: &PerJoint,
    ) -> PerJoint {
        if let Some(last) = self.q {
            let turned = q - last;
            self.qd = self.qd * self.velocity_memory + turned * ((1.0 - self.velocity_memory) / self.dt);
            self.lag += wanted * self.dt - turned;
        } else {
            self.qd = *wanted;
        }
        self.q = Some(*q);
        let w = self.config.gait.velocity_bandwidth;
        let M = scene.state.inertia(hand, k);
        let force = (M * (wanted - self.qd) + damping.component_mul(&self.lag)) * w;
        // P = 1 - a (a M^-1 a)^-1 a M^-1 with a = J^T n, so that a M^-1 P = 0.
        let Some(factor) = M.cholesky() else { return PerJoint::zeros() };
        let compliance = factor.solve(normal);
        let along = normal.dot(&compliance);
        if along < f64::MIN_POSITIVE {
            return force;
        }
        // What was followed along the normal is no lag to make up in the plane.
        self.lag -= compliance * (normal.dot(&self.lag) / along);
        force - normal * (compliance.dot(&force) / along)
    }
}
