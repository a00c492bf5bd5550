"""What the pictures share: colours, sizes, and a camera that draws contact forces into the scene of a log."""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import fingergait as fg
from fingergait.sim.scene import build_scene

Array = NDArray[np.float64]

COLOURS = ("#4C72B0", "#DD8452", "#55A868", "#C44E52", "#8172B3", "#937860")
PHASES = ("hold", "unload", "slide", "press", "load")
_ARROW = 0.022  # m of arrow a newton


def save(figure: Figure) -> None:
    """Writes the picture where the command line says."""
    figure.savefig(Path(sys.argv[1]), dpi=130)


def tidy(figure: Figure) -> None:
    """A light grid and no frame on top and right."""
    for axes in figure.axes:
        if axes.axison and axes.name != "polar":
            axes.grid(alpha=0.25)
            axes.spines[["top", "right"]].set_visible(False)


def contact_frame(n: Array) -> Array:
    """R_WC with z along the normal n, as the core chooses it."""
    up = np.array([0.0, 0.0, 1.0]) if abs(n[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    x = up - n * (n @ up)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(n, x), n])


class Stage:
    """The scene of a log: its contacts at any row, and pictures of it."""

    def __init__(self, log: fg.Log) -> None:
        self.log, self.scene = log, build_scene(fg.Scenario.build(json.loads(log.metadata["scenario"])))
        self.data = mujoco.MjData(self.scene.model)
        n = len(self.scene.fingers)
        self._q, self._object = log.block("q"), log.pose("object")
        self._place = log.block("measured_place").reshape(len(log), n, 3)
        self._touch = log.block("measured_force")
        self._f = np.column_stack([log[f"f_{i}"] for i in range(3 * n)]).reshape(len(log), n, 3)
        self._renderer: mujoco.Renderer | None = None

    def put(self, row: int) -> None:
        """Brings the scene to a row of the log."""
        self.data.qpos[self.scene.q] = self._q[row]
        self.data.qpos[self.scene.object_q : self.scene.object_q + 7] = self._object[row]
        mujoco.mj_forward(self.scene.model, self.data)

    def contacts(self, row: int) -> list[tuple[Array, Array, Array]]:
        """Place, frame R_WC and commanded force in it of each finger that touches; the scene is brought there."""
        self.put(row)
        found = []
        for j, (tip, link) in enumerate(zip(self.scene.tips, self.scene.links, strict=True)):
            if self._touch[row, j] > 0.0:
                outward = self.data.xmat[link].reshape(3, 3) @ self._place[row, j]
                R = contact_frame(outward / np.linalg.norm(outward))
                found.append((self.data.geom_xpos[tip] + outward, R, self._f[row, j]))
        return found

    def picture(self, row: int, azimuth: float, elevation: float, distance: float, free: int | None = None) -> Array:
        """A picture of a row with the contact forces as arrows; the free finger is drawn in its colour."""
        contacts, model = self.contacts(row), self.scene.model
        if self._renderer is None:
            self._renderer = mujoco.Renderer(model, 420, 420)
        kept = model.geom_rgba.copy(), model.geom_matid.copy()
        if free is not None:
            links = {int(model.jnt_bodyid[joint]) for joint in self.scene.fingers[free].joints}
            own = [g for g in range(model.ngeom) if int(model.geom_bodyid[g]) in links]
            model.geom_matid[own] = -1
            model.geom_rgba[own] = [*_rgb(COLOURS[free]), 1.0]
        camera = mujoco.MjvCamera()
        camera.azimuth, camera.elevation, camera.distance = azimuth, elevation, distance
        camera.lookat[:] = (0.0, 0.0, 0.075)
        self._renderer.update_scene(self.data, camera)
        for place, R, f in contacts:
            self._arrow(place, R @ f)
        picture = self._renderer.render().copy()
        model.geom_rgba[:], model.geom_matid[:] = kept
        return picture

    def _arrow(self, place: Array, force: Array) -> None:
        assert self._renderer is not None
        scene = self._renderer.scene
        if np.linalg.norm(force) < 0.05 or scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        rgba = np.array([0.85, 0.10, 0.10, 1.0], dtype=np.float32)
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.0025, place - _ARROW * force, place)
        scene.ngeom += 1


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
