"""The compiled control step. Arrays are float64; units are SI and radians; quaternions are wxyz."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

__version__: str

class FingergaitError(Exception):
    """Base of every error that fingergait raises on purpose."""

class ConfigError(FingergaitError, ValueError):
    """A configuration, hand or scenario value is out of range: names the field, what was expected and found."""

class ShapeError(FingergaitError, ValueError):
    """An array has the wrong length or shape."""

class ArtifactError(FingergaitError, ValueError):
    """A controller artefact is missing, corrupt or inconsistent."""

@final
class HandModel:
    """Kinematics of a hand, from the JSON that `fingergait.hand` derives from an MJCF."""

    def __new__(cls, spec: str) -> HandModel: ...
    @property
    def n_fingers(self) -> int: ...
    @property
    def n_q(self) -> int:
        """Independent joints of all fingers: those that follow no other."""
    @property
    def n_joints(self) -> Any:
        """Independent joints of one finger: an int where all fingers have as many, else a list of one for each."""
    def joints(self, finger: int) -> slice:
        """Where the independent joints of `finger` are in a flat array (n_q,)."""
    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper limits, rad, narrowed so that joints that follow stay in theirs; shapes as of `tau_min`."""
    @property
    def tau_min(self) -> Array:
        """Least torques that the model states, N m, NaN where it states none: (n_fingers, n_joints) where all fingers
        have as many joints, else (n_q,). So are all arrays over the joints; (n_q,) is always taken."""
    @property
    def tau_max(self) -> Array:
        """Largest torques that the model states, N m, NaN where it states none."""
    @property
    def reference(self) -> Array:
        """The posture that the joints should return to, rad."""
    @property
    def gravity(self) -> Array:
        """Acceleration of gravity in W, (3,), m/s^2."""
    def tip_positions(self, q: ArrayLike) -> Array:
        """Centres of the fingertips in W, (n_fingers, 3), at joint angles q, rad."""
    def jacobian(self, q: ArrayLike, finger: int, point: ArrayLike) -> Array:
        """Velocity Jacobian (3, n_joints) in W of the point of the last link now at `point` (3,) in W, m/rad."""
    def gravity_torque(self, q: ArrayLike) -> Array:
        """Torques that hold the fingers' own weight, N m."""
    def spring_torque(self, q: ArrayLike) -> Array:
        """Torques that hold the joints' springs, N m."""

