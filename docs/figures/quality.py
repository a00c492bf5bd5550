"""The quality: the polygon of the contacts in the object, and how far the joints are from their middle."""

import numpy as np
from _drawing import COLOURS, Stage, save, tidy
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import fingergait as fg
from fingergait.sim.scene import OBJECT

log = fg.simulate(fg.Scenario.load("lift-and-rotate", {"duration": 9.0})).log
free = log["free_finger"].astype(int)
stage = Stage(log)
holding = np.flatnonzero(free < 0)
settled = int(np.searchsorted(log.t, 0.5))
before = int(np.flatnonzero(free >= 0)[0]) - 1
after = int(holding[-1])

figure = Figure(figsize=(11.0, 4.2), layout="constrained")
axes = figure.subplots(1, 4, width_ratios=[1, 1, 1, 1.25])
radius = 1e3 * float(stage.scene.model.geom(OBJECT).size[0])
turned = np.rad2deg(np.unwrap(2.0 * np.arctan2(log["object_qz"], log["object_qw"])))
for ax, row, title in zip(
    axes, (settled, before, after), ("first grasp", "before a gait", "after gaits"), strict=False
):
    contacts = stage.contacts(row)
    R = stage.data.xmat[stage.scene.object_body].reshape(3, 3)
    points = 1e3 * np.array([(place - stage.data.xpos[stage.scene.object_body])[:2] for place, _, _ in contacts])
    ax.add_patch(Circle((0.0, 0.0), radius, color="#CC7840", alpha=0.25))
    ax.fill(*points.T, alpha=0.35, color="#4C72B0")
    ax.plot(*np.vstack([points, points[:1]]).T, color="#4C72B0", lw=1.2)
    mark = 1e3 * 0.02 * R[:2, 0]
    ax.plot([0, mark[0]], [0, mark[1]], color="black", lw=3, solid_capstyle="round")
    for j, point in enumerate(points):
        ax.plot(*point, "o", color=COLOURS[j], ms=9)
    ax.set(aspect="equal", xlim=(-32, 32), ylim=(-32, 32), xlabel="x [mm]")
    measured = f"turned {turned[row]:.0f} degrees, $Q_o$ {1e4 * log['Q_o'][row]:.1f} cm²"
    ax.set_title(f"{title}, {log.t[row]:.1f} s\n{measured}", fontsize=9)
axes[0].set_ylabel("y [mm]")

model = stage.scene.model
joints = [joint for finger in stage.scene.fingers for joint in finger.joints]
lower, upper = model.jnt_range[joints].T
q = log.block("q")
for row, marker, label in ((settled, "o", "first grasp"), (before, "x", "before a gait"), (after, "s", "after gaits")):
    share = (q[row] - lower) / (upper - lower)
    axes[3].plot(share, np.arange(len(joints)), marker, label=label, ms=6, mfc="none")
axes[3].axvline(0.5, color="grey", lw=0.8)
axes[3].set(xlim=(0, 1), yticks=range(len(joints)), yticklabels=[model.joint(j).name for j in joints])
axes[3].tick_params(labelsize=8)
axes[3].set_title("joint angles in their ranges: $Q_h$ draws\nthem to the middle", fontsize=9)
axes[3].legend(fontsize=8, loc="lower left")
axes[3].invert_yaxis()
tidy(figure)
save(figure)
