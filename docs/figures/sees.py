"""What K sees with a camera of 60 Hz that is noisy and late, beside what the sensor says and what is true."""

import numpy as np
from _drawing import save, tidy
from matplotlib.figure import Figure

import fingergait as fg
from fingergait.run.pose_error import pose_errors

SENSORS = {"position_noise": 2e-4, "orientation_noise": 3e-3, "pose_rate_hz": 60.0, "pose_delay_s": 0.03}
scenario = fg.Scenario.load("lift-and-rotate", {"duration": 6.0, "sensors": SENSORS})
log = fg.simulate(scenario).log
t, desired = log.t, log.pose("desired")
true, said = pose_errors(log.pose("object"), desired), pose_errors(log.pose("measured"), desired)
shown = (t > 3.0) & (t < 4.5)

figure = Figure(figsize=(11.0, 5.2), layout="constrained")
rows = ((0, 1e3, "error in x [mm]"), (5, 1e3, "error about z [mrad]"))
for axes, (channel, scale, label) in zip(figure.subplots(2, 1, sharex=True), rows, strict=True):
    axes.plot(t[shown], scale * said[shown, channel], color="#C44E52", lw=0.9, label="by the sensor's pose")
    axes.plot(t[shown], scale * log[f"e_{channel}"][shown], color="#4C72B0", lw=1.6, label="what K sees")
    axes.plot(t[shown], scale * true[shown, channel], color="black", lw=1.2, label="the truth")
    axes.axhline(0.0, color="grey", lw=0.7)
    axes.set_ylabel(label)
    axes.margins(x=0.0)
figure.axes[0].legend(ncols=3, fontsize=9, loc="upper right")
figure.axes[-1].set_xlabel("time [s]")
figure.axes[0].set_title(
    "pose at 60 Hz, 30 ms late, noise of 0.2 mm and 3 mrad; the object turns at 0.2 rad/s and swings"
)
tidy(figure)
save(figure)
rms = [np.sqrt(np.mean((x - true)[shown, 5] ** 2)) for x in (said, np.stack([log[f"e_{i}"] for i in range(6)], axis=1))]
print(f"off the truth about z, rms: the sensor {1e3 * rms[0]:.1f} mrad, K's input {1e3 * rms[1]:.1f} mrad")
