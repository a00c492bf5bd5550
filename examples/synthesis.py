"""Synthesise the robust controller of one axis by D-K iteration and look at it; then inspect the packaged one.

`fingergait synthesize` designs all six axes and certifies the coupled problem, in one or two minutes.
"""

import json

import numpy as np

import fingergait as fg
from fingergait.paths import MODELS
from fingergait.synthesis.plant import GeneralizedPlant

spec = fg.synthesis.SynthesisSpec.load(MODELS / "specs" / "contact.toml")
axis = 5  # the rotation about z
plant = GeneralizedPlant(spec.body([axis]), [spec.axis_weights(axis)], spec.actuation())
omega = np.geomspace(0.01, 1000.0, 60)  # rad/s
result = fg.synthesis.dk_iteration(plant.statespace(), 1, 1, plant.blocks(), omega, iterations=5)
for number, step in enumerate(result.history, start=1):
    print(f"iteration {number}: mu {step.mu_peak:.3f}, order of K {step.order}")

# mu again, of the closed loop of any controller: the bounds say how much of the uncertainty it stands.
P, K = plant.statespace().at(omega), result.K.at(omega)  # (n_w, outputs, inputs)
closed = P[:, :-1, :-1] + P[:, :-1, -1:] @ K @ np.linalg.inv(np.eye(1) - P[:, -1:, -1:] @ K) @ P[:, -1:, :-1]
upper, lower = fg.synthesis.mu_bounds(closed, plant.blocks(real=True))
print(f"with real parameters mu is between {lower.max():.3f} and {upper.max():.3f}: robust where it is below 1")

# The packaged artefact: K as the compiled step runs it, with the certificate of its synthesis.
text = (MODELS / "controllers" / "mu.json").read_text(encoding="utf-8")
controller = fg.Controller(text)
print(f"{controller.description}; {controller.kind}, {1e3 * controller.sample_time:g} ms, for {controller.mass} kg")
step = np.zeros((50, 6))
step[:, axis] = 0.01  # rad
print(f"answer to 10 mrad about z after 0.1 s: {controller.simulate(step)[-1, axis]:.2f} rad/s^2")
print(json.loads(text)["provenance"]["certificate"][0])