@final
class Controller:
    """A robust controller read from a controller artefact (JSON text)."""

    def __new__(cls, artefact: str) -> Controller: ...
    @property
    def kind(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def sample_time(self) -> float: ...
    @property
    def mass(self) -> float: ...
    @property
    def inertia(self) -> Array: ...
    def simulate(self, e: ArrayLike) -> Array:
        """Open-loop response u (T, 6) of K from rest to the error sequence e (T, 6), without saturation."""

@final
class Measurement:
    """What the sensors say at one instant: no velocity, no mass, no mesh."""

    def __new__(
        cls,
        t: float,
        q: ArrayLike,
        tau: ArrayLike,
        pose: ArrayLike,
        contact_place: ArrayLike,
        contact_force: ArrayLike,
    ) -> Measurement:
        """t in s; q, tau (n_fingers, n_joints) or (n_q,); pose (7,): position and wxyz quaternion of O in W;
        contact_place (n_fingers, 3): tactile contact in the fingertip frame F, m; contact_force (n_fingers,): normal
        force, N, zero where there is no contact."""

@final
class Reference:
    """Desired object pose (7,) in W, with the desired twist (6,) [linear; angular] in W, zero by default."""

    def __new__(cls, pose: ArrayLike, twist: ArrayLike | None = None) -> Reference: ...

@final
class Command:
    @property
    def tau(self) -> Array:
        """Desired joint torques, N m: (n_fingers, n_joints) where all fingers have as many joints, else (n_q,)."""

@final
class Diagnostics:
    """What the step decided and why."""

    @property
    def mode(self) -> str: ...
    @property
    def phase(self) -> str:
        """Phase of the gait: "hold", "unload", "slide", "press" or "load"."""
    @property
    def quality(self) -> float:
        """Grasp quality Q, eq. (1)."""
    @property
    def free_finger(self) -> int | None: ...
    @property
    def status(self) -> str: ...
    @property
    def solver(self) -> str: ...
    @property
    def solver_counts(self) -> dict[str, int]:
        """Answers of each solver since the start, and how often and why one passed the QP on to the next."""
    @property
    def safe_mode(self) -> str:
        """How the hand was driven: "normal", "hold", "squeeze", "damp" or "stop"."""
    @property
    def faults(self) -> list[str]:
        """What was wrong with this step, by name; empty when all was well."""
    @property
    def step_ns(self) -> int:
        """Thread CPU time of this control step inside the compiled core, ns."""
    @property
    def step_allocations(self) -> int:
        """Heap allocations of this control step inside the compiled core."""
    @staticmethod
    def fault_names() -> list[str]:
        """Names of all faults: that of number k is bit k of the column `faults` of a log."""
    @staticmethod
    def safe_mode_names() -> list[str]:
        """Names of all modes, from the mildest on: that of number k is k in the column `safe_mode` of a log."""
    @staticmethod
    def columns(n_fingers: int, n_joints: int | Sequence[int]) -> list[str]:
        """Names of the numbers that `row` gives, in order. `n_joints` is that of each finger, or one number for all."""
    def row(self) -> Array:
        """Every figure of this step as one row, for a log. Deterministic: holds no time measurement."""

@final
class DualStagePlanner:
    """The whole control step: grasp quality, gait planner, robust controller, force optimiser."""

    def __new__(cls, hand: HandModel, controller: Controller, config: str | None = None) -> DualStagePlanner:
        """`config` is JSON; fields that are absent keep their defaults, unknown fields are refused."""
    @property
    def config(self) -> dict[str, Any]: ...
    def step(self, measurement: Measurement, reference: Reference) -> tuple[Command, Diagnostics]: ...
    def reset(self) -> None: ...

@final
class TorquePid:
    """Joint torque tracking at the faster torque rate."""

    def __new__(
        cls,
        n_joints_total: int,
        dt: float,
        config: str | None = None,
        tau_min: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> TorquePid:
        """tau_min, tau_max (n_joints_total,) in any shape: limits of the joints, N m, neither beyond `force.tau_max` of
        `config`, which is the limit where they are absent; without a `config` that is 0.5 N m, of the paper's hand."""
    def step(self, tau_des: ArrayLike, tau: ArrayLike) -> Array:
        """Motor torques that drive the measured torques `tau` to `tau_des`; same shape as `tau_des`."""
    def reset(self) -> None: ...

@final
class ForceSolution:
    @property
    def f(self) -> Array: ...
    @property
    def tau(self) -> Array: ...
    @property
    def psi(self) -> Array: ...
    @property
    def status(self) -> str: ...
    @property
    def solver(self) -> str: ...
    @property
    def kkt(self) -> float: ...
    @property
    def solve_ns(self) -> int: ...
    @property
    def solve_allocations(self) -> int:
        """Heap allocations of the solve."""

@final
class ForceOptimizer:
    """The force optimisation QP, eq. (8)."""

    def __new__(cls, edges: ArrayLike, alpha: ArrayLike, solver: str = "active_set") -> ForceOptimizer:
        """edges (n, 3, m): pyramid edges of each contact in its contact frame; alpha (3,). `solver` is "active_set"
        (clarabel on doubt) or "clarabel"."""
    def solve(
        self,
        G: ArrayLike,
        J: ArrayLike,
        F_des: ArrayLike,
        f_prev: ArrayLike,
        tau_min: ArrayLike,
        tau_max: ArrayLike,
        f_normal_max: ArrayLike | None = None,
    ) -> ForceSolution:
        """G (6, 3n), J (3n, n_q) with tau = J^T f, F_des (6,), f_prev (3n,), tau bounds (n_q,), f_normal_max (n,)."""

@final
class LpSolution:
    @property
    def x(self) -> Array: ...
    @property
    def value(self) -> float: ...
    @property
    def feasible(self) -> bool: ...

def gait_lp(c: ArrayLike, a: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> LpSolution:
    """max c.x subject to a.x = 0 and lower <= x <= upper, exactly, eq. (4)."""

def default_config() -> dict[str, Any]:
    """The default `Config`: the paper's parameter list."""
