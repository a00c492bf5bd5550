//! When gaits must begin so that no finger's reserve runs out, and in which order: earliest deadline, and rounds.
//!
//! With the reserves sorted, `T_(1) <= T_(2) <= ..`, the k-th finger to go can begin once the k - 1 before it are back:
//! the slack of the schedule is the least of `T_(k) - (k - 1) g` over k, less the time in which a finger is unloaded, with g
//! the learnt time of a gait. Where it is used up a round begins: each finger that has gone some way goes home once, the
//! hardest to spare first, because later it is harder still.

use crate::config::GaitConfig;
use crate::hand::HandModel;
use serde::{Deserialize, Serialize};

/// What starts a gait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GaitEvent {
    /// The paper's: Q of the whole hand below delta_Q. The finger follows the gradient of Q.
    Quality,
    /// The fingers' reserves. The finger goes home.
    Reserve,
    /// Whichever comes first.
    Both,
}

/// A round begins where the slack is below this, s.
const LEAD: f64 = 0.5;
/// Fingers that have gone this share of the contacts' radius are worth a gait.
const WORTH: f64 = 0.17;
/// Whether the others can hold without a finger is believed for this long, s.
const FRESH: f64 = 0.1;
/// Share of a new gait's time in the learnt one.
const LEARN: f64 = 0.2;
/// The others' load, as a share of what a gait allows, beyond which a finger cannot be spared.
const SPARED: f64 = 1.0;

/// What is known of one finger.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    /// It goes home in this round.
    due: bool,
    /// What the others fail to deliver without it, by what a gait allows.
    load: f64,
    /// Time since that was computed, s.
    age: f64,
}

/// Decides whether a gait is due, and whose. Allocated once.
#[derive(Debug, Clone)]
pub struct Schedule {
    dt: f64,
    unload_time: f64,
    /// Learnt time of a gait, s.
    gait_time: f64,
    /// Time in the present gait, s.
    running: Option<f64>,
    candidates: Vec<Candidate>,
    /// Slack of the schedule, s.
    slack: f64,
    /// Time for which a round has waited for a finger that can be spared, s.
    waiting: f64,
}

impl Schedule {
    /// A schedule for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &GaitConfig, dt: f64) -> Self {
        let none = Candidate { due: false, load: f64::INFINITY, age: f64::INFINITY };
        Self {
            dt,
            unload_time: config.unload_time,
            gait_time: config.unload_time + config.load_time + 4.0 * config.min_slide_time,
            running: None,
            candidates: vec![none; hand.n_fingers()],
            slack: f64::INFINITY,
            waiting: 0.0,
        }
    }

    /// Forgets the past, but for the time that gaits take.
    pub fn reset(&mut self) {
        self.running = None;
        self.candidates.fill(Candidate { due: false, load: f64::INFINITY, age: f64::INFINITY });
        self.slack = f64::INFINITY;
        self.waiting = 0.0;
    }

    /// Slack of the schedule, s: below zero some finger runs out before its turn comes.
    pub fn slack(&self) -> f64 {
        self.slack
    }

    /// Learnt time of a gait, s.
    pub fn gait_time(&self) -> f64 {
        self.gait_time
    }

    /// Time from one gait of a finger to its next where gaits follow each other without a break, s.
    pub fn round_time(&self) -> f64 {
        self.gait_time * self.candidates.len() as f64
    }

    /// Time for which a round has waited for a finger that can be spared, s.
    pub fn waiting(&self) -> f64 {
        self.waiting
    }

    /// True where a round is under way.
    pub fn in_round(&self) -> bool {
        self.candidates.iter().any(|candidate| candidate.due)
    }

    /// Takes note of the fingers' reserves, s, and of how far they have gone, in contact radii; `free` is the finger whose gait
    /// is under way.
    pub fn update(
        &mut self,
        seconds: impl Fn(usize) -> f64,
        gone: impl Fn(usize) -> f64,
        free: Option<usize>,
    ) {
        let n = self.candidates.len();
        for candidate in &mut self.candidates {
            candidate.age += self.dt;
        }
        let mut sorted = [f64::INFINITY; HandModel::MAX_FINGERS];
        for (j, T) in sorted[..n].iter_mut().enumerate().filter(|(j, _)| Some(*j) != free) {
            // A finger with little reserve at home is no reason to hurry: no gait gives it more.
            let known = seconds(j);
            let helps = known > self.gait_time || gone(j) > 0.5 * WORTH;
            *T = if helps { known } else { f64::INFINITY };
        }
        sorted[..n].sort_by(f64::total_cmp);
        // The finger that is on its way now is not back yet.
        let busy = self.running.map_or(0.0, |time| (self.gait_time - time).max(0.0));
        let slack = |(k, T): (usize, &f64)| T - k as f64 * self.gait_time - busy;
        self.slack =
            sorted[..n].iter().enumerate().map(slack).fold(f64::INFINITY, f64::min) - self.unload_time;
        // A round that waits takes in fingers that are worth a gait by now: with them home another may be easier to spare.
        if self.slack < LEAD && (!self.in_round() || self.waiting > FRESH) {
            for (j, candidate) in self.candidates.iter_mut().enumerate() {
                candidate.due |= Some(j) != free && gone(j) > WORTH;
            }
        }
        match (&mut self.running, free) {
            (Some(time), Some(_)) => *time += self.dt,
            (running, None) => *running = None,
            (None, Some(_)) => {}
        }
        let waits = self.in_round() && free.is_none();
        self.waiting = if waits { self.waiting + self.dt } else { 0.0 };
    }

    /// The finger of which it must be known next whether the others can hold without it.
    pub fn asks(&self) -> Option<usize> {
        let stale = |j: &usize| self.candidates[*j].due && self.candidates[*j].age > FRESH;
        (0..self.candidates.len())
            .filter(stale)
            .max_by(|a, b| self.candidates[*a].age.total_cmp(&self.candidates[*b].age))
    }

    /// Takes note of what the others fail to deliver without finger `j`, by what a gait allows.
    pub fn answer(&mut self, j: usize, load: f64) {
        self.candidates[j].load = load;
        self.candidates[j].age = 0.0;
    }

    /// The finger to free next: of those that are due and can be spared, the hardest to spare, but before it one that would run
    /// out meanwhile.
    pub fn choice(&self, seconds: impl Fn(usize) -> f64) -> Option<usize> {
        if self.asks().is_some() {
            return None;
        }
        let able = |j: &usize| self.candidates[*j].due && self.candidates[*j].load <= SPARED;
        let urgent = (0..self.candidates.len())
            .filter(|j| able(j) && seconds(*j) < self.gait_time + self.unload_time)
            .min_by(|a, b| seconds(*a).total_cmp(&seconds(*b)));
        let hardest = || {
            let by_load =
                |a: &usize, b: &usize| self.candidates[*a].load.total_cmp(&self.candidates[*b].load);
            (0..self.candidates.len()).filter(able).max_by(by_load)
        };
        urgent.or_else(hardest)
    }

    /// The gait of finger `j` begins.
    pub fn start(&mut self, j: usize) {
        self.running = Some(0.0);
        self.candidates[j].due = false;
        self.waiting = 0.0;
    }

    /// A gait has ended; its time is learnt where it was not `broken` off.
    pub fn end(&mut self, broken: bool) {
        if let Some(time) = self.running.take().filter(|_| !broken) {
            self.gait_time += LEARN * (time - self.gait_time);
        }
    }
}
