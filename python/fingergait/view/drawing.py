"""The hand and the object on the page, and the camera that sees them large."""

import copy
from typing import Any

import mujoco
import numpy as np
import viser
from mjviser import ViserMujocoScene
from mjviser.conversions import merge_geoms
from numpy.typing import NDArray

from fingergait.sim.scene import OBJECT, SceneModel

Array = NDArray[np.float64]

_FOV = np.deg2rad(35.0)
_AZIMUTH, _ELEVATION = np.deg2rad(-60.0), np.deg2rad(28.0)
_TOWARDS = np.array([np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), np.sin(_ELEVATION)])
_ASPECT = 0.8  # of the picture between the panels, about: narrower than high
_MARGIN = 1.05
_OPACITY = 0.5  # of the object: the forces on it are inside
_GAMMA = 2.2  # MuJoCo's colours are meant for the screen, the page's meshes want them linear
_AMBIENT = 0.4  # share of the light that comes from all around


class Drawing:
    """Hand and object, drawn by mjviser.

    Parameters
    ----------
    server
        Of the page.
    scene
        The model; a copy of it is drawn.
    start
        State with the object in the hand, which the camera is framed to.
    """

    def __init__(self, server: viser.ViserServer, scene: SceneModel, start: mujoco.MjData) -> None:
        model, body = copy.copy(scene.model), int(scene.model.geom(OBJECT).id)
        model.geom_rgba[body, 3] = 0.0  # drawn below: mjviser draws nothing that one can look through
        for colours in (model.geom_rgba, model.mat_rgba):
            colours[:, :3] **= _GAMMA
        server.scene.set_up_direction("+z")
        self._scene: Any = ViserMujocoScene(server, model, num_envs=1)
        self._scene.camera_tracking_enabled = False
        server.scene.configure_environment_map(environment_intensity=_AMBIENT)
        mesh, rgba = merge_geoms(scene.model, [body]), scene.model.geom_rgba[body]
        self._body = server.scene.add_mesh_simple(
            "/object", mesh.vertices, mesh.faces, color=tuple(rgba[:3].tolist()), opacity=_OPACITY, side="double"
        )
        self._object = scene.object_body
        points, radii = _spheres(scene, start)
        lower, upper = (points - radii[:, None]).min(axis=0), (points + radii[:, None]).max(axis=0)
        self.centre, self.size = 0.5 * (lower + upper), 0.5 * float(np.max(upper - lower))
        camera = server.initial_camera
        camera.position = self.centre + _distance(points - self.centre, radii) * _TOWARDS
        camera.look_at = self.centre
        camera.fov = float(_FOV)

    def update(self, data: mujoco.MjData) -> None:
        """Draws the bodies where `data` has them."""
        self._body.position, self._body.wxyz = data.xpos[self._object].copy(), data.xquat[self._object].copy()
        self._scene.update_from_mjdata(data)


def _spheres(scene: SceneModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Centres (n, 3) and radii (n,), m, of spheres around the parts of the fingers and the object."""
    model = scene.model
    bodies = {scene.object_body, *(int(model.jnt_bodyid[joint]) for f in scene.fingers for joint in f.links)}
    geoms = [g for g in range(model.ngeom) if int(model.body_weldid[model.geom_bodyid[g]]) in bodies]
    return data.geom_xpos[geoms], model.geom_rbound[geoms]


def _distance(points: Array, radii: Array) -> float:
    """How far from the origin the camera has to be, m, so that the picture has all the spheres in it."""
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    aside = np.abs(points @ np.column_stack([right, np.cross(_TOWARDS, right)])) + radii[:, None]
    widest = (aside / [_ASPECT, 1.0]).max(axis=1)
    return float(np.max(points @ _TOWARDS + _MARGIN * widest / np.tan(0.5 * _FOV)))
