"""A run that goes on for as long as people play with it: one thread that owns plant and planner."""

import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.run.loss import LossMonitor
from fingergait.run.stepper import Stepper
from fingergait.scenario import Scenario
from fingergait.view.history import Names, Ring
from fingergait.view.inputs import Inputs
from fingergait.view.pacer import Pacer
from fingergait.view.reach import reach

_CHECK_EVERY = 5  # control steps between two looks at whether the object is lost, as in `simulate`
_KEPT = 60.0  # s of rows; readers see the newest half


class Session:
    """Plant, planner and inputs of one bench. The simulation runs in a thread of its own between `start` and `stop`.

    Parameters
    ----------
    scenario
        What is played with; its duration doesn't end the session.

    Attributes
    ----------
    scene, start_qpos
        The model, and the state of all of it that the run starts from.
    inputs
        What the page asks.
    pacer
        Real time, pause, step and speed.
    history
        Rows for the page.
    lost
        How the object was lost, in words, if it was.
    failure
        The error that ended the simulation, if one did.
    step_ns, cpu_s, steps
        Time of the last control step in the core, ns; CPU time of the simulation's thread, s; steps since the start.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._stepper = Stepper(scenario, steered=True)
        self.scene = self._stepper.plant.scene
        self.start_qpos = self._stepper.plant.start.qpos
        bounds = reach(self.scene, self.start_qpos, scenario.reference.lift)
        self.inputs = Inputs(len(self._stepper.fingers), bounds, scenario.period)
        self.pacer = Pacer()
        names = Names(self._stepper.columns, self._stepper.fingers)
        self.history = Ring(names, round(_KEPT * scenario.controller.rate_hz))
        self.lost: str | None = None
        self.failure: Exception | None = None
        self.step_ns: list[int] = []
        self.cpu_s, self.steps, self.runs = 0.0, 0, 0
        self._monitor = LossMonitor(scenario)
        self._reset = self._stop = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fingergait-session", daemon=True)

    def start(self) -> None:
        """Begins to simulate."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the simulation and waits for its thread."""
        self._stop = True
        self.pacer.end()
        if self._thread.is_alive():
            self._thread.join()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until the simulation has ended; False at the timeout."""
        return self._ended.wait(timeout)

    def reset(self) -> None:
        """Begins the run anew, as the scenario says."""
        self._reset = True
        self.pacer.wake()

    def step(self) -> None:
        """One control step; for the simulation's thread, and for who drives a session without one."""
        stepper, t = self._stepper, self._stepper.t
        for event in self.inputs.take(t):
            stepper.apply(event)
        diagnostics = stepper.plan()
        stepper.record(self.history.append(t))
        self.history.publish()
        self.steps += 1
        if self.steps % _CHECK_EVERY == 0 and self.lost is None and not stepper.refused:
            plant, standing = stepper.plant, diagnostics.safe_mode != "normal"
            if self._monitor.update(
                t, plant.object_pose, stepper.goal, plant.sensors.normal_force, standing, stepper.lying
            ):
                self.lost = self._monitor.symptom
        self.step_ns.append(diagnostics.step_ns)
        if len(self.step_ns) > 20_000:
            del self.step_ns[:10_000]
        stepper.advance()
        if self.steps % 50 == 0:
            self.cpu_s = time.thread_time()

    @property
    def offset(self) -> NDArray[np.float64]:
        """How far the desired pose is from the scenario's own now, (6,), m and rad."""
        return self._stepper.offset

    def saved(self) -> dict[str, Any]:
        """The run so far with all its inputs, as the TOML values of a scenario that repeats it."""
        row = self.history.row()
        period = self.scenario.period
        return self.inputs.saved(self.scenario, max(period, (row.t if row is not None else 0.0) + period))

    def _run(self) -> None:
        try:
            while not self._stop:
                if self._reset:
                    self._restart()
                if self.pacer.wait(self._stepper.t):
                    self.step()
        except Exception as error:  # shown on the page and by the command
            self.failure = error
        finally:
            self._stepper.plant.close()
            self._ended.set()

    def _restart(self) -> None:
        self._reset = False
        self._stepper.plant.close()
        self._stepper = Stepper(self.scenario, steered=True)
        self._monitor = LossMonitor(self.scenario)
        self.lost = None
        self.runs += 1
        self.inputs.clear()
        self.history.clear()
