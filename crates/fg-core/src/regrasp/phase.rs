//! The phases of regrasping.

/// What the hand does with the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// Regrasping has not begun: the desired motion is what is asked.
    #[default]
    Idle,
    /// The object is turned in the air.
    Turn,
    /// The turn comes to rest.
    Brake,
    /// The object goes down.
    Lower,
    /// It lies; the fingers let go.
    Release,
    /// The fingers go round it to where the next grasp begins.
    Return,
    /// They come in until they feel it.
    Approach,
    /// They press.
    Preload,
    /// They take the weight, as far as the force optimiser can.
    Check,
    /// The object goes up.
    Lift,
    /// No support was found: the object is held in the air, and stands.
    Stand,
    /// Too many grasps have failed: the object lies, and the fingers keep clear of it.
    Rest,
}

impl Phase {
    /// Every phase, in order of its number.
    pub const ALL: [Self; 12] = [
        Self::Idle,
        Self::Turn,
        Self::Brake,
        Self::Lower,
        Self::Release,
        Self::Return,
        Self::Approach,
        Self::Preload,
        Self::Check,
        Self::Lift,
        Self::Stand,
        Self::Rest,
    ];

    /// The phase's name, in lower case.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Turn => "turn",
            Self::Brake => "brake",
            Self::Lower => "lower",
            Self::Release => "release",
            Self::Return => "return",
            Self::Approach => "approach",
            Self::Preload => "preload",
            Self::Check => "check",
            Self::Lift => "lift",
            Self::Stand => "stand",
            Self::Rest => "rest",
        }
    }

    /// True where the fingers are off the object, or on their way.
    pub fn is_open(self) -> bool {
        matches!(self, Self::Return | Self::Approach | Self::Rest)
    }

    /// True where the support carries the object, or part of it.
    pub fn lies(self) -> bool {
        self.is_open() || matches!(self, Self::Release | Self::Preload | Self::Check)
    }
}
