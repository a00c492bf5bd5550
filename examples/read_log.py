"""Read the log of a run, as `fingergait run` leaves it, and find out what the gaits did.

python examples/read_log.py [runs/lift-and-rotate-0/log.parquet]
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import fingergait as fg

if len(sys.argv) > 1:
    path = Path(sys.argv[1])
else:  # no log at hand: make one
    path = Path(tempfile.mkdtemp()) / "log.parquet"
    fg.simulate(fg.Scenario.load("lift-and-rotate", {"duration": 8.0})).log.write(path)

log = fg.Log.read(path)
scenario = json.loads(log.metadata["scenario"])
print(f"{scenario['name']}: {len(log)} control steps of {len(log.names)} figures, {log.t[0]:.2f} to {log.t[-1]:.2f} s")

# One column by its name, several by what their names begin with.
quality, free = log["Q"], log["free_finger"]  # free_finger: -1 while all fingers hold
force = log.block("measured_force")  # (T, n_fingers), N
print(f"normal forces while holding: {force[free < 0].mean(axis=0).round(2)} N")

begins = np.flatnonzero((free[1:] >= 0) & (free[:-1] != free[1:])) + 1
for begin in begins:
    after = np.flatnonzero(free[begin:] != free[begin])
    if after.size:
        end = begin + after[0]
        rise = 1e4 * (quality[end] - quality[begin])
        name = log.fingers[int(free[begin])]
        print(f"{log.t[begin]:6.2f} s: {name} walked for {log.t[end] - log.t[begin]:.2f} s, Q rose by {rise:.1f}e-4")

# The same file in any tool that reads Parquet, pandas for one.
bad = log["safe_mode"] > 0
print(f"safe modes: {100 * bad.mean():.1f} % of the time")
