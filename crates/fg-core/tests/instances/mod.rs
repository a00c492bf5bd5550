//! Force optimisation problems like those of a hand at work: sequences in which one instance follows from the last.
#![allow(non_snake_case, dead_code)]

pub mod oracle;

use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::ForceProblem;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3, Vector6};

/// A small generator, so that seeds mean the same on every platform.
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits (splitmix64).
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// Uniform in low..high.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Uniform in 0..n.
    #[allow(clippy::cast_possible_truncation)] // below n
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// Uniform in a cube.
    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform(-size, size))
    }
}

/// What happens in a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    Nominal,
    Disturbance,
    TorqueLimited,
    Release,
    Infeasible,
}

pub const FAMILIES: [Family; 5] =
    [Family::Nominal, Family::Disturbance, Family::TorqueLimited, Family::Release, Family::Infeasible];

/// The data of a [`ForceProblem`].
#[derive(Debug, Clone)]
pub struct Instance {
    pub G: DMatrix<f64>,
    pub J: DMatrix<f64>,
    pub F_des: Vector6<f64>,
    pub f_prev: DVector<f64>,
    pub tau_min: DVector<f64>,
    pub tau_max: DVector<f64>,
    pub f_normal_max: Vec<f64>,
}

impl Instance {
    pub fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            G: &self.G,
            J: &self.J,
            F_des: &self.F_des,
            f_prev: &self.f_prev,
            tau_min: &self.tau_min,
            tau_max: &self.tau_max,
            f_normal_max: &self.f_normal_max,
        }
    }
}

/// A problem with nothing of a hand about it but the sizes of its numbers: loose, tight, empty and coupled torque bounds,
/// caps, pinned contacts, flat grasp maps. Returns the pyramids with it.
pub fn arbitrary(random: &mut Random) -> (Vec<FrictionPyramid>, Instance) {
    let n = 2 + random.below(5);
    let m = 3 + random.below(10);
    let n_q = [3 * n, 4 * n, 2 * n, 7 * n][random.below(4)];
    let kind = random.below(6);
    let coupled = random.below(4) == 0;
    let pyramids = (0..n).map(|_| FrictionPyramid::inscribed(random.uniform(0.1, 1.5), m).unwrap()).collect();
    let mut G = DMatrix::from_fn(6, 3 * n, |i, _| random.uniform(-1.0, 1.0) * if i < 3 { 1.0 } else { 0.05 });
    if kind == 1 {
        G.fill(0.0);
    }
    let mut J =
        DMatrix::from_fn(
            3 * n,
            n_q,
            |i, k| {
                if coupled || i / 3 == k % n {
                    random.uniform(-0.1, 0.1)
                } else {
                    0.0
                }
            },
        );
    let limit = [0.5, 0.05, 0.2][random.below(3)];
    let mut tau_min = DVector::from_element(n_q, -limit);
    let mut tau_max = DVector::from_element(n_q, limit);
    match kind {
        2 => {
            // A joint without effect, and two that are one.
            J.column_mut(0).fill(0.0);
            let copy = J.column(1).clone_owned();
            J.set_column(n_q - 1, &copy);
        }
        3 => {
            for k in (0..n_q).filter(|k| k % 3 == 0) {
                let centre = random.uniform(-0.3, 0.3);
                (tau_min[k], tau_max[k]) = (centre - 0.1, centre + 0.1);
            }
        }
        4 => (tau_min[0], tau_max[0]) = (0.02, 0.02),
        5 => {
            tau_min[random.below(n_q)] = f64::NEG_INFINITY;
            tau_max[random.below(n_q)] = f64::INFINITY;
        }
        _ => {}
    }
    let scale = [1.0, 10.0, 50.0][random.below(3)];
    let F_des = Vector6::from_fn(|i, _| random.uniform(-1.0, 1.0) * scale * if i < 3 { 1.0 } else { 0.05 });
    let f_prev = DVector::from_fn(3 * n, |_, _| random.uniform(-3.0, 5.0));
    let f_normal_max = (0..n)
        .map(|_| match random.below(6) {
            0 => 0.0,
            1 => random.uniform(0.0, 5.0),
            _ => f64::INFINITY,
        })
        .collect();
    (pyramids, Instance { G, J, F_des, f_prev, tau_min, tau_max, f_normal_max })
}

/// A cylinder held by spherical tips of three-joint fingers with links of 52 and 45 mm.
pub struct Sequence {
    pub family: Family,
    pub n: usize,
    pub pyramids: Vec<FrictionPyramid>,
    q: Vec<Vector3<f64>>,
    angle: Vec<f64>,
    height: Vec<f64>,
    radius: f64,
    mass: f64,
    push: Vector6<f64>,
    limit: f64,
    released: usize,
    phase: f64,
}

impl Sequence {
    pub const LENGTH: usize = 100;

