"""Faults that a scenario injects: `[[fault]]` with `kind`, `at`, `duration` and what that kind needs.

They act on the plant's sensors, motors and contacts, see `injection`; the controller is never touched.
"""

from typing import Annotated, Literal, get_args

from pydantic import Field

from fingergait.fields import Index, NonNegative, Positive, Table, Twist

Axis = Literal[0, 1, 2]

_EDGE = 1e-9  # s: a time that is this close to a fault's edge is on it


class FaultWindow(Table):
    """When a fault acts: from `at`, s, for `duration` seconds; absent: until the end of the run."""

    at: float
    duration: Positive | None = None

    def active(self, t: float) -> bool:
        """Whether the fault acts at time t, s."""
        end = float("inf") if self.duration is None else self.at + self.duration
        return self.at - _EDGE <= t < end - _EDGE


class SensorNan(FaultWindow):
    """A sensor gives NaN: that of one finger, of one joint, or the whole kind where these are absent."""

    kind: Literal["sensor_nan"] = "sensor_nan"
    sensor: Literal["encoder", "torque", "pose", "tactile"]
    finger: Index | None = None
    joint: Index | None = None


class PoseJump(FaultWindow):
    """The measured pose is off by `shift` [x, y, z, rx, ry, rz], m and rad, in W."""

    kind: Literal["pose_jump"] = "pose_jump"
    shift: Twist


class PoseStale(FaultWindow):
    """The measured pose stands still."""

    kind: Literal["pose_stale"] = "pose_stale"


class EncoderStuck(FaultWindow):
    """One joint's encoder stands still."""

    kind: Literal["encoder_stuck"] = "encoder_stuck"
    finger: Index
    joint: Index


class EncoderRange(FaultWindow):
    """One joint's encoder reads `value`, rad, which no joint reaches by default."""

    kind: Literal["encoder_range"] = "encoder_range"
    finger: Index
    joint: Index
    value: float = 10.0


class EncoderOffset(FaultWindow):
    """One joint's encoder is off by `shift`, rad, as after a slipped gear."""

    kind: Literal["encoder_offset"] = "encoder_offset"
    finger: Index
    joint: Index
    shift: float


class EncoderDropout(FaultWindow):
    """A read fails: in the share `share` of the control steps all joint angles are zero, at random."""

    kind: Literal["encoder_dropout"] = "encoder_dropout"
    share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2


class TactileLost(FaultWindow):
    """A tactile sensor feels nothing; all of them where `finger` is absent."""

    kind: Literal["tactile_lost"] = "tactile_lost"
    finger: Index | None = None


class TactileStuck(FaultWindow):
    """A tactile sensor reads the force `value`, N, full scale by default, at the place that it felt last."""

    kind: Literal["tactile_stuck"] = "tactile_stuck"
    finger: Index
    value: NonNegative = 30.0


class TactileScale(FaultWindow):
    """All tactile forces are `factor` times the true ones, as in another unit."""

    kind: Literal["tactile_scale"] = "tactile_scale"
    factor: Positive = 1000.0


class TactileAxes(FaultWindow):
    """The axes of all tactile places are in another `order`: [1, 0, 2] swaps the first two."""

    kind: Literal["tactile_axes"] = "tactile_axes"
    order: tuple[Axis, Axis, Axis] = (1, 0, 2)


class ClockStall(FaultWindow):
    """The measurement's time stands still."""

    kind: Literal["clock_stall"] = "clock_stall"


class ClockJump(FaultWindow):
    """The measurement's time is off by `shift`, s, of either sign; at the end it jumps back."""

    kind: Literal["clock_jump"] = "clock_jump"
    shift: float


class DroppedTicks(FaultWindow):
    """Every `every` control steps the controller misses `ticks` in a row; the last command goes on meanwhile."""

    kind: Literal["dropped_ticks"] = "dropped_ticks"
    ticks: Annotated[int, Field(ge=1)] = 5
    every: Annotated[int, Field(ge=1)] = 50


class FingerPowerLoss(FaultWindow):
    """A finger's motors give no torque; only one joint's where `joint` is given."""

    kind: Literal["finger_power_loss"] = "finger_power_loss"
    finger: Index
    joint: Index | None = None


class MotorWeak(FaultWindow):
    """Motors reach only `scale` times their torque; those of one finger, or all where `finger` is absent."""

    kind: Literal["motor_weak"] = "motor_weak"
    scale: Annotated[float, Field(ge=0.0, lt=1.0)]
    finger: Index | None = None


class JointOrderSwapped(FaultWindow):
    """Two joints of a finger, `joint` and `other`, are swapped in angles, torques and commands alike."""

    kind: Literal["joint_order_swapped"] = "joint_order_swapped"
    finger: Index
    joint: Index
    other: Index


class FrictionDrop(FaultWindow):
    """The friction of every contact of the object is `scale` times the true one."""

    kind: Literal["friction_drop"] = "friction_drop"
    scale: Annotated[float, Field(gt=0.0)] = 0.5


class ReferenceNan(FaultWindow):
    """The reference that the controller is given is NaN."""

    kind: Literal["reference_nan"] = "reference_nan"


class ObjectPulled(FaultWindow):
    """Somebody takes the object away: `force`, N, in W, at the centre of mass."""

    kind: Literal["object_pulled"] = "object_pulled"
    force: tuple[float, float, float] = (0.0, 0.0, 60.0)


Fault = Annotated[
    SensorNan
    | PoseJump
    | PoseStale
    | EncoderStuck
    | EncoderRange
    | EncoderOffset
    | EncoderDropout
    | TactileLost
    | TactileStuck
    | TactileScale
    | TactileAxes
    | ClockStall
    | ClockJump
    | DroppedTicks
    | FingerPowerLoss
    | MotorWeak
    | JointOrderSwapped
    | FrictionDrop
    | ReferenceNan
    | ObjectPulled,
    Field(discriminator="kind"),
]

KINDS: dict[str, type[FaultWindow]] = {kind.model_fields["kind"].default: kind for kind in get_args(get_args(Fault)[0])}
"""The table of each kind of fault."""
