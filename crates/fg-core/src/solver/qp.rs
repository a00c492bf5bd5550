//! The force QP, eq. (8), in facet form.
//!
//! With `psi` and `beta` eliminated, eq. (8) is a strictly convex QP in the contact forces alone:
//!
//! ```text
//! min  1/2 (alpha1 + alpha2) |f - prior|^2 + 1/2 alpha3 |F_des - G f|^2,    prior = alpha2 / (alpha1 + alpha2) f_prev
//! s.t. lower_i <= a_i . f <= upper_i
//! ```
//!
//! Each row a_i has unit length, so that a bound, a violation and a slack are newtons: facets `n_k . f_j >= 0`, caps
//! `f_jz <= cap_j`, and torque rows `tau_min <= J_k . f <= tau_max` divided by the length of J's column. Facets stand for
//! `f = B beta, beta >= 0`: f is unique while beta is not, and no variables are added.
//!
//! Multipliers are given in newtons too: mu = (Lagrange multiplier of the objective above) / (alpha1 + alpha2).
//!
//! Eq. (8) has no unit of force of its own. No tolerance here is a fixed number of newtons, therefore: each is relative to
//! [`ForceQp::size`], the forces at hand.

use crate::friction::FrictionPyramid;

/// Largest number of contacts.
pub const MAX_CONTACTS: usize = 6;
/// Force components kept per vector: 3 for each contact, whether there is one or not, so that loops are of fixed length.
pub const WIDTH: usize = 3 * MAX_CONTACTS;
/// Largest number of rows that can be active and independent at once.
pub const MAX_ACTIVE: usize = 3 * MAX_CONTACTS;

/// Contact forces `[f_1; f_2; ..]` in the contact frames, N, padded with zeros.
pub type Forces = [f64; WIDTH];

/// One row `lower <= a . f <= upper`, |a| = 1, of which most touch a single contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Components of a at `contact`.
    pub normal: [f64; 3],
    /// The contact that the row touches.
    pub contact: usize,
    /// Where a touches several contacts: its place in [`ForceQp::wide`].
    pub wide: Option<usize>,
    /// N; -inf where there is none.
    pub lower: f64,
    /// N; +inf where there is none.
    pub upper: f64,
}

impl Row {
    const NONE: Self =
        Self { normal: [0.0; 3], contact: 0, wide: None, lower: f64::NEG_INFINITY, upper: f64::INFINITY };
}

/// Eq. (8) at one instant. All memory is allocated by [`ForceQp::new`].
#[derive(Debug, Clone)]
pub struct ForceQp {
    /// alpha1 + alpha2, 1/N^2.
    pub s: f64,
    /// alpha3.
    pub alpha3: f64,
    /// Grasp map by rows; the columns of pinned contacts are zero.
    pub G: [Forces; 6],
    /// Desired wrench on the object, N and N m.
    pub F_des: [f64; 6],
    /// Minimiser of the first two terms, N; zero at pinned contacts.
    pub prior: Forces,
    /// Contacts whose force is exactly zero.
    pub pinned: [bool; MAX_CONTACTS],
    /// Facets of contact 0, .., caps of contact 0, .., torques. Rows that cannot bind have no bounds.
    pub rows: Vec<Row>,
    /// Coefficients of the torque rows that touch several contacts.
    pub wide: Vec<Forces>,
    /// False where some row's bounds contradict each other, or zero, with no force to choose.
    pub consistent: bool,
    /// N: with torques asked of joints that no contact force turns, the force that would be needed at the shortest lever.
    pub unreachable: f64,
    /// N: the problem's own size. The largest of the prior, of what each component of F_des asks of one contact, and of
    /// what a torque row's bounds ask for; zero only where zero forces are the minimiser.
    pub scale: f64,
    n_contacts: usize,
    n_edges: Vec<usize>,
    cap_at: usize,
    torque_at: usize,
    ratio: f64,
}

impl ForceQp {
    /// Rows shorter than this, in m, are torques that no contact force changes.
    const SHORT: f64 = 1e-12;

