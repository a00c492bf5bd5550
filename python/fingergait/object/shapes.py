"""Shapes of the manipulated object: what a scenario's `object.shape` and `object.size` mean.

The object's frame O has its origin at the centre of mass of the homogeneous body and z along its axis. `cone` is a
truncated cone, built as a convex mesh; MuJoCo has the other shapes itself.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError

Array = NDArray[np.float64]

SIZES: dict[str, tuple[str, ...]] = {
    "cylinder": ("radius", "half-height"),
    "ellipsoid": ("half-axis x", "half-axis y", "half-axis z"),
    "box": ("half-side x", "half-side y", "half-side z"),
    "cone": ("bottom radius", "top radius", "half-height"),
}
_GEOMS = {
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}
_CONE_FACETS = 256  # the mesh then lies within 2 um of the cone at a radius of 25 mm


@dataclass(frozen=True)
class Shape:
    """A homogeneous body: `kind` is a key of `SIZES`, `size` its lengths in m."""

    kind: str
    size: tuple[float, ...]

    def __post_init__(self) -> None:
        meaning = SIZES[self.kind]
        if len(self.size) != len(meaning) or not all(np.isfinite(self.size)) or min(self.size) <= 0.0:
            expected = f"{len(meaning)} lengths > 0 m ({', '.join(meaning)}) for a {self.kind}"
            raise ConfigError(f"object.size: expected {expected}, found {list(self.size)}")

    @property
    def bottom(self) -> float:
        """Height of O above the body's lowest point when it stands upright, m."""
        if self.kind == "cone":
            lower, upper, half = self.size
            return half * (1.0 + _cone_moment(lower, upper, 1) / _cone_moment(lower, upper, 0))
        return self.size[-1]

    @property
    def mark(self) -> tuple[float, ...]:
        """Ends (6,) in O of a line on the top along x, m, by which a picture shows how far the body has turned."""
        if self.kind == "ellipsoid":
            x, _, z = self.size
            return (0.0, 0.0, z, 0.8 * x, 0.0, 0.6 * z)
        radius = self.size[1] if self.kind == "cone" else self.size[0]
        top = 2.0 * self.size[2] - self.bottom if self.kind == "cone" else self.size[-1]
        return (0.0, 0.0, top, 0.9 * radius, 0.0, top)

    def inertia(self, mass: float) -> Array:
        """Principal moments (3,) about O of the homogeneous body of this mass, kg m^2."""
        s = np.asarray(self.size)
        if self.kind == "box":
            squares = s**2 / 3.0
        elif self.kind == "ellipsoid":
            squares = s**2 / 5.0
        elif self.kind == "cylinder":
            squares = np.array([s[0] ** 2 / 4.0, s[0] ** 2 / 4.0, s[1] ** 2 / 3.0])
        else:
            lower, upper, half = self.size
            area = _cone_moment(lower, upper, 0)
            centre = _cone_moment(lower, upper, 1) / area
            radial = _cone_moment(lower, upper, 0, power=4) / (4.0 * area)
            squares = np.array([radial, radial, half**2 * (_cone_moment(lower, upper, 2) / area - centre**2)])
        inertia: Array = mass * (squares.sum() - squares)  # I_xx = m (<y^2> + <z^2>), and so on
        return inertia

    def add_to(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str) -> mujoco.MjsGeom:
        """The shape's geom called `name`, added to `body` of `spec` with the body's frame as O."""
        if self.kind != "cone":
            size = (*self.size, 0.0, 0.0)[:3]
            return body.add_geom(name=name, type=_GEOMS[self.kind], size=size)
        spec.add_mesh(name=name, uservert=self._cone_vertices().ravel())
        return body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)

    def _cone_vertices(self) -> Array:
        lower, upper, half = self.size
        angle = np.arange(_CONE_FACETS) * 2.0 * np.pi / _CONE_FACETS
        ring = np.column_stack([np.cos(angle), np.sin(angle)])
        bottom, top = -self.bottom, 2.0 * half - self.bottom
        rings = [np.column_stack([r * ring, np.full(_CONE_FACETS, z)]) for r, z in ((lower, bottom), (upper, top))]
        return np.vstack(rings)  # (2 facets, 3)


def _cone_moment(lower: float, upper: float, order: int, power: int = 2) -> float:
    """Integral of s^order r(s)^power over s in [-1, 1], r running linearly from `lower` to `upper`; exact."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    radius = 0.5 * ((1.0 - nodes) * lower + (1.0 + nodes) * upper)
    return float(weights @ (nodes**order * radius**power))
