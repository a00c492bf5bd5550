"""What can be laid over the scene: forces, friction pyramids, normals, the gait, the quality plane, reserves, poses."""

import mujoco
import numpy as np
import viser
from mjviser.conversions import merge_geoms
from numpy.typing import NDArray

from fingergait import _core
from fingergait.scenario import Scenario
from fingergait.sim.scene import OBJECT
from fingergait.view.pose import Pose

Array = NDArray[np.float64]

_LENGTH = 0.006  # m of arrow a newton
_PYRAMID = 0.02  # m: its height
_COLOURS = {"forces": (214, 69, 65), "normals": (60, 130, 220), "pyramids": (46, 160, 90)}
_NAMES = {
    "forces": ("contact forces", True),
    "pyramids": ("friction pyramids", True),
    "normals": ("normals felt", False),
    "gait": ("free finger and phase", True),
    "quality": ("quality plane and polygon", True),
    "reserve": ("reserve of each finger", False),
    "poses": ("desired and true pose", True),
}


class Overlays:
    """The overlays with their switches, which are added to the present part of the page.

    Parameters
    ----------
    server
        Of the page.
    pose
        Whose model and size the overlays fit.
    scenario
        Whose friction pyramids they are.

    Attributes
    ----------
    switches
        The checkbox of each overlay.
    """

    def __init__(self, server: viser.ViserServer, pose: Pose, scenario: Scenario) -> None:
        self._server, self._names = server, list(_NAMES)
        self.switches = {key: server.gui.add_checkbox(label, on) for key, (label, on) in _NAMES.items()}
        force = {**_core.default_config()["force"], **scenario.force}
        angle = 2.0 * np.pi * np.arange(int(force["edges"])) / int(force["edges"])
        self._rim = np.column_stack([np.cos(angle), np.sin(angle)])
        self._fixed_plane = {**_core.default_config()["gait"], **scenario.gait}["plane"] == "object"
        self._normal_O: Array | None = None
        n, add = len(pose.scene.fingers), server.scene
        nothing = np.zeros((1, 2, 3))
        self._forces, self._normals = (
            add.add_arrows(
                f"/overlays/{name}", nothing, _COLOURS[name], shaft_radius=0.0012, head_radius=0.003, head_length=0.006
            )
            for name in ("forces", "normals")
        )
        self._pyramids = add.add_line_segments(
            "/overlays/pyramids", nothing, _COLOURS["pyramids"], thickness=1.5, thickness_units="screen"
        )
        self._outline = add.add_line_segments(
            "/overlays/quality", nothing, (120, 60, 190), thickness=2.0, thickness_units="screen"
        )
        self._area = add.add_mesh_simple(
            "/overlays/area", np.zeros((3, 3)), np.array([[0, 1, 2]]), color=(150, 90, 220), opacity=0.35, side="double"
        )
        self._labels = [add.add_label(f"/overlays/finger{j}", "", anchor="bottom-center") for j in range(n)]
        geoms = [int(pose.scene.model.geom(OBJECT).id)]
        mesh = merge_geoms(pose.scene.model, geoms)
        self._desired = add.add_frame("/overlays/desired", axes_length=0.045, axes_radius=0.0012)
        add.add_mesh_simple(
            "/overlays/desired/body", mesh.vertices, mesh.faces, color=(90, 140, 90), wireframe=True, opacity=0.25
        )
        self._true = add.add_frame("/overlays/true", axes_length=0.06, axes_radius=0.0006)

    def forget(self) -> None:
        """Takes the next grasp as the first one: a new run has begun."""
        self._normal_O = None

    def update(self, pose: Pose) -> None:
        """Draws the overlays that are switched on."""
        on = {key: bool(switch.value) for key, switch in self.switches.items()}
        felt = np.flatnonzero(pose.touching)
        self._draw_forces(pose, felt, on)
        self._draw_quality(pose, felt, on["quality"])
        self._draw_labels(pose, on)
        for handle, name in ((self._desired, "desired"), (self._true, "object")):
            handle.visible = on["poses"]
            if on["poses"]:
                x = pose.row.group(name)
                handle.position, handle.wxyz = x[:3], x[3:]

    def _draw_forces(self, pose: Pose, felt: NDArray[np.intp], on: dict[str, bool]) -> None:
        self._forces.visible = on["forces"] and len(felt) > 0
        if self._forces.visible:
            begin = pose.places[felt]
            self._forces.points = np.stack([begin, begin + _LENGTH * pose.forces[felt]], axis=1).astype(np.float32)
        self._normals.visible = on["normals"] and len(felt) > 0
        if self._normals.visible:
            end = pose.places[felt]
            force = pose.row.group("measured_force")[felt, None]
            self._normals.points = np.stack([end - _LENGTH * force * pose.normals[felt], end], axis=1).astype(
                np.float32
            )
        self._pyramids.visible = on["pyramids"] and len(felt) > 0
        if self._pyramids.visible:
            mu = pose.row["friction"]
            rim = _PYRAMID * np.column_stack([mu * self._rim, np.ones(len(self._rim))])  # in the contact frame
            segments = []
            for j in felt:
                corners = pose.places[j] + rim @ pose.frames[j].T
                apex = np.broadcast_to(pose.places[j], corners.shape)
                segments += [
                    np.stack([apex, corners], axis=1),
                    np.stack([corners, np.roll(corners, -1, axis=0)], axis=1),
                ]
            self._pyramids.points = np.concatenate(segments).astype(np.float32)

    def _draw_quality(self, pose: Pose, felt: NDArray[np.intp], on: bool) -> None:
        polygon = self._polygon(pose, felt) if len(felt) >= 3 else None
        self._outline.visible = self._area.visible = on and polygon is not None
        if not on or polygon is None:
            return
        corners, frame = polygon
        middle = corners.mean(axis=0)
        square = 0.045 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) @ frame + middle
        loops = [np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in (corners, square)]
        self._outline.points = np.concatenate(loops).astype(np.float32)
        n = len(corners)
        self._area.vertices = corners.astype(np.float32)
        self._area.faces = np.array([[0, i, i + 1] for i in range(1, n - 1)], dtype=np.uint32)

    def _polygon(self, pose: Pose, felt: NDArray[np.intp]) -> tuple[Array, Array]:
        """Contacts on the quality plane in angular order (k, 3), and two directions (2, 3) that span the plane."""
        points = pose.places[felt]
        middle = points.mean(axis=0)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, pose.row.group("object")[3:])
        R_WO = rotation.reshape(3, 3)
        normal = np.linalg.svd(points - middle)[2][2]
        normal *= 1.0 if normal[2] >= 0.0 else -1.0
        if self._fixed_plane:
            if self._normal_O is None and pose.touching.all():
                self._normal_O = R_WO.T @ normal
            if self._normal_O is not None:
                normal = R_WO @ self._normal_O
        x = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
        x /= np.linalg.norm(x)
        frame = np.stack([x, np.cross(normal, x)])
        flat = (points - middle) @ frame.T
        order = np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))
        return middle + flat[order] @ frame, frame

    def _draw_labels(self, pose: Pose, on: dict[str, bool]) -> None:
        reserve = pose.reserve() if on["reserve"] else None
        for j, label in enumerate(self._labels):
            words = []
            if on["gait"] and pose.free == j:
                words.append(f"finger {j}: {pose.phase}")
            if reserve is not None:
                words.append(f"{reserve[j]:.1f} N to spare" if pose.touching[j] else "no contact")
            text = ", ".join(words)
            label.visible = bool(text)
            if text:
                if label.text != text:
                    label.text = text
                label.position = pose.tips[j] + [0.0, 0.0, 2.0 * pose.radius[j]]
