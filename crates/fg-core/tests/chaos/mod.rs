//! Recorded measurements with anything put into them, driven by a stream of bytes: for the invariants and the fuzzers.
#![allow(dead_code, reason = "each user needs its own part")]

use fg_core::dual_stage::DualStagePlanner;
use fg_core::hand::TorqueLimits;
use fg_core::signals::{Measurement, Reference};
use nalgebra::{DVector, UnitQuaternion, Vector3, Vector6};

/// Numbers that break programs.
const BAD: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    1e-320,
    -0.0,
    1e308,
    -1e60,
    1e15,
    10.0,
];

/// A stream of bytes; zeros once they are used up.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    pub fn byte(&mut self) -> u8 {
        match self.0.split_first() {
            Some((first, rest)) => {
                self.0 = rest;
                *first
            }
            None => 0,
        }
    }

    pub fn below(&mut self, n: usize) -> usize {
        (usize::from(self.byte()) << 8 | usize::from(self.byte())) % n
    }

    /// A bad number, or any number at all, or one near `x`.
    fn number(&mut self, x: f64) -> f64 {
        match self.byte() % 4 {
            0 => BAD[self.below(BAD.len())],
            1 => f64::from_bits(u64::from_le_bytes(std::array::from_fn(|_| self.byte()))),
            2 => x + (f64::from(self.byte()) - 128.0) * 0.01,
            _ => -x,
        }
    }
}

/// Puts one more thing into a measurement and its reference.
pub fn spoil(bytes: &mut Bytes<'_>, m: &mut Measurement, r: &mut Reference) {
    let (n_q, n) = (m.q.len(), m.tactile.len());
    match bytes.byte() % 14 {
        0 => m.t = bytes.number(m.t),
        1 | 2 => {
            let i = bytes.below(n_q);
            m.q[i] = bytes.number(m.q[i]);
        }
        3 => {
            let i = bytes.below(n_q);
            m.tau[i] = bytes.number(m.tau[i]);
        }
        4 => {
            let i = bytes.below(3);
            m.X_WO.translation.vector[i] = bytes.number(m.X_WO.translation.vector[i]);
        }
        5 => {
            let mut q = *m.X_WO.rotation.quaternion();
            let i = bytes.below(4);
            q.coords[i] = bytes.number(q.coords[i]);
            m.X_WO.rotation = UnitQuaternion::new_unchecked(q);
        }
        6 => {
            let turn = Vector3::from_fn(|_, _| f64::from(bytes.byte()) * 0.01);
            m.X_WO.rotation = UnitQuaternion::from_scaled_axis(turn) * m.X_WO.rotation;
        }
        7 | 8 => {
            let j = bytes.below(n);
            m.tactile[j].f_n = bytes.number(m.tactile[j].f_n);
        }
        9 => {
            let (j, i) = (bytes.below(n), bytes.below(3));
            m.tactile[j].p_FC[i] = bytes.number(m.tactile[j].p_FC[i]);
        }
        10 => {
            let i = bytes.below(3);
            r.X_WD.translation.vector[i] = bytes.number(r.X_WD.translation.vector[i]);
        }
        11 => {
            let i = bytes.below(6);
            r.V_WD[i] = bytes.number(r.V_WD[i]);
        }
        12 => m.tactile.iter_mut().for_each(|tactile| tactile.f_n = 0.0),
        _ => {
            *m = Measurement::zeros(n, n_q);
            r.V_WD = Vector6::repeat(bytes.number(0.0));
        }
    }
}

/// What must hold of every command, whatever came in.
pub fn check(planner: &DualStagePlanner, tau: &DVector<f64>, before: &DVector<f64>) {
    let config = planner.config();
    let limits = TorqueLimits::of(planner.hand(), config.force.tau_max).expect("limits");
    let limits = limits.min().iter().zip(limits.max());
    let change = config.force.tau_rate_max / config.rate_hz * (1.0 + 1e-12);
    for ((tau, before), (min, max)) in tau.iter().zip(before.iter()).zip(limits) {
        assert!(tau.is_finite() && min <= tau && tau <= max, "{tau}");
        assert!((tau - before).abs() <= change, "{tau} after {before}");
    }
    let mut row = Vec::new();
    planner.diagnostics().row(&mut row);
    // The threshold is NaN before the first grasp.
    assert!(row.iter().filter(|x| !x.is_finite()).count() <= 1, "{:?}", planner.diagnostics());
}

/// Drives `planner` through `rows` from byte to byte: each step is spoilt by zero to three things, kept for a while; steps
/// are skipped, repeated, the planner reset. Returns the steps made.
pub fn drive(planner: &mut DualStagePlanner, rows: &[(Measurement, Reference)], data: &[u8]) -> usize {
    let mut bytes = Bytes(data);
    let n_q = rows[0].0.q.len();
    let mut before = DVector::zeros(n_q);
    let (mut k, mut steps) = (bytes.below(rows.len()), 0);
    planner.reset();
    while !bytes.0.is_empty() {
        let action = bytes.byte();
        let things = usize::from(action & 3);
        let length = 1 << (action >> 2 & 7);
        let fault = bytes.0;
        for _ in 0..length {
            let (mut m, mut r) = rows[k % rows.len()].clone();
            bytes = Bytes(fault);
            for _ in 0..things {
                spoil(&mut bytes, &mut m, &mut r);
            }
            let tau = planner.step(&m, &r).expect("right lengths").tau.clone();
            check(planner, &tau, &before);
            before = tau;
            k += 1;
            steps += 1;
        }
        match action >> 5 {
            0 => k += bytes.below(100),
            1 if bytes.byte() == 0 => {
                planner.reset();
                before.fill(0.0);
            }
            _ => (),
        }
    }
    steps
}
