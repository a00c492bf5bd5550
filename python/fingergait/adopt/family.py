"""Families of objects: what a cylinder, a ball and a box are to a fingertip.

The object's frame O has its origin at the centre and z along the task axis, about which it is to turn.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.object.shapes import Shape

Array = NDArray[np.float64]

FAMILIES = ("cylinder", "ball", "box")
_STEEPEST = np.sin(np.deg2rad(50.0))  # of a ball's normal against the horizontal: beyond, a finger only carries


@dataclass(frozen=True)
class ObjectSpec:
    """An object of a family: `size` in m is (radius, half-height), (radius,) or three half-sides; `mass` in kg."""

    family: str
    size: tuple[float, ...]
    mass: float

    def __post_init__(self) -> None:
        lengths = {"cylinder": 2, "ball": 1, "box": 3}
        if self.family not in lengths:
            raise ConfigError(f"object: expected one of {', '.join(FAMILIES)}, found {self.family!r}")
        if len(self.size) != lengths[self.family] or not all(0.0 < x < np.inf for x in self.size):
            expected = f"{lengths[self.family]} lengths > 0 m for a {self.family}"
            raise ConfigError(f"object.size: expected {expected}, found {list(self.size)}")
        if not 0.0 < self.mass < np.inf:
            raise ConfigError(f"object.mass: expected a number > 0 kg, found {self.mass}")

    @classmethod
    def of_radius(cls, family: str, radius: float, height: float, mass: float) -> "ObjectSpec":
        """The member of `family` with this contact radius and, where it has one, this height, m."""
        sizes = {"cylinder": (radius, height / 2), "ball": (radius,), "box": (radius, radius, height / 2)}
        return cls(family, sizes.get(family, ()), mass)

    @property
    def shape(self) -> Shape:
        """The body as a scenario's `object.shape` and `object.size` state it."""
        if self.family == "ball":
            return Shape("ellipsoid", self.size * 3)
        return Shape(self.family, self.size)

    @property
    def radius(self) -> float:
        """Distance of the contacts from the axis, m; for a box the mean of its two half-sides."""
        return float(np.mean(self.size[:2])) if self.family == "box" else self.size[0]

    @property
    def symmetric(self) -> bool:
        """Whether it looks the same at every turn about the axis."""
        return self.family != "box"

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distances (N,), m, of points x (N, 3) in O from the surface, and outward normals (N, 3) there."""
        if self.family == "ball":
            length = np.linalg.norm(x, axis=1)
            return length - self.size[0], x / np.maximum(length, 1e-9)[:, None]
        if self.family == "box":
            return _corner(np.abs(x) - np.asarray(self.size), np.where(x < 0.0, -1.0, 1.0)[:, :, None] * np.eye(3))
        rho = np.hypot(x[:, 0], x[:, 1])
        radial = np.zeros_like(x)
        radial[:, :2] = x[:, :2] / np.maximum(rho, 1e-9)[:, None]
        axial = np.zeros_like(x)
        axial[:, 2] = np.where(x[:, 2] < 0.0, -1.0, 1.0)
        excess = np.column_stack([rho - self.size[0], np.abs(x[:, 2]) - self.size[1]])
        return _corner(excess, np.stack([radial, axial], axis=1))

    def touchable(self, place: Array, normal: Array, rim: float) -> NDArray[np.bool_]:
        """Whether contacts at `place` with outward `normal` (N, 3), in O, lie on the side, `rim` m from any edge."""
        if self.family == "ball":
            return np.asarray(np.abs(normal[:, 2]) <= _STEEPEST)
        if self.family == "cylinder":
            return np.asarray((np.abs(place[:, 2]) <= self.size[1] - rim) & (np.abs(normal[:, 2]) < 1e-3))
        inside = np.asarray(self.size) - np.abs(place) >= rim
        x_face = (np.abs(normal[:, 0]) > 1.0 - 1e-6) & inside[:, 1]
        y_face = (np.abs(normal[:, 1]) > 1.0 - 1e-6) & inside[:, 0]
        return np.asarray((x_face | y_face) & inside[:, 2])

    def __str__(self) -> str:
        names = {"cylinder": ("radius", "height"), "ball": ("radius",), "box": ("width", "depth", "height")}[
            self.family
        ]
        full = [1e3 * x if name == "radius" else 2e3 * x for name, x in zip(names, self.size, strict=True)]
        return f"{self.family}, " + ", ".join(f"{n} {x:.0f} mm" for n, x in zip(names, full, strict=True))


def _corner(excess: Array, normals: Array) -> tuple[Array, Array]:
    """Distance and normal to an intersection of k slabs: `excess` (N, k) over each, and their `normals` (N, k, 3)."""
    beyond = np.maximum(excess, 0.0)
    outside = np.linalg.norm(beyond, axis=1)
    deepest = np.argmax(excess, axis=1)
    rows = np.arange(len(excess))
    weights = np.zeros_like(excess)
    weights[rows, deepest] = 1.0
    is_out = outside > 0.0
    weights[is_out] = beyond[is_out] / outside[is_out, None]
    return np.where(is_out, outside, excess[rows, deepest]), np.einsum("nk,nki->ni", weights, normals)
