"""The compiled control step. Arrays are float64; units are SI and radians; quaternions are wxyz."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]

__all__ = [
    "ArtifactError",
    "Command",
    "ConfigError",
    "Controller",
    "Diagnostics",
    "DualStagePlanner",
    "FingergaitError",
    "ForceOptimizer",
    "ForceSolution",
    "HandModel",
    "LpSolution",
    "Measurement",
    "Reference",
    "ShapeError",
    "TorquePid",
    "__version__",
    "default_config",
    "gait_lp",
]

__version__: str

class FingergaitError(Exception):
    """Base of every error that fingergait raises on purpose: names the field, what was expected and found."""

class ConfigError(FingergaitError, ValueError):
    """A configuration, hand or scenario value is out of range."""

class ShapeError(FingergaitError, ValueError):
    """An array has the wrong length or shape."""

class ArtifactError(FingergaitError, ValueError):
    """A controller artefact is missing, corrupt or inconsistent."""

@final
class HandModel:
    """Kinematics and weight of a hand, from its JSON text.

    Two to six fingers of one to seven independent joints each, fixed in W. The text's format is in ARCHITECTURE.md
    ("Hand model"); `fingergait.hand_json` makes it from an MJCF or URDF.

    Parameters
    ----------
    spec
        JSON text; lengths in m, masses in kg, angles in rad, quaternions wxyz.

    Raises
    ------
    ConfigError
        A field that is missing, unknown, not finite or out of range; names it.
    """

    def __new__(cls, spec: str) -> HandModel: ...
    @property
    def n_fingers(self) -> int:
        """Number of fingers."""
    @property
    def n_q(self) -> int:
        """Independent joints of all fingers: those that follow no other."""
    @property
    def n_joints(self) -> Any:
        """Independent joints of one finger: an int where all fingers have as many, else a list of one for each."""
    def joints(self, finger: int) -> slice:
        """Where the independent joints of `finger` are in a flat array (n_q,).

        Raises
        ------
        ConfigError
            If there is no such finger.
        """
    @property
    def limits(self) -> tuple[_Array, _Array]:
        """Lower and upper limits, rad, narrowed so that joints that follow stay in theirs; shapes as of `tau_min`."""
    @property
    def tau_min(self) -> _Array:
        """Least torques that the model states, N m, NaN where it states none: (n_fingers, n_joints) where all fingers
        have as many joints, else (n_q,). So are all arrays over the joints; (n_q,) is always taken."""
    @property
    def tau_max(self) -> _Array:
        """Largest torques that the model states, N m, NaN where it states none; shape as of `tau_min`."""
    @property
    def reference(self) -> _Array:
        """The posture that the joints should return to, rad; shape as of `tau_min`."""
    @property
    def gravity(self) -> _Array:
        """Acceleration of gravity in W, (3,), m/s^2."""
    def tip_positions(self, q: ArrayLike) -> _Array:
        """Centres of the fingertips in W, (n_fingers, 3), m, at joint angles q, rad, shaped as `tau_min`.

        Raises
        ------
        ShapeError
            If q has another number of joints.
        """
    def jacobian(self, q: ArrayLike, finger: int, point: ArrayLike) -> _Array:
        """Velocity Jacobian in W of a point of a finger's last link, (3, joints of the finger), m/rad: v = J qd.

        Parameters
        ----------
        q
            Joint angles, rad, shaped as `tau_min`.
        finger
            Index of the finger.
        point
            Where the point is now, (3,) in W, m.

        Raises
        ------
        ConfigError
            If there is no such finger.
        ShapeError
            If q or point has another shape.
        """
    def gravity_torque(self, q: ArrayLike) -> _Array:
        """Torques, N m, that hold the fingers' own weight at joint angles q, rad; both shaped as `tau_min`.

        Raises
        ------
        ShapeError
            If q has another number of joints.
        """
    def spring_torque(self, q: ArrayLike) -> _Array:
        """Torques that hold the joints' springs, N m."""

@final
class Controller:
    """A robust controller K, eqs. (6) and (7), from the JSON text of a controller artefact.

    K maps the pose error e = [p_D - p_O; log(R_D R_O^T)] in W, m and rad, to an acceleration u, m/s^2 and rad/s^2. The
    format is in ARCHITECTURE.md ("Controller artefact"); `fingergait synthesize` writes such files.

    Parameters
    ----------
    artefact
        JSON text.

    Raises
    ------
    ArtifactError
        A field that is missing, unknown, of the wrong size or not finite; names it.
    """

    def __new__(cls, artefact: str) -> Controller: ...
    @property
    def kind(self) -> str:
        """ "mu-synthesis" or "hand-tuned"."""
    @property
    def description(self) -> str:
        """The artefact's line for people."""
    @property
    def sample_time(self) -> float:
        """Sample time that K was discretised for, s; the control rate has to fit."""
    @property
    def mass(self) -> float:
        """Nominal mass of the object, kg, that K was designed with."""
    @property
    def inertia(self) -> _Array:
        """Nominal principal moments of inertia (3,), kg m^2, that K was designed with."""
    def simulate(self, e: ArrayLike) -> _Array:
        """Open-loop response u (T, 6), m/s^2 and rad/s^2, of K from rest to errors e (T, 6), m and rad, unsaturated.

        Raises
        ------
        ShapeError
            If e has another shape.
        """

