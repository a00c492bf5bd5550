"""Turn the cylinder for ten seconds, print what came of it and plot the errors.

python examples/turn.py [PICTURE.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import fingergait as fg

scenario = fg.Scenario.load("lift-and-rotate", {"duration": 10.0})
run = fg.simulate(scenario, progress=True)
print(run)

t, log = run.log.t, run.log
offset = log.pose("desired")[:, :3] - log.pose("object")[:, :3]  # (T, 3), m, in W
figure, (errors, quality) = plt.subplots(2, 1, sharex=True, layout="constrained")
errors.plot(t, 1e3 * np.linalg.norm(offset, axis=1))
errors.set_ylabel("position error [mm]")
quality.plot(t, log["Q"], label="Q")
quality.plot(t, log["threshold"], "--", label="threshold: a finger walks below it")
quality.set(xlabel="time [s]", ylabel="grasp quality Q")
quality.legend()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "turn.png")
