"""The wrench chain during a push: from the pose error to the wrench, the contact forces and the joint torques."""

import numpy as np
from _drawing import COLOURS, Stage, save, tidy
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

import fingergait as fg
from fingergait.sim.scene import OBJECT

PUSH = {"at": 2.0, "duration": 0.2, "force": [5.0, 0.0, 0.0]}
scenario = fg.Scenario.load("hold", {"duration": 3.0, "disturbance": [PUSH]})
log = fg.simulate(scenario).log
t, fingers = log.t, log.fingers
row = int(np.searchsorted(t, 2.18))
shown = (t > 1.9) & (t < 2.9)
stage = Stage(log)
contacts = stage.contacts(row)
friction = log["friction"][row]

figure = Figure(figsize=(13.0, 6.2), layout="constrained")
grid = figure.add_gridspec(4, 2, width_ratios=[1.0, 1.25])
top = figure.add_subplot(grid[:, 0])
radius = 1e3 * float(stage.scene.model.geom(OBJECT).size[0])
middle = 1e3 * stage.data.xpos[stage.scene.object_body][:2]
top.add_patch(Circle(tuple(middle), radius, color="#CC7840", alpha=0.25))
for j, (place, R, f) in enumerate(contacts):
    point, force = 1e3 * place[:2], (R @ f)[:2]
    normal, along = R[:2, 2], R[:2, 1]
    wedge = [point, *(point + 16.0 * (normal + side * friction * along) for side in (-1.0, 1.0))]
    top.add_patch(Polygon(wedge, color=COLOURS[j], alpha=0.25, lw=0.0))
    top.add_patch(Circle(tuple(point - 14.0 * normal), 14.0, fill=False, color=COLOURS[j]))
    tip = point + 4.0 * force
    top.annotate("", tip, point, arrowprops={"arrowstyle": "-|>", "color": COLOURS[j], "lw": 2.0})
    top.text(*(point - 14.0 * normal), f"{fingers[j]}\n{f[2]:.1f} N", ha="center", va="center", fontsize=9)
push = 4.0 * np.array(PUSH["force"][:2])
arrow = {"arrowstyle": "-|>", "color": "black", "lw": 2.5}
start = np.array([-54.0, 46.0])
top.annotate("", start + push, start, arrowprops=arrow)
top.text(*(start + [0.0, 3.0]), "the push, 5 N")
top.set(aspect="equal", xlim=(-58, 58), ylim=(-58, 58), xlabel="x [mm]", ylabel="y [mm]")
top.set_title("contact forces at 2.18 s inside their friction pyramids, from above", fontsize=10)

error, wrench, normal, torque = (figure.add_subplot(grid[i, 1]) for i in range(4))
error.plot(t[shown], 1e3 * log["e_0"][shown], color="black")
error.set_ylabel("error in x\n[mm]")
error.set_title("pose error e  →  K  →  wrench  →  contact forces  →  torques", fontsize=10)
delivered = log["F_des_0"] - log["psi_0"]
wrench.plot(t[shown], log["F_des_0"][shown], color="black", label="asked for by K")
wrench.plot(t[shown], delivered[shown], "--", color="#DD8452", label="delivered, G f")
wrench.set_ylabel("force in x\n[N]")
wrench.legend(fontsize=8, loc="upper right")
commands = np.abs(log.block("tau_des")).reshape(len(log), len(fingers), -1).max(axis=2)
for j, name in enumerate(fingers):
    normal.plot(t[shown], log[f"f_{3 * j + 2}"][shown], color=COLOURS[j], label=name)
    torque.plot(t[shown], commands[shown, j], color=COLOURS[j])
normal.set_ylabel("normal force\n[N]")
normal.legend(fontsize=8, ncols=len(fingers), loc="upper right")
torque.axhline(0.5, color="grey", ls="--", lw=0.9)
torque.text(1.91, 0.49, "limit", va="top", fontsize=8)
torque.set(ylabel="largest joint\ntorque [N m]", xlabel="time [s]", ylim=(0.0, 0.55))
for axes in (error, wrench, normal, torque):
    axes.margins(x=0.0)
    axes.axvspan(PUSH["at"], PUSH["at"] + PUSH["duration"], color="grey", alpha=0.25, lw=0.0)
    axes.axvline(t[row], color="grey", lw=0.8, ls=":")
tidy(figure)
save(figure)
