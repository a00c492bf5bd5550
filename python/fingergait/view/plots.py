"""The plots that run along with a run: pose error, quality, normal forces, torques, safe mode."""

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from fingergait.run.pose_error import pose_errors
from fingergait.view.history import History
from fingergait.view.pose import Pose

Array = NDArray[np.float64]

SECONDS = 10.0
"""How far back the plots look, s."""

_POINTS = 200
_COLOURS = (
    "#1f77b4",
    "#d62728",
    "#2ca02c",
    "#9467bd",
    "#ff7f0e",
    "#17becf",
    "#8c564b",
    "#e377c2",
    "#7f7f7f",
    "#bcbd22",
)
_LIMIT = "#888888"


class Plots:
    """Five charts, added to the present part of the page."""

    def __init__(self, server: viser.ViserServer, history: History, pose: Pose) -> None:
        self._history, self._pose = history, pose
        names = history.names.fingers
        fingers = [f"{name} " for name in names]
        self.charts = [
            _chart(server, "pose error, mm and 10 mrad", ["mm", "10 mrad"]),
            _chart(server, "quality Q, 1e-3", ["Q", "threshold"], limits=1),
            _chart(server, "normal forces, N", fingers),
            _chart(server, "torque, share of its limit", [*fingers, "limit"], limits=1, low=0.0, high=1.05),
            _chart(server, "safe mode: normal, hold, squeeze, damp, stop", ["mode"], low=-0.1, high=4.1),
        ]

    def update(self) -> None:
        """Shows the newest seconds."""
        t, rows = self._history.window(SECONDS, _POINTS)
        if len(t) < 2:
            return
        names = self._history.names

        def take(name: str) -> Array:
            return rows[:, names.index(name)].astype(np.float64)

        error = pose_errors(take("object"), take("desired"))
        series = [
            [1e3 * np.linalg.norm(error[:, :3], axis=1), 1e2 * np.linalg.norm(error[:, 3:], axis=1)],
            [1e3 * take("Q")[:, 0], 1e3 * take("threshold")[:, 0]],
            list(take("measured_force").T),
            [*self._pose.torque_share(take("tau_des")).T, np.ones(len(t))],
            [take("safe_mode")[:, 0]],
        ]
        for chart, columns in zip(self.charts, series, strict=True):
            chart.data = (t, *(np.nan_to_num(column) for column in columns))


def _chart(
    server: viser.ViserServer,
    title: str,
    labels: list[str],
    limits: int = 0,
    low: float | None = None,
    high: float = 0.0,
) -> viser.GuiUplotHandle:
    """A chart of one line a label; the last `limits` are dashed."""
    series: list[uplot.Series] = [uplot.Series(label="t")]
    for i, label in enumerate(labels):
        limit = i >= len(labels) - limits
        colour = _LIMIT if limit else _COLOURS[i % len(_COLOURS)]
        series.append(uplot.Series(label=label, stroke=colour, width=1.5, **({"dash": (4.0, 4.0)} if limit else {})))
    scales = {"x": uplot.Scale(time=False)}
    if low is not None:
        scales["y"] = uplot.Scale(auto=False, range=(low, high))
    nothing = tuple(np.zeros(2) for _ in series)
    return server.gui.add_uplot(nothing, tuple(series), title=title, scales=scales, height=120)