@final
class Measurement:
    """What the sensors say at one instant. No velocity, mass, friction or mesh: there is no field for them.

    Parameters
    ----------
    t
        Time, s.
    q, tau
        Joint angles, rad, and measured joint torques, N m, each (n_fingers, n_joints) where all fingers have as many
        joints, or (n_q,).
    pose
        Pose (7,) of the object O in W: position, m, and quaternion wxyz. NaN says that none was seen.
    contact_place
        Where each tip is touched, (n_fingers, 3), m, in its fingertip frame F; anything where it is not.
    contact_force
        Force along each tip's normal, (n_fingers,), N; zero without contact.

    Raises
    ------
    ShapeError
        Arrays whose shapes do not fit each other. Numbers that are not finite are no error: the step judges them.
    """

    def __new__(
        cls,
        t: float,
        q: ArrayLike,
        tau: ArrayLike,
        pose: ArrayLike,
        contact_place: ArrayLike,
        contact_force: ArrayLike,
    ) -> Measurement: ...

@final
class Reference:
    """The desired motion of the object at one instant.

    Parameters
    ----------
    pose
        Desired pose (7,) of the object in W: position, m, and quaternion wxyz.
    twist
        Desired twist (6,), [linear; angular] in W, m/s and rad/s; zero where it is absent.

    Raises
    ------
    ShapeError
        If an array has another length.
    ConfigError
        If the quaternion is far from a unit one.
    """

    def __new__(cls, pose: ArrayLike, twist: ArrayLike | None = None) -> Reference: ...

@final
class Command:
    """The joint torques to track until the next step."""

    @property
    def tau(self) -> _Array:
        """Desired joint torques, N m: (n_fingers, n_joints) where all fingers have as many joints, else (n_q,). Finite
        and within the limits, whatever was measured."""

@final
class Diagnostics:
    """What a control step decided, and why.

    `row` and `columns` have all figures; the properties are those that programs ask for most.
    """

    @property
    def mode(self) -> str:
        """ "gait" while a finger is on its way, else "hold"."""
    @property
    def phase(self) -> str:
        """Phase of the gait: "hold", "unload", "slide", "press" or "load"."""
    @property
    def regrasp(self) -> str:
        """Phase of regrasping: "idle" until it begins, then "turn", "brake", "lower", and so on."""
    @staticmethod
    def regrasp_phase_names() -> list[str]:
        """Names of the phases of regrasping: that of number k is k in the column `regrasp` of a log."""
    @property
    def governed(self) -> _Array:
        """Pose (7,) in W that the object is to have now: what is asked, less what was missed while it lay."""
    @property
    def quality(self) -> float:
        """Grasp quality Q, eq. (1), dimensionless."""
    @property
    def free_finger(self) -> int | None:
        """Index of the finger whose gait is under way; None while all hold."""
    @property
    def status(self) -> str:
        """Whether the contact forces, eq. (8), are certified optimal: "solved", else "held"."""
    @property
    def solver(self) -> str:
        """Who found the contact forces: "active_set", "clarabel_polished", "clarabel" or "held"."""
    @property
    def solver_counts(self) -> dict[str, int]:
        """Answers of each solver since the start, and how often and why one passed the QP on to the next."""
    @property
    def safe_mode(self) -> str:
        """How the hand was driven: "normal", "hold", "squeeze", "damp" or "stop", see docs/safety.md."""
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
    def row(self) -> _Array:
        """Every figure of this step as one row, for a log: SI units. Deterministic, holds no time measurement."""

@final
class DualStagePlanner:
    """The whole control step, Section II: grasp quality, gait planner, robust controller, force optimiser.

    Parameters
    ----------
    hand
        The hand.
    controller
        K, for the configured control rate.
    config
        JSON text of a `Config`; fields that are absent keep their defaults, see `default_config`.

    Raises
    ------
    ConfigError
        A field that is unknown or out of range; names it, what was expected and what was found.
    ArtifactError
        A controller for another control rate.
    """

    def __new__(cls, hand: HandModel, controller: Controller, config: str | None = None) -> DualStagePlanner: ...
    @property
    def config(self) -> dict[str, Any]:
        """The configuration in use, with every default filled in."""
    def step(self, measurement: Measurement, reference: Reference) -> tuple[Command, Diagnostics]:
        """The torques to track until the next step, and what was decided.

        Call it once a control period. It allocates nothing on its fast path and releases the GIL. Faults of sensors,
        clock and solvers are no errors: they are in the diagnostics, and the command is safe.

        Raises
        ------
        ShapeError
            If the measurement is of another hand; nothing has changed then.
        """
    def reset(self) -> None:
        """Returns to the state after construction."""

