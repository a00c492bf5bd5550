//! The event that starts a gait, the choice of the free finger, and the phases of a gait.

use crate::config::GaitConfig;
use crate::gait::quality::{Quality, QualityModel};
use crate::grasp::{Grasp, Scene};
use crate::hand::HandModel;

/// What the hand does with its fingers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// All fingers hold the object.
    #[default]
    Hold,
    /// The free finger's force ramps down.
    Unload,
    /// The free finger slides to a better contact.
    Slide,
    /// The free finger has lost the surface, or has arrived, and presses until it feels it.
    Press,
    /// The free finger's force limit ramps up.
    Load,
}

impl Phase {
    /// The phase's name, in lower case.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Unload => "unload",
            Self::Slide => "slide",
            Self::Press => "press",
            Self::Load => "load",
        }
    }
}

/// Why the last gait ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GaitEnd {
    /// No gait has ended yet.
    #[default]
    None,
    /// Q-dot fell below delta.
    NoImprovement,
    /// Q rose above its threshold.
    Restored,
    /// The time limit.
    TimeOut,
    /// The remaining fingers could not hold the object.
    Abort,
    /// The free finger lost the object.
    LostContact,
}

/// Time that a finger must be off the object before it counts as lost, s.
const LOST_AFTER: f64 = 0.03;
/// Time without contact after which a sliding finger only looks for the surface, s.
const GIVE_UP_AFTER: f64 = 0.15;
/// Time that all fingers must touch before the grasp counts as static, s.
const STATIC_AFTER: f64 = 0.02;
/// Time after which refused fingers are asked again, s.
const ASK_AGAIN_AFTER: f64 = 0.02;

/// The gait's state machine.
#[derive(Debug, Clone)]
pub struct Supervisor {
    config: GaitConfig,
    dt: f64,
    phase: Phase,
    free: usize,
    /// Time in the present phase, s.
    elapsed: f64,
    /// Time in which all fingers have been in contact without a break, s.
    touching: f64,
    /// For each finger, the time without contact, s.
    off: Vec<f64>,
    /// Normal force of the free finger when its unloading began, N.
    f_start: f64,
    threshold: Option<f64>,
    refused: Vec<bool>,
    since_refusal: f64,
    /// Time without a gait for which Q has been below its threshold since the last gait that was not broken off, s.
    waiting: f64,
    /// How far Q is below its threshold.
    deficit: f64,
    end: GaitEnd,
    gaits: u64,
}

impl Supervisor {
    /// A supervisor for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &GaitConfig, dt: f64) -> Self {
        let n = hand.n_fingers();
        Self {
            config: config.clone(),
            dt,
            phase: Phase::Hold,
            free: 0,
            elapsed: 0.0,
            touching: 0.0,
            off: vec![0.0; n],
            f_start: 0.0,
            threshold: None,
            refused: vec![false; n],
            since_refusal: 0.0,
            waiting: 0.0,
            deficit: 0.0,
            end: GaitEnd::None,
            gaits: 0,
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.enter(Phase::Hold);
        self.touching = 0.0;
        self.off.fill(0.0);
        self.threshold = None;
        self.refused.fill(false);
        self.since_refusal = 0.0;
        self.waiting = 0.0;
        self.deficit = 0.0;
        self.end = GaitEnd::None;
        self.gaits = 0;
    }

    /// The present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The finger whose gait is under way.
    pub fn free_finger(&self) -> Option<usize> {
        (self.phase != Phase::Hold).then_some(self.free)
    }

    /// The finger that the velocity-force controller drives: off the force optimiser.
    pub fn sliding_finger(&self) -> Option<usize> {
        matches!(self.phase, Phase::Slide | Phase::Press).then_some(self.free)
    }

    /// delta_Q, once the first grasp is known.
    pub fn threshold(&self) -> Option<f64> {
        self.threshold
    }

    /// Number of gaits begun.
    pub fn gaits(&self) -> u64 {
        self.gaits
    }

    /// Why the last gait ended.
    pub fn last_end(&self) -> GaitEnd {
        self.end
    }

    /// Takes note of the contacts of this step; true at the one step at which the first grasp is complete.
    pub fn observe(&mut self, grasp: &Grasp) -> bool {
        self.elapsed += self.dt;
        self.since_refusal += self.dt;
        if self.since_refusal > ASK_AGAIN_AFTER {
            self.refused.fill(false);
        }
        for (off, contact) in self.off.iter_mut().zip(grasp.contacts()) {
            *off = if contact.touching { 0.0 } else { *off + self.dt };
        }
        let all = grasp.contacts().iter().all(|c| c.touching);
        self.touching = if all { self.touching + self.dt } else { 0.0 };
        self.threshold.is_none() && self.touching >= STATIC_AFTER
    }

    /// Sets delta_Q from the quality of the first grasp.
    pub fn set_threshold(&mut self, first: f64) {
        self.threshold = Some(first - self.config.threshold_margin);
    }

    /// Takes note of this step's quality; says nothing yet of whether a finger can be freed.
    pub fn await_gait(&mut self, Q: f64) {
        self.deficit = self.threshold.map_or(0.0, |threshold| threshold - Q);
        if !self.config.enabled || self.deficit <= 0.0 {
            self.waiting = 0.0;
        } else if self.phase == Phase::Hold {
            self.waiting += self.dt;
        }
    }

