"""A recorded run for the rerun viewer: `fingergait show LOG --rerun FILE.rrd`."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fingergait._core import ConfigError
from fingergait.run.pose_error import pose_errors
from fingergait.sim.scene import build_scene
from fingergait.view import server
from fingergait.view.history import Names, Row
from fingergait.view.pose import Pose
from fingergait.view.show import load

_RATE = 50.0  # Hz: pictures a second of the run


def export(path: Path, out: Path) -> int:
    """Writes the log at `path` for rerun into `out`; the number of its pictures."""
    server.require()
    try:
        import rerun as rr
    except ImportError:
        raise ConfigError(
            "--rerun: expected the package rerun-sdk, found none; install it: pip install 'fingergait[rerun]'"
        ) from None
    from mjviser.conversions import merge_geoms

    if out.suffix != ".rrd" or not out.resolve().parent.is_dir():
        raise ConfigError(f"--rerun: expected a .rrd file in a folder that exists, found {out}")
    log, scenario = load(path)
    scene = build_scene(scenario)
    model, pose = scene.model, Pose(scene)
    stream: Any = rr.RecordingStream("fingergait", recording_id=path.stem)
    stream.save(str(out))
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    bodies = [body for body in range(model.nbody) if model.body_geomnum[body] > 0]
    for body in bodies:
        first = int(model.body_geomadr[body])
        geoms = [g for g in range(first, first + int(model.body_geomnum[body])) if model.geom_rgba[g, 3] > 0.0]
        geoms = [g for g in geoms if model.geom_group[g] < 3]  # MuJoCo's viewers hide the rest too
        geoms = [g for g in geoms if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_PLANE]
        if geoms:
            mesh = merge_geoms(model, geoms)
            colour = (
                model.geom_rgba[geoms[0]]
                if model.geom_matid[geoms[0]] < 0
                else model.mat_rgba[model.geom_matid[geoms[0]]]
            )
            shape = rr.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.faces,
                vertex_normals=mesh.vertex_normals,
                albedo_factor=(255 * colour).astype(np.uint8),
            )
            stream.log(f"scene/{_name(model, body)}", shape, static=True)
    stride = max(1, round(1.0 / (_RATE * scenario.period)))
    picked = np.arange(0, len(log), stride)
    t, rows = log.raw()
    names = Names(log.names, log.fingers)
    places, turns, forces, origins = [], [], [], []
    for k in picked:
        pose.update(Row(float(t[k]), rows[k], names))
        places.append(pose.data.xpos[bodies].copy())
        turns.append(pose.data.xquat[bodies][:, [1, 2, 3, 0]].copy())
        forces.append(pose.forces * 0.006)
        origins.append(pose.places)
    index = [rr.TimeColumn("t", duration=t[picked])]
    where, turned = np.array(places), np.array(turns)
    for i, body in enumerate(bodies):
        columns = rr.Transform3D.columns(translation=where[:, i], quaternion=turned[:, i])
        stream.send_columns(f"scene/{_name(model, body)}", index, columns)
    n = len(scene.fingers)
    arrows = rr.Arrows3D.columns(origins=np.concatenate(origins), vectors=np.concatenate(forces))
    stream.send_columns("scene/forces", index, arrows.partition([n] * len(picked)))
    error = pose_errors(log.pose("object")[picked], log.pose("desired")[picked])
    scalars = {
        "error/position_mm": 1e3 * np.linalg.norm(error[:, :3], axis=1),
        "error/orientation_mrad": 1e3 * np.linalg.norm(error[:, 3:], axis=1),
        **{f"quality/{name}": log[name][picked] for name in ("Q", "threshold")},
        **{f"force/{name}": log[f"measured_force_{name}"][picked] for name in log.fingers},
        "safe_mode": log["safe_mode"][picked],
    }
    for name, values in scalars.items():
        stream.send_columns(f"plots/{name}", index, rr.Scalars.columns(scalars=np.nan_to_num(values)))
    stream.flush()
    return len(picked)


def _name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"body{body}"
