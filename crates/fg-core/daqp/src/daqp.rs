//! DAQP on the force QP in facet form, in the contact forces alone.

use crate::instances::{Family, Instance, Sequence};

extern "C" {
    fn fg_daqp_new(n: i32, m: i32, tolerance: f64) -> *mut u8;
    fn fg_daqp_solve(
        solver: *mut u8,
        H: *mut f64,
        f: *mut f64,
        A: *mut f64,
        upper: *mut f64,
        lower: *mut f64,
        x: *mut f64,
    ) -> i32;
}

/// alpha1, alpha2, alpha3 of the paper.
const ALPHA: [f64; 3] = [0.01, 0.01, 1000.0];
/// DAQP's infinity.
const UNBOUNDED: f64 = 1e30;

/// One warm-started solver with its data: min 1/2 x'H x + f'x, lower <= A x <= upper. Rows are facets, caps, torques.
pub struct Daqp {
    solver: *mut u8,
    n: usize,
    facets: usize,
    capped: bool,
    H: Vec<f64>,
    f: Vec<f64>,
    A: Vec<f64>,
    upper: Vec<f64>,
    lower: Vec<f64>,
    pub x: Vec<f64>,
}

impl Daqp {
    pub fn new(sequence: &Sequence) -> Self {
        let n = 3 * sequence.n;
        let capped = sequence.family == Family::Release;
        let facets: usize = sequence.pyramids.iter().map(|pyramid| pyramid.facets().len()).sum();
        let m = facets + if capped { sequence.n } else { 0 } + n;
        let mut A = vec![0.0; m * n];
        let normals = sequence.pyramids.iter().enumerate();
        let normals = normals.flat_map(|(c, pyramid)| pyramid.facets().iter().map(move |normal| (c, normal)));
        for (row, (c, normal)) in normals.enumerate() {
            A[row * n + 3 * c..][..3].copy_from_slice(normal.as_slice());
        }
        if capped {
            for c in 0..sequence.n {
                A[(facets + c) * n + 3 * c + 2] = 1.0;
            }
        }
        let mut lower = vec![-UNBOUNDED; m];
        lower[..facets].fill(0.0);
        let (n_rows, m_rows) = (i32::try_from(n).expect("small"), i32::try_from(m).expect("small"));
        // SAFETY: plain numbers; the solver lives as long as the process.
        let solver = unsafe { fg_daqp_new(n_rows, m_rows, 1e-9) };
        Self {
            solver,
            n,
            facets,
            capped,
            H: vec![0.0; n * n],
            f: vec![0.0; n],
            A,
            upper: vec![UNBOUNDED; m],
            lower,
            x: vec![0.0; n],
        }
    }

    /// Forms and solves the QP of `instance`; whether DAQP calls it solved.
    pub fn solve(&mut self, instance: &Instance) -> bool {
        self.form(instance);
        let Self { solver, H, f, A, upper, lower, x, .. } = self;
        // SAFETY: arrays of the sizes that the solver was made for, which nothing else uses meanwhile.
        let flag = unsafe {
            fg_daqp_solve(
                *solver,
                H.as_mut_ptr(),
                f.as_mut_ptr(),
                A.as_mut_ptr(),
                upper.as_mut_ptr(),
                lower.as_mut_ptr(),
                x.as_mut_ptr(),
            )
        };
        flag == 1
    }

    fn form(&mut self, p: &Instance) {
        let (n, [a1, a2, a3]) = (self.n, ALPHA);
        let G: Vec<&[f64]> = p.G.as_slice().chunks_exact(6).collect();
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let free = |i: usize| p.f_normal_max[i / 3] > 0.0;
        for i in 0..n {
            for j in 0..=i {
                let GtG = if free(i) && free(j) { a3 * dot(G[i], G[j]) } else { 0.0 };
                let h = if i == j { a1 + a2 + GtG } else { GtG };
                (self.H[i * n + j], self.H[j * n + i]) = (h, h);
            }
            let wanted = || a3 * dot(G[i], p.F_des.as_slice()) + a2 * p.f_prev[i];
            self.f[i] = if free(i) { -wanted() } else { 0.0 };
        }
        let mut row = self.facets;
        if self.capped {
            for cap in &p.f_normal_max {
                self.upper[row] = cap.min(UNBOUNDED);
                row += 1;
            }
        }
        for (k, column) in p.J.as_slice().chunks_exact(n).enumerate() {
            self.A[row * n..][..n].copy_from_slice(column);
            (self.lower[row], self.upper[row]) = (p.tau_min[k], p.tau_max[k]);
            row += 1;
        }
    }
}
