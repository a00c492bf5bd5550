"""The plant under the compiled control step, one control step at a time: what every run and every live page does."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from fingergait import _core
from fingergait.hand import model_json
from fingergait.paths import find
from fingergait.run.log import columns
from fingergait.run.regrasping import LYING
from fingergait.scenario import Disturbance, Input, Scenario
from fingergait.scenario.faults import FaultWindow
from fingergait.scenario.reference import Trajectory
from fingergait.sim.plant import MujocoPlant

Event = Input | Disturbance | FaultWindow
"""What may happen to a run that is under way."""

_REFUSED = {"pose_frame", "tactile_axes"}
_EDGE = 1e-9  # s: an input this close to a control step belongs to it


class Stepper:
    """One run of a scenario that its owner drives: `plan`, then `record` if wanted, then `advance`.

    Parameters
    ----------
    scenario
        What to run; its inputs are applied at their times.
    steered
        Let `apply` change the reference too. A scenario with inputs always is.

    Attributes
    ----------
    plant, planner
        The simulated plant and the compiled planner.
    pose
        The desired pose (7,) of the last `plan`, before injected faults.
    diagnostics
        Of the last `plan`.
    """

    def __init__(self, scenario: Scenario, steered: bool = False) -> None:
        self.scenario = scenario
        self.plant = plant = MujocoPlant(scenario)
        hand = _core.HandModel(model_json(plant.scene.hand))
        self.planner = _core.DualStagePlanner(hand, load_controller(scenario), plant.config)
        self.fingers = [finger.name for finger in plant.scene.fingers]
        self.columns = columns(self.fingers, plant.scene.counts)
        self._measurement = plant.reset()
        self._trajectory = Trajectory(scenario.reference, plant.sensors.pose, steered or bool(scenario.input))
        self._inputs = deque(sorted(scenario.input, key=lambda change: change.at))
        sizes = [7, 7, len(plant.scene.q), len(self.fingers), 1, len(plant.sensors.row)]
        self._cuts = np.cumsum(sizes).tolist()

    @property
    def t(self) -> float:
        """Time of the measurement that the next `plan` answers, s."""
        return self.plant.t

    @property
    def offset(self) -> NDArray[np.float64]:
        """How far `pose` has been steered from the scenario's own reference, (6,), m and rad."""
        steering = self._trajectory.steering
        return steering.offset[0] if steering is not None else np.zeros(6)

    @property
    def refused(self) -> bool:
        """Whether the last `plan` refused to start: nothing is driven yet, and so nothing can be lost."""
        return not _REFUSED.isdisjoint(self.diagnostics.faults)

    @property
    def goal(self) -> NDArray[np.float64]:
        """Where the object is to be now, (7,): the desired pose, less what it missed while it was set down."""
        if self.diagnostics.regrasp == "idle":
            return self.pose
        goal: NDArray[np.float64] = self.diagnostics.governed
        return goal

    @property
    def lying(self) -> bool:
        """Whether the object lies on its support, where nobody holds it."""
        return self.diagnostics.regrasp in LYING

    def plan(self) -> _core.Diagnostics:
        """Answers the newest measurement: the inputs that are due, the reference, the control step."""
        plant = self.plant
        while self._inputs and self._inputs[0].at <= plant.t + _EDGE:
            self.apply(self._inputs.popleft())
        self.pose, twist = self._trajectory.sample(plant.t)
        given = plant.injection.reference(plant.t, self.pose, twist)
        self._command, self.diagnostics = self.planner.step(self._measurement, _core.Reference(*given))
        return self.diagnostics

    def record(self, row: NDArray[np.float32]) -> None:
        """Writes the step just planned into a row of `columns`."""
        plant, cuts = self.plant, self._cuts
        row[: cuts[0]] = plant.object_pose
        row[cuts[0] : cuts[1]] = self.pose
        row[cuts[1] : cuts[2]] = plant.joint_angles
        row[cuts[2] : cuts[3]] = plant.sensors.tangential
        row[cuts[3]] = plant.link_contact
        row[cuts[4] : cuts[5]] = plant.sensors.row
        row[cuts[5] :] = self.diagnostics.row()

    def advance(self) -> None:
        """Gives the plant the command just planned, for one control period."""
        self._measurement = self.plant.step(self._command)

    def apply(self, event: Event) -> None:
        """Makes something happen from now on; what has a time of its own must not lie before now."""
        if isinstance(event, Disturbance):
            self.plant.push(event)
        elif isinstance(event, FaultWindow):
            self.plant.injection.add(event)
        elif event.key.startswith("reference."):
            assert self._trajectory.steering is not None, "a stepper that takes inputs is steered"
            self._trajectory.steering.ask(event.key, event.value)
        else:
            self.plant.change(event.key, event.number)


def load_controller(scenario: Scenario) -> _core.Controller:
    """The controller artefact that a scenario names; refused with the remedy if it is sampled at another rate."""
    path = find(scenario.controller.file, "controllers", ".json", "controller.file")
    try:
        controller = _core.Controller(path.read_text(encoding="utf-8"))
    except (_core.ArtifactError, UnicodeDecodeError) as error:
        raise _core.ArtifactError(f"{path.name}: {error}") from None
    rate, made = scenario.controller.rate_hz, 1.0 / controller.sample_time
    if abs(controller.sample_time - scenario.period) > 1e-9:
        out = f"mu-{rate:g}.json"
        raise _core.ConfigError(
            f"controller.rate_hz: expected {made:g} ({path.name} is sampled at {1e3 * controller.sample_time:.4g} ms), "
            f"found {rate:g}; make one: fingergait synthesize contact --rate {rate:g} --out {out}, "
            f"then --controller {out}"
        )
    return controller