    /// The finger to free next, if the event of Section III-A has come: all fingertips in static contact and Q < delta_Q.
    ///
    /// The candidate has small manipulability and leaves a large remaining grasp; fingers that were refused a moment ago
    /// are passed over. `promises(k)` says whether freeing finger k can raise Q at all.
    pub fn candidate(
        &self,
        now: &Quality,
        quality: &QualityModel,
        scene: &Scene<'_>,
        mut promises: impl FnMut(usize) -> bool,
    ) -> Option<usize> {
        let event = self.config.enabled
            && self.phase == Phase::Hold
            && self.touching >= STATIC_AFTER
            && self.threshold.is_some_and(|threshold| now.Q < threshold);
        if !event {
            return None;
        }
        let score = |k: usize| {
            self.config.w1 * quality.remaining_quality(scene, k)
                - self.config.w2 * quality.manipulability(k, scene.q)
        };
        let mut best: Option<(usize, f64)> = None;
        for k in (0..self.off.len()).filter(|k| !self.refused[*k]) {
            let score = score(k);
            if best.is_none_or(|(_, other)| score > other) && promises(k) {
                best = Some((k, score));
            }
        }
        best.map(|(k, _)| k)
    }

    /// True where the grasp has grown bad and no finger could be freed for some time: turning on would lose the object.
    pub fn overdue(&self) -> bool {
        self.waiting > self.config.overdue_time && self.deficit > self.config.overdue_margin
    }

    /// Starts the gait of finger `k`.
    pub fn start(&mut self, k: usize, grasp: &Grasp) {
        self.free = k;
        self.f_start = grasp.contact(k).f_n;
        self.gaits += 1;
        self.enter(Phase::Unload);
    }

    /// Remembers that the other fingers cannot hold without finger `k`.
    pub fn refuse(&mut self, k: usize) {
        self.refused[k] = true;
        self.since_refusal = 0.0;
    }

    /// All fingers are off the object on purpose: none is lost, and no gait goes on.
    pub fn pause(&mut self) {
        if self.phase != Phase::Hold {
            self.enter(Phase::Hold);
        }
        self.touching = 0.0;
        self.waiting = 0.0;
        self.off.fill(0.0);
    }

    /// Ends a gait early: a finger that slides presses, one that is being unloaded is loaded again.
    pub fn abort(&mut self) {
        match self.phase {
            Phase::Unload => {
                self.end = GaitEnd::Abort;
                self.enter(Phase::Load);
            }
            Phase::Slide => {
                self.end = GaitEnd::Abort;
                self.enter(Phase::Press);
            }
            _ => {}
        }
    }

    /// Moves through the phases. `Q` and `Q_dot` are this step's quality and the last step's LP value; `overload` is the
    /// slack of the remaining fingers over its limit.
    pub fn advance(&mut self, grasp: &Grasp, Q: f64, Q_dot: f64, overload: f64) {
        let touching = grasp.contact(self.free).touching;
        match self.phase {
            Phase::Hold => {
                if let Some(k) = self.lost_finger(grasp) {
                    self.free = k;
                    self.enter(Phase::Press);
                }
            }
            Phase::Unload if self.elapsed >= self.config.unload_time => self.enter(Phase::Slide),
            Phase::Slide => {
                if let Some(end) = self.slide_end(Q, Q_dot, overload) {
                    self.end = end;
                    self.enter(Phase::Press);
                }
            }
            Phase::Press if touching => self.enter(Phase::Load),
            Phase::Load if self.elapsed >= self.config.load_time => {
                if self.end != GaitEnd::Abort {
                    self.waiting = 0.0;
                }
                self.enter(Phase::Hold);
            }
            _ => {}
        }
    }

    /// The largest normal force that finger `j` may be given at this step, N; zero takes it off the force optimiser.
    pub fn force_limit(&self, j: usize, f_n_max: f64) -> f64 {
        if self.phase == Phase::Hold || j != self.free {
            // A finger that feels nothing gets just enough to find the surface again.
            let lost = self.off[j] > LOST_AFTER;
            return if lost { self.config.f_des.min(f_n_max) } else { f_n_max };
        }
        let low = self.config.f_des.min(f_n_max);
        match self.phase {
            Phase::Unload => {
                let share = (self.elapsed / self.config.unload_time).min(1.0);
                (self.f_start + (low - self.f_start) * share).clamp(low, f_n_max)
            }
            Phase::Load => low + (f_n_max - low) * (self.elapsed / self.config.load_time).min(1.0),
            _ => 0.0,
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.elapsed = 0.0;
    }

    fn lost_finger(&self, grasp: &Grasp) -> Option<usize> {
        let lost = |j: &usize| self.off[*j] > LOST_AFTER;
        let holding = grasp.n_touching() >= 2;
        (0..self.off.len()).find(|j| self.threshold.is_some() && holding && lost(j))
    }

    fn slide_end(&self, Q: f64, Q_dot: f64, overload: f64) -> Option<GaitEnd> {
        if overload > self.config.abort_factor {
            return Some(GaitEnd::Abort);
        }
        if self.off[self.free] > GIVE_UP_AFTER {
            return Some(GaitEnd::LostContact);
        }
        if self.elapsed < self.config.min_slide_time {
            return None;
        }
        if Q_dot < self.config.delta {
            return Some(GaitEnd::NoImprovement);
        }
        if self.threshold.is_some_and(|threshold| Q > threshold + self.config.hysteresis) {
            return Some(GaitEnd::Restored);
        }
        (self.elapsed > self.config.max_slide_time).then_some(GaitEnd::TimeOut)
    }
}
