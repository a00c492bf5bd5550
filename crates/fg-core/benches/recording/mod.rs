//! Measurements and references recorded in the closed loop (format in `python/fingergait/record.py`), for benches, tests,
//! the soak and the fuzzers.
#![allow(dead_code, reason = "each user needs its own part")]

use fg_core::config::Config;
use fg_core::dual_stage::DualStagePlanner;
use fg_core::hand::HandModel;
use fg_core::manipulation::robust::Controller;
use fg_core::signals::{Measurement, Reference, Tactile};
use nalgebra::{DVector, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};
use serde_json::Value;

/// The lift and the first gaits of an ideal run.
pub const ROTATE: &[u8] = include_bytes!("../data/rotate.rec");
/// The same with the sensors that users have: noise, 12 bits, a pose at 60 Hz that is 30 ms late.
pub const NOISY: &[u8] = include_bytes!("../data/noisy.rec");

/// One recorded run.
pub struct Recording {
    pub hand: HandModel,
    pub controller: Controller,
    pub config: Config,
    pub rows: Vec<(Measurement, Reference)>,
    /// The torques that the recorded run commanded at each row, N m.
    pub commands: Vec<DVector<f64>>,
}

impl Recording {
    /// The recording in `bytes`.
    pub fn parse(bytes: &[u8]) -> Self {
        let end = bytes.iter().position(|b| *b == b'\n').expect("a line of JSON");
        let head: Value = serde_json::from_slice(&bytes[..end]).expect("JSON");
        assert_eq!(head["format"], "fingergait-recording/2");
        let size = |field: &str| usize::try_from(head[field].as_u64().expect(field)).expect(field);
        let (n, m, rows) = (size("fingers"), size("joints"), size("rows"));
        let rate = head["rate_hz"].as_f64().expect("rate_hz");
        let sensed = 2 * n * m + 7 + 4 * n + 7 + 6;
        let width = sensed + n * m;
        let numbers: Vec<f64> = bytes[end + 1..]
            .chunks_exact(4)
            .map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
            .collect();
        assert_eq!(numbers.len(), rows * width);
        let rows = || numbers.chunks_exact(width).map(|row| row.split_at(sensed));
        Self {
            hand: HandModel::from_json(&head["hand"].to_string()).expect("hand"),
            controller: Controller::from_json(&head["controller"].to_string()).expect("controller"),
            config: Config::from_json(&head["config"].to_string()).expect("config"),
            rows: rows().enumerate().map(|(k, (row, _))| parse_row(k as f64 / rate, n, m, row)).collect(),
            commands: rows().map(|(_, tau)| DVector::from_column_slice(tau)).collect(),
        }
    }

    /// A planner as the one of the recorded run, with `change` made to its configuration.
    pub fn planner_with(&self, change: impl FnOnce(&mut Config)) -> DualStagePlanner {
        let mut config = self.config.clone();
        change(&mut config);
        DualStagePlanner::new(self.hand.clone(), self.controller.clone(), config).expect("a valid recording")
    }

    /// A planner as the one of the recorded run.
    pub fn planner(&self) -> DualStagePlanner {
        self.planner_with(|_| ())
    }
}

fn parse_row(t: f64, n: usize, m: usize, row: &[f64]) -> (Measurement, Reference) {
    let (q, row) = row.split_at(n * m);
    let (tau, row) = row.split_at(n * m);
    let (X_WO, row) = row.split_at(7);
    let (places, row) = row.split_at(3 * n);
    let (forces, row) = row.split_at(n);
    let (X_WD, twist) = row.split_at(7);
    let tactile = places.chunks_exact(3).zip(forces);
    let measurement = Measurement {
        t,
        q: DVector::from_column_slice(q),
        tau: DVector::from_column_slice(tau),
        X_WO: pose(X_WO),
        tactile: tactile.map(|(p, f_n)| Tactile { p_FC: Vector3::from_column_slice(p), f_n: *f_n }).collect(),
    };
    (measurement, Reference { X_WD: pose(X_WD), V_WD: Vector6::from_column_slice(twist) })
}

fn pose(x: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(x[3], x[4], x[5], x[6]));
    Isometry3::from_parts(Translation3::new(x[0], x[1], x[2]), rotation)
}
