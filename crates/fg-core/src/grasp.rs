//! The grasp at one instant: contacts, grasp map G and hand Jacobian J_h.

use crate::hand::{HandModel, HandState};
use crate::signals::Measurement;
use crate::spatial::contact_frame;
use nalgebra::{DMatrix, Isometry3, Matrix3, Unit, Vector3, Vector6};

/// One fingertip on, or near, the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// True where the tactile sensor feels the object.
    pub touching: bool,
    /// Contact point in W, m; without contact the point of the tip that faces the last known surface.
    pub p_WC: Vector3<f64>,
    /// Unit normal at the contact in W, into the object.
    pub n_W: Vector3<f64>,
    /// Contact frame C: z along `n_W`.
    pub R_WC: Matrix3<f64>,
    /// Normal force, N.
    pub f_n: f64,
    /// The normal in the object's frame, kept while the finger is off the object.
    n_O: Option<Unit<Vector3<f64>>>,
}

/// What the hand and the object do at one instant: all that the gait planner looks at.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// Contacts.
    pub grasp: &'a Grasp,
    /// Kinematics of the fingers.
    pub state: &'a HandState,
    /// Pose of the object in W.
    pub X_WO: &'a Isometry3<f64>,
    /// Desired twist of the object [linear; angular] in W: what its surface is meant to do.
    pub V_WD: &'a Vector6<f64>,
    /// Joint angles, finger by finger, rad.
    pub q: &'a [f64],
}

/// The contacts of this instant with G and J_h. Allocated once, overwritten by [`Grasp::update`].
#[derive(Debug, Clone)]
pub struct Grasp {
    contacts: Vec<Contact>,
    /// Grasp map (6, 3n): wrench on the object at Oo in W of the contact forces in their contact frames.
    pub G: DMatrix<f64>,
    /// Hand Jacobian (3n, n_q): velocities of the tips' contact points in the contact frames; tau = J_h^T f.
    pub J: DMatrix<f64>,
    /// Normal force below which a reading counts as no contact, N.
    contact_force: f64,
}

impl Grasp {
    /// A grasp for `hand`, not yet valid. Readings under `contact_force` newtons count as no contact.
    pub fn new(hand: &HandModel, contact_force: f64) -> Self {
        let n = hand.n_fingers();
        let none = Contact {
            touching: false,
            p_WC: Vector3::zeros(),
            n_W: Vector3::z(),
            R_WC: Matrix3::identity(),
            f_n: 0.0,
            n_O: None,
        };
        Self {
            contacts: vec![none; n],
            G: DMatrix::zeros(6, 3 * n),
            J: DMatrix::zeros(3 * n, hand.n_q()),
            contact_force,
        }
    }

    /// Recomputes everything from the tactile contact places, the tips' known shape and the kinematics.
    ///
    /// The normal of a spherical tip at its contact is the direction from its centre to the contact. A finger without
    /// contact keeps the last normal, carried along by the object; one that never had any faces the object's origin.
    pub fn update(&mut self, hand: &HandModel, state: &HandState, measurement: &Measurement) {
        let X_WO = &measurement.X_WO;
        for (j, contact) in self.contacts.iter_mut().enumerate() {
            let (X_WF, tactile) = (state.tip(j), &measurement.tactile[j]);
            let p_WF = X_WF.translation.vector;
            let sensed = Unit::try_new(tactile.p_FC, 1e-6).filter(|_| tactile.f_n > self.contact_force);
            contact.touching = sensed.is_some();
            contact.f_n = if contact.touching { tactile.f_n } else { 0.0 };
            let n_W = match (sensed, contact.n_O) {
                (Some(n_F), _) => X_WF.rotation * n_F,
                (None, Some(n_O)) => X_WO.rotation * n_O,
                (None, None) => {
                    Unit::try_new(X_WO.translation.vector - p_WF, 1e-6).unwrap_or(Vector3::z_axis())
                }
            };
            if contact.touching {
                contact.n_O = Some(X_WO.rotation.inverse() * n_W);
            }
            contact.n_W = n_W.into_inner();
            contact.p_WC = p_WF + contact.n_W * hand.tip_radius(j);
            contact.R_WC = contact_frame(&contact.n_W);
        }
        self.assemble(state, X_WO);
    }

    fn assemble(&mut self, state: &HandState, X_WO: &Isometry3<f64>) {
        for (j, contact) in self.contacts.iter().enumerate() {
            let arm = contact.p_WC - X_WO.translation.vector;
            for axis in 0..3 {
                let direction = contact.R_WC.column(axis).into_owned();
                let moment = arm.cross(&direction);
                let column = 3 * j + axis;
                for r in 0..3 {
                    self.G[(r, column)] = direction[r];
                    self.G[(3 + r, column)] = moment[r];
                }
            }
            for at in state.joints(j) {
                let v_W = state.jacobian_column(at, &contact.p_WC);
                let v_C = contact.R_WC.tr_mul(&v_W);
                for r in 0..3 {
                    self.J[(3 * j + r, at)] = v_C[r];
                }
            }
        }
    }

    /// The contact of finger `j`.
    pub fn contact(&self, j: usize) -> &Contact {
        &self.contacts[j]
    }

    /// All contacts, finger by finger.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Number of fingers that feel the object.
    pub fn n_touching(&self) -> usize {
        self.contacts.iter().filter(|c| c.touching).count()
    }
}
