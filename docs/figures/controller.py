"""The packaged controllers: K's gain over frequency, axis by axis, and the answer of the held object to a step."""

import json

import numpy as np
from _drawing import save, tidy
from matplotlib.figure import Figure

import fingergait as fg
from fingergait.paths import MODELS

AXES = ("x", "z", "rx", "rz")
STYLES = {"mu": "-", "pid": "--"}
omega = np.geomspace(0.1, 1500.0, 400)

figure = Figure(figsize=(12.0, 4.2), layout="constrained")
force, turn, step = figure.subplots(1, 3)
names = ("x", "y", "z", "rx", "ry", "rz")
for name, style in STYLES.items():
    artefact = json.loads((MODELS / "controllers" / f"{name}.json").read_text(encoding="utf-8"))
    scale = [artefact["nominal"]["mass"]] * 3 + artefact["nominal"]["inertia"]
    for index, axis in enumerate(AXES):
        channel = names.index(axis)
        K = {key: np.array(value) for key, value in artefact["K"]["axes"][channel].items()}
        z = np.exp(1j * omega * artefact["sample_time"])[:, None, None]
        response = K["C"] @ np.linalg.solve(z * np.eye(len(K["A"])) - K["A"], K["B"] + 0j) + K["D"]
        axes = force if channel < 3 else turn
        axes.loglog(
            omega, scale[channel] * np.abs(response[:, 0, 0]), style, color=f"C{index}", label=f"{name}, {axis}"
        )
    log = fg.simulate(fg.Scenario.load("robust-step", {"duration": 1.2, "controller.file": name})).log
    moved = 1e3 * (log["object_x"] - log["object_x"][np.searchsorted(log.t, 0.0)])
    step.plot(log.t, moved, style, color="black", label=name)
force.set(xlabel="frequency [rad/s]", ylabel="gain of K, translations [N/m]")
turn.set(xlabel="frequency [rad/s]", ylabel="gain of K, rotations [N m/rad]")
step.axhline(4.0, color="grey", lw=0.8)
step.set(xlabel="time [s]", ylabel="the object in x [mm]")
for axes in (force, turn, step):
    axes.legend(fontsize=8)
tidy(figure)
save(figure)
