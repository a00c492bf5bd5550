"""Records what a control step is given in a run, for the benches, the soak and the fuzzers of the core.

A recording is one line of JSON and, behind its line feed, rows of single-precision numbers, little-endian. The line
has `format`, `scenario`, `hand` (as for `HandModel`), `controller` (the artefact), `config` (of the core, what is not
default), `fingers`, `joints`, `rate_hz` and `rows`. A row is q, tau, the pose wxyz, the tactile places and forces, then
the reference's pose and twist, then the torques that were commanded.

The measurements of a recording answer the commands of the controller that was recorded, and of no other: with another
one in the replay they do not, and K runs away. The commands are there so that a test can tell when it is time to record
anew (`make recordings`).
"""

import argparse
import json
from pathlib import Path

import numpy as np

from fingergait import _core
from fingergait.files import make_folder, whole_file
from fingergait.hand import model_json
from fingergait.paths import find
from fingergait.run.simulate import load_controller
from fingergait.scenario import Scenario, parse_override
from fingergait.scenario.reference import Trajectory
from fingergait.sim.plant import MujocoPlant

FORMAT = "fingergait-recording/2"


def record(scenario: Scenario, out: Path) -> int:
    """Runs a scenario in the closed loop and writes its measurements and references to `out`; gives the rows."""
    plant = MujocoPlant(scenario)
    hand = model_json(plant.scene.hand)
    planner = _core.DualStagePlanner(_core.HandModel(hand), load_controller(scenario), plant.config)
    artefact = find(scenario.controller.file, "controllers", ".json", "controller.file").read_text(encoding="utf-8")
    measurement = plant.reset()
    trajectory = Trajectory(scenario.reference, plant.sensors.pose)
    rows = []
    for _ in range(round((scenario.duration + scenario.grasp.settle) * scenario.controller.rate_hz)):
        pose, twist = trajectory.sample(plant.t)
        command, _ = planner.step(measurement, _core.Reference(pose, twist))
        rows.append(np.concatenate([plant.sensors.row, pose, twist, command.tau.ravel()]))
        measurement = plant.step(command)
    plant.close()
    head = {
        "format": FORMAT,
        "scenario": scenario.model_dump(mode="json", exclude_unset=True),
        "hand": json.loads(hand),
        "controller": {key: value for key, value in json.loads(artefact).items() if key != "provenance"},
        "config": json.loads(plant.config),
        "fingers": len(plant.scene.fingers),
        "joints": plant.scene.counts[0],
        "rate_hz": scenario.controller.rate_hz,
        "rows": len(rows),
    }
    make_folder(out.parent, "out")
    with whole_file(out) as temporary, temporary.open("wb") as file:
        file.write(json.dumps(head, separators=(",", ":")).encode() + b"\n")
        file.write(np.asarray(rows, dtype="<f4").tobytes())
    return len(rows)


def main() -> None:
    """The command `python -m fingergait.run.record`."""
    parser = argparse.ArgumentParser(prog="python -m fingergait.run.record", description=record.__doc__)
    parser.add_argument("scenario", help="a packaged scenario's name, or a TOML file")
    parser.add_argument("out", type=Path, help="the file to write")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace a scenario key")
    arguments = parser.parse_args()
    scenario = Scenario.load(arguments.scenario, dict(map(parse_override, arguments.set)))
    print(f"{arguments.out}: {record(scenario, arguments.out)} rows")


if __name__ == "__main__":
    main()