@final
class TorquePid:
    """Joint torque tracking at the faster torque rate, Section II: PID with feedforward and anti-windup.

    Parameters
    ----------
    n_joints_total
        Joints of the whole hand.
    dt
        Period of the torque loop, s.
    config
        JSON text of a `Config`, of which `torque` and `force` count; absent: the defaults, and for joints without
        limits the 0.5 N m of the paper's hand.
    tau_min, tau_max
        Torque limits (n_joints_total,) in any shape, N m, neither beyond `force.tau_max` of `config`, which is the
        limit where they are absent.

    Raises
    ------
    ConfigError
        A field that is unknown or out of range, or a joint without limits.
    ShapeError
        If the limits are of another number of joints.
    """

    def __new__(
        cls,
        n_joints_total: int,
        dt: float,
        config: str | None = None,
        tau_min: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> TorquePid: ...
    def step(self, tau_des: ArrayLike, tau: ArrayLike) -> _Array:
        """Motor torques, N m, that drive the measured torques `tau` to `tau_des`; all three of the same shape.

        Raises
        ------
        ShapeError
            If an array has another number of joints.
        """
    def reset(self) -> None:
        """Forgets the past."""

@final
class ForceSolution:
    """Contact forces, torques and how good they are: the answer of `ForceOptimizer.solve`."""

    @property
    def f(self) -> _Array:
        """Contact forces (3n,), N, each in its contact frame."""
    @property
    def tau(self) -> _Array:
        """Joint torques J^T f, (n_q,), N m."""
    @property
    def psi(self) -> _Array:
        """Wrench (6,) that is not delivered: Psi = F_des - G f, N and N m, in W."""
    @property
    def status(self) -> str:
        """Whether the forces are certified optimal: "solved", else "held": the last ones, made feasible."""
    @property
    def solver(self) -> str:
        """Who found them: "active_set", "clarabel_polished", "clarabel" or "held"."""
    @property
    def kkt(self) -> float:
        """Residual of the optimality (KKT) conditions, N; of held forces too, then never zero: their worst violation
        of a bound or their distance from a minimiser, whichever is larger."""
    @property
    def solve_ns(self) -> int:
        """Thread CPU time of the solve, ns."""
    @property
    def solve_allocations(self) -> int:
        """Heap allocations of the solve."""

@final
class ForceOptimizer:
    """The force optimisation QP, eq. (8), with a certificate on each answer.

        min  alpha_1 |f|^2 + alpha_2 |f - f_prev|^2 + alpha_3 |Psi|^2
        with Psi = F_des - G f, f in the friction pyramids, tau_min <= J^T f <= tau_max

    Parameters
    ----------
    edges
        Pyramid edges (n, 3, m) of each contact in its contact frame, z along the normal into the object; m 3 to 12.
    alpha
        The three weights (3,). In Psi, torques count over a length, `force.torque_length` of the configuration.
    solver
        "active_set", with clarabel where its answer is not certified, or "clarabel".

    Raises
    ------
    ConfigError
        Edges that span no pyramid, weights out of range, or an unknown solver.
    ShapeError
        If an array has another shape.
    """

    def __new__(cls, edges: ArrayLike, alpha: ArrayLike, solver: str = "active_set") -> ForceOptimizer: ...
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
        """The best contact forces for a wrench; warm-started from the call before.

        Parameters
        ----------
        G
            Grasp map (6, 3n): the wrench on the object at Oo in W is G f.
        J
            Hand Jacobian (3n, n_q), with tau = J^T f.
        F_des
            Wrench asked for, (6,), N and N m, in W.
        f_prev
            Contact forces of the step before, (3n,), N.
        tau_min, tau_max
            Torque limits (n_q,), N m.
        f_normal_max
            Largest normal forces (n,), N; zero takes a finger out. Absent: no limit.

        Raises
        ------
        ShapeError
            If an array has another shape.
        ConfigError
            A number that is not finite, or limits that exclude zero torque.
        """

@final
class LpSolution:
    """The answer of `gait_lp`."""

    @property
    def x(self) -> _Array:
        """The maximiser (n,); zero where there is none."""
    @property
    def value(self) -> float:
        """The value c . x reached."""
    @property
    def feasible(self) -> bool:
        """False where no x in the box has a . x = 0."""

def gait_lp(c: ArrayLike, a: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> LpSolution:
    """The gait LP, eq. (4): max c . x subject to a . x = 0 and lower <= x <= upper, solved exactly.

    In the planner x is the free finger's joint velocity, rad/s, c the quality's rate coefficients (3), and a the
    surface's normal through the Jacobian (4c).

    Parameters
    ----------
    c, a, lower, upper
        Vectors (n,), all of one length.

    Raises
    ------
    ShapeError
        If the lengths differ.
    ConfigError
        A number that is not finite, or a lower bound above its upper one.
    """

def default_config() -> dict[str, Any]:
    """The default `Config`: the paper's parameters, Section V-B; each departure is documented in `fg_core::config`.

    A dictionary of plain values; changed and passed through `json.dumps`, it is the `config` of a `DualStagePlanner`.
    """
