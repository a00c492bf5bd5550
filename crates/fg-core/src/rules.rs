//! How the configuration follows from the grasp, where it is not stated: one table.
//!
//! The defaults are sizes for the paper's object, 0.5 kg and 25 mm from the middle of the grasp to each contact. Taken for
//! another object as they are, 2 mm of doubt is a twelfth of a cylinder that one holds and a fifth of a pen. At the first grasp
//! each default of the table is multiplied by the size of the grasp over the paper's, and by the weight over the paper's,
//! to the powers of its rule. What the configuration states is taken as it is.

use crate::config::Config;
use crate::grasp::Grasp;
use nalgebra::Vector3;

/// Distance of the paper's contacts from their middle, m.
const RADIUS: f64 = 0.025;
/// Weight of the paper's object, N.
const WEIGHT: f64 = 0.5 * 9.81;
/// Ratio of two neighbouring scales.
const STEP: f64 = 1.1;

/// The size of a grasp and the weight that it carries, over the paper's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Ratio of the contacts' mean distances from their middle.
    pub length: f64,
    /// Ratio of the weights.
    pub force: f64,
}

impl Scale {
    /// That of the present `grasp` under an object of `weight` newtons.
    pub fn of(grasp: &Grasp, weight: f64) -> Self {
        let n = grasp.contacts().len() as f64;
        let middle = grasp.contacts().iter().map(|contact| contact.p_WC).sum::<Vector3<f64>>() / n;
        let radius = grasp.contacts().iter().map(|contact| (contact.p_WC - middle).norm()).sum::<f64>() / n;
        Self { length: stepped(radius / RADIUS), force: stepped(weight / WEIGHT) }
    }
}

/// `ratio` in steps of a tenth of itself, since no default is known any better, and a grasp that is felt with noise is to
/// be driven as the same one without. Bounded to a tenth and ten times: a rule is no excuse for a limit of nothing.
fn stepped(ratio: f64) -> f64 {
    if ratio.is_finite() {
        STEP.powf((ratio.clamp(0.1, 10.0).ln() / STEP.ln()).round())
    } else {
        1.0
    }
}

/// One field that follows from the grasp.
pub struct Rule {
    /// The field's path in the JSON text.
    pub path: &'static str,
    value: fn(&mut Config) -> &mut f64,
    /// Powers of [`Scale::length`] and [`Scale::force`].
    pub powers: [i32; 2],
    /// Why.
    pub reason: &'static str,
}

macro_rules! rule {
    ($path:literal, |$c:ident| $field:expr, $powers:expr, $reason:literal) => {
        Rule { path: $path, value: |$c| &mut $field, powers: $powers, reason: $reason }
    };
}

/// Every rule.
pub const RULES: [Rule; 13] = [
    rule!(
        "/force/torque_length",
        |c| c.force.torque_length,
        [1, 0],
        "the arm that makes a force of a torque"
    ),
    rule!("/force/slip_speed", |c| c.force.slip_speed, [1, 0], "a share of the circumference in a second"),
    rule!(
        "/gait/approach_speed",
        |c| c.gait.approach_speed,
        [1, 0],
        "a finger strays in proportion to the object"
    ),
    rule!("/safety/stuck_distance", |c| c.safety.stuck_distance, [1, 0], "against the object"),
    rule!("/safety/lost_distance", |c| c.safety.lost_distance, [1, 0], "depth into the object's place"),
    rule!("/safety/pressing_distance", |c| c.safety.pressing_distance, [1, 0], "way to the object"),
    rule!(
        "/safety/relearn_distance",
        |c| c.safety.relearn_distance,
        [1, 0],
        "fingers roll by a share of the object"
    ),
    rule!("/safety/pose_arm", |c| c.safety.pose_arm, [1, 0], "the arm that makes a displacement of a turn"),
    rule!(
        "/safety/pose_jump/0",
        |c| c.safety.pose_jump[0],
        [1, 0],
        "what moves the contacts by as much as a turn"
    ),
    rule!("/safety/stale_motion/0", |c| c.safety.stale_motion[0], [1, 0], "as the pose's jump"),
    rule!("/safety/loaded_force", |c| c.safety.loaded_force, [0, 1], "a share of what each finger carries"),
    rule!("/safety/effort_margin", |c| c.safety.effort_margin, [0, 1], "a share of what each finger carries"),
    rule!("/safety/squeeze_force", |c| c.safety.squeeze_force, [0, 1], "a share of what each finger carries"),
];

/// Marks of the rules whose fields `json` states.
pub(crate) fn stated(json: &serde_json::Value) -> u32 {
    let marks = RULES.iter().enumerate().map(|(k, rule)| u32::from(json.pointer(rule.path).is_some()) << k);
    marks.fold(0, |all, mark| all | mark)
}

/// `config` for a grasp of this `scale`: every rule whose field is not stated.
pub fn fitted(config: &Config, scale: &Scale) -> Config {
    let mut fitted = config.clone();
    for (k, rule) in RULES.iter().enumerate().filter(|(k, _)| config.stated >> k & 1 == 0) {
        debug_assert!(k < 32);
        *(rule.value)(&mut fitted) *= scale.length.powi(rule.powers[0]) * scale.force.powi(rule.powers[1]);
    }
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stated_stays_and_the_rest_is_fitted() {
        let config =
            Config::from_json(r#"{"safety": {"lost_distance": 0.003, "pose_jump": [0.004, 0.2]}}"#).unwrap();
        let fitted = fitted(&config, &Scale { length: 2.0, force: 0.5 });
        assert!((fitted.safety.lost_distance - 0.003).abs() < 1e-15);
        assert!((fitted.safety.pose_jump[0] - 0.004).abs() < 1e-15);
        assert!((fitted.force.torque_length - 0.1).abs() < 1e-15);
        assert!((fitted.safety.squeeze_force - 0.5).abs() < 1e-15);
        assert_eq!(super::fitted(&config, &Scale { length: 1.0, force: 1.0 }), config);
    }

    #[test]
    fn every_rule_writes_the_field_that_it_names() {
        for rule in &RULES {
            let mut config = Config::default();
            *(rule.value)(&mut config) = 0.012_345;
            let json = serde_json::to_value(&config).unwrap();
            assert_eq!(json.pointer(rule.path), Some(&serde_json::json!(0.012_345)), "{}", rule.path);
        }
    }
}