    /// A QP for these pyramids (1 to [`MAX_CONTACTS`]) and `n_q` joints, weights `alpha`.
    pub fn new(pyramids: &[FrictionPyramid], n_q: usize, alpha: [f64; 3]) -> Self {
        let n_edges: Vec<_> = pyramids.iter().map(|p| p.facets().len()).collect();
        let cap_at = n_edges.iter().sum();
        let torque_at = cap_at + pyramids.len();
        let mut qp = Self {
            s: alpha[0] + alpha[1],
            alpha3: alpha[2],
            G: [[0.0; WIDTH]; 6],
            F_des: [0.0; 6],
            prior: [0.0; WIDTH],
            pinned: [false; MAX_CONTACTS],
            rows: vec![Row::NONE; torque_at + n_q],
            wide: vec![[0.0; WIDTH]; n_q],
            consistent: true,
            unreachable: 0.0,
            scale: 0.0,
            n_contacts: pyramids.len(),
            n_edges,
            cap_at,
            torque_at,
            ratio: alpha[1] / (alpha[0] + alpha[1]),
        };
        for (contact, pyramid) in pyramids.iter().enumerate() {
            qp.set_pyramid(contact, pyramid);
            qp.rows[cap_at + contact].contact = contact;
        }
        qp
    }

    /// Number of contacts.
    pub fn n_contacts(&self) -> usize {
        self.n_contacts
    }

    /// Number of force components that are not pinned.
    pub fn n_free(&self) -> usize {
        self.n() - 3 * self.pinned.iter().filter(|p| **p).count()
    }

    /// Number of force components, 3 per contact.
    pub fn n(&self) -> usize {
        3 * self.n_contacts
    }

    /// Index of the first torque row; the caps are the `n_contacts` rows before it.
    pub fn torque_at(&self) -> usize {
        self.torque_at
    }

    /// Component of a_i at force component `column`.
    pub fn coefficient(&self, row: &Row, column: usize) -> f64 {
        match row.wide {
            Some(k) => self.wide[k][column],
            None if row.contact == column / 3 => row.normal[column % 3],
            None => 0.0,
        }
    }

    /// Number of edges of the pyramid of `contact`.
    pub fn n_edges(&self, contact: usize) -> usize {
        self.n_edges[contact]
    }

    /// The facet rows of `contact`.
    pub fn facets(&self, contact: usize) -> &[Row] {
        let at: usize = self.n_edges[..contact].iter().sum();
        &self.rows[at..at + self.n_edges[contact]]
    }

    /// Overwrites the facets of `contact`; the number of edges stays.
    pub fn set_pyramid(&mut self, contact: usize, pyramid: &FrictionPyramid) {
        let at: usize = self.n_edges[..contact].iter().sum();
        for (row, facet) in self.rows[at..at + self.n_edges[contact]].iter_mut().zip(pyramid.facets()) {
            *row = Row { normal: [facet.x, facet.y, facet.z], contact, ..Row::NONE };
        }
    }

    /// Overwrites grasp map (column-major 6 x 3n), wrench and previous forces, with the caps on f_z; a cap <= 0 pins.
    pub fn set_objective(&mut self, G: &[f64], F_des: &[f64], f_prev: &[f64], f_normal_max: &[f64]) {
        self.F_des.copy_from_slice(F_des);
        let mut at = 0;
        for (contact, &cap) in f_normal_max[..self.n_contacts].iter().enumerate() {
            let pinned = cap <= 0.0;
            self.pinned[contact] = pinned;
            for i in 3 * contact..3 * contact + 3 {
                self.prior[i] = if pinned { 0.0 } else { self.ratio * f_prev[i] };
                for (row, g) in self.G.iter_mut().zip(&G[6 * i..6 * i + 6]) {
                    row[i] = if pinned { 0.0 } else { *g };
                }
            }
            let lower = if pinned { f64::NEG_INFINITY } else { 0.0 };
            for row in &mut self.rows[at..at + self.n_edges[contact]] {
                row.lower = lower;
            }
            at += self.n_edges[contact];
            let upper = if pinned { f64::INFINITY } else { cap };
            self.rows[self.cap_at + contact] = Row { normal: [0.0, 0.0, 1.0], contact, upper, ..Row::NONE };
        }
    }