    pub fn new(random: &mut Random, family: Family, n: usize, edges: usize) -> Self {
        let mu = random.uniform(0.4, 1.0);
        let spread = std::f64::consts::TAU / n as f64;
        let (force, torque) = match family {
            Family::Infeasible => (15.0, 2.0),
            Family::TorqueLimited => (12.0, 0.1),
            _ => (5.0 / 3_f64.sqrt(), 0.05),
        };
        let (f, t) = (random.vector(force), random.vector(torque));
        Self {
            family,
            n,
            pyramids: vec![FrictionPyramid::inscribed(mu, edges).unwrap(); n],
            q: (0..n)
                .map(|_| {
                    Vector3::new(
                        random.uniform(-0.3, 0.3),
                        random.uniform(0.1, 0.8),
                        random.uniform(0.3, 1.2),
                    )
                })
                .collect(),
            angle: (0..n).map(|k| spread * (k as f64 + random.uniform(-0.2, 0.2))).collect(),
            height: (0..n).map(|_| random.uniform(-0.02, 0.02)).collect(),
            radius: random.uniform(0.025, 0.04),
            mass: random.uniform(0.1, 0.6),
            push: Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z),
            limit: if family == Family::TorqueLimited { random.uniform(0.1, 0.5) } else { 0.5 },
            released: random.below(n),
            phase: random.uniform(0.0, 6.0),
        }
    }

    /// The instance at step `k`, of period 2 ms, after forces `f_prev`.
    pub fn at(&self, k: usize, f_prev: &DVector<f64>) -> Instance {
        let n = self.n;
        let t = 0.002 * k as f64;
        let wobble = (8.0 * t + self.phase).sin();
        let mut G = DMatrix::zeros(6, 3 * n);
        let mut J = DMatrix::zeros(3 * n, 3 * n);
        for i in 0..n {
            // Contact frame: z along the inward normal of the cylinder, tilted a little as sensors do.
            let yaw = self.angle[i] + 0.3 * wobble;
            let tilt = Rotation3::from_euler_angles(0.1 * wobble, 0.15 * (5.0 * t + i as f64).sin(), 0.0);
            let inward = tilt * Vector3::new(-yaw.cos(), -yaw.sin(), 0.0);
            let x = inward.cross(&Vector3::z()).normalize();
            let y = inward.cross(&x);
            let R_WC = Matrix3::from_columns(&[x, y, inward]);
            let height = self.height[i] + 0.005 * wobble;
            let p = Vector3::new(self.radius * yaw.cos(), self.radius * yaw.sin(), height);
            G.view_mut((0, 3 * i), (3, 3)).copy_from(&R_WC);
            G.view_mut((3, 3 * i), (3, 3)).copy_from(&(p.cross_matrix() * R_WC));
            let q = self.q[i].add_scalar(0.1 * wobble);
            let J_W = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw + std::f64::consts::PI).matrix()
                * finger(&q);
            // v = J_W qd, so tau = J_W' R f.
            J.view_mut((3 * i, 3 * i), (3, 3)).copy_from(&(R_WC.transpose() * J_W));
        }
        let mut F_des = Vector6::new(0.0, 0.0, 9.81 * self.mass, 0.0, 0.0, 0.0);
        F_des += Vector6::new(0.3, 0.2, 0.4, 0.004, 0.006, 0.002) * (11.0 * t + self.phase).sin();
        let pulse = (20..70).contains(&k);
        if self.family != Family::Nominal && self.family != Family::Release && pulse {
            F_des += self.push;
        }
        let mut f_normal_max = vec![f64::INFINITY; n];
        if self.family == Family::Release {
            f_normal_max[self.released] = match k {
                0..20 => f64::INFINITY,
                20..40 => 0.1 * (39 - k) as f64,
                40..70 => 0.0,
                _ => 0.1 * (k - 69) as f64,
            };
        }
        Instance {
            G,
            J,
            F_des,
            f_prev: f_prev.clone(),
            tau_min: DVector::from_element(3 * n, -self.limit),
            tau_max: DVector::from_element(3 * n, self.limit),
            f_normal_max,
        }
    }
}

/// Velocity Jacobian of a finger's contact: it stands on the palm, z up, and bends towards x.
fn finger(q: &Vector3<f64>) -> Matrix3<f64> {
    let (a, b) = (0.052, 0.045);
    let roll = Rotation3::from_axis_angle(&Vector3::x_axis(), q.x);
    let link = |angle: f64, length: f64| Vector3::new(length * angle.sin(), 0.0, length * angle.cos());
    let knee = roll * link(q.y, a);
    let tip = knee + roll * link(q.y + q.z, b) + 0.014 * Vector3::x();
    let axis = roll * Vector3::y();
    Matrix3::from_columns(&[Vector3::x().cross(&tip), axis.cross(&tip), axis.cross(&(tip - knee))])
}