    /// Overwrites the torque rows from J (column-major 3n x n_q) and the bounds, N m. Call after [`Self::set_objective`].
    pub fn set_torques(&mut self, J: &[f64], tau_min: &[f64], tau_max: &[f64]) {
        self.consistent = true;
        self.unreachable = 0.0;
        self.scale = self.asked();
        let n = self.n();
        let mut used = 0;
        for (joint, column) in J.chunks_exact(n).enumerate() {
            let (low, high) = (tau_min[joint], tau_max[joint]);
            let (mut length2, mut touched, mut last) = (0.0, 0, 0);
            for (contact, part) in column.chunks_exact(3).enumerate() {
                let part2 = part[0] * part[0] + part[1] * part[1] + part[2] * part[2];
                if part2 > 0.0 && !self.pinned[contact] {
                    length2 += part2;
                    touched += 1;
                    last = contact;
                }
            }
            let row = &mut self.rows[self.torque_at + joint];
            if length2 <= Self::SHORT * Self::SHORT {
                *row = Row::NONE;
                self.unreachable = self.unreachable.max(low.max(-high) / Self::SHORT);
                self.consistent &= self.unreachable <= 0.0;
                continue;
            }
            let scale = 1.0 / length2.sqrt();
            let part = &column[3 * last..3 * last + 3];
            *row = Row {
                normal: [scale * part[0], scale * part[1], scale * part[2]],
                contact: last,
                wide: None,
                lower: scale * low,
                upper: scale * high,
            };
            self.consistent &= low <= high;
            self.scale = self.scale.max(row.lower).max(-row.upper);
            if touched > 1 {
                row.wide = Some(used);
                let wide = &mut self.wide[used];
                *wide = [0.0; WIDTH];
                for (i, a) in column.iter().enumerate() {
                    wide[i] = if self.pinned[i / 3] { 0.0 } else { scale * a };
                }
                used += 1;
            }
        }
    }

    /// N: the largest component of `f`; where the forces are small, 1 N or the problem's scale, whichever is smaller.
    ///
    /// What a violation, a slack or an error of `f` is measured against. The wrench that is asked for does not count
    /// beyond 1 N: forces within bounds stay well within them, however much is asked.
    pub fn size(&self, f: &Forces) -> f64 {
        largest(f).max(self.scale.min(1.0))
    }

    /// N: what the objective asks for, see [`ForceQp::scale`].
    fn asked(&self) -> f64 {
        let mut asked = largest(&self.prior);
        for (row, F) in self.G.iter().zip(&self.F_des) {
            let lever = largest(row);
            if F.abs() > asked * lever && lever > 0.0 {
                asked = F.abs() / lever;
            }
        }
        asked
    }

    /// a_i . f, N.
    #[inline]
    pub fn along(&self, row: &Row, f: &Forces) -> f64 {
        match row.wide {
            Some(k) => dot(&self.wide[k], f),
            None => dot3(&row.normal, f, 3 * row.contact),
        }
    }

    /// Adds `weight * a_i` to `f`.
    #[inline]
    pub fn add_row(&self, row: &Row, weight: f64, f: &mut Forces) {
        if let Some(k) = row.wide {
            for (x, a) in f.iter_mut().zip(&self.wide[k]) {
                *x += weight * a;
            }
        } else {
            for (x, a) in f[3 * row.contact..3 * row.contact + 3].iter_mut().zip(&row.normal) {
                *x += weight * a;
            }
        }
    }

    /// F_des - G f, N and N m.
    pub fn psi(&self, f: &Forces) -> [f64; 6] {
        let mut psi = self.F_des;
        for (y, row) in psi.iter_mut().zip(&self.G) {
            *y -= dot(row, f);
        }
        psi
    }
}

/// x . y, in four partial sums that the compiler can keep in vector registers.
#[inline]
pub fn dot(x: &Forces, y: &Forces) -> f64 {
    let mut sum = [0.0; 4];
    for (x, y) in x.chunks(4).zip(y.chunks(4)) {
        for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
            *s += x * y;
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}

/// The largest component's absolute value.
#[inline]
pub fn largest(x: &Forces) -> f64 {
    let mut most = [0.0; 4];
    for part in x.chunks_exact(4) {
        for (m, x) in most.iter_mut().zip(part) {
            // Not f64::max, whose care for NaN costs; a NaN is found by the residual.
            *m = if x.abs() > *m { x.abs() } else { *m };
        }
    }
    most[0].max(most[1]).max(most[2].max(most[3]))
}

#[inline]
fn dot3(normal: &[f64; 3], f: &Forces, at: usize) -> f64 {
    normal[0] * f[at] + normal[1] * f[at + 1] + normal[2] * f[at + 2]
}
