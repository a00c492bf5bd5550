"""How far links, palm and object are from each other, by MuJoCo's own distance between the hand's collision shapes.

Bounding spheres decide most cases, for many postures at once; MuJoCo is asked about the rest.
"""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.kinematics import Chain, Frames, apply_all
from fingergait.adopt.view import HandView

Array = NDArray[np.float64]

FAR = 0.05  # m: distances are measured up to this


@dataclass(frozen=True)
class Asked:
    """Clearances asked, m: of links from the object, of a finger from itself and the palm, of the tip's shapes."""

    link: float
    own: float
    tip: float


@dataclass(frozen=True)
class Gap:
    """A distance in m, and the two things between which it is."""

    distance: float
    between: tuple[str, str] = ("", "")


class Clearance:
    """A hand and one object, in a private copy of the model."""

    def __init__(self, hand: HandView, spec: ObjectSpec, chains: tuple[Chain, ...]) -> None:
        self.hand, self.spec, self.chains = hand, spec, chains
        self._model, self._object = _with_object(hand, spec)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        bound = np.where(self._model.geom_rbound > 0.0, self._model.geom_rbound, np.inf)
        self._bound = bound
        self._palm = list(hand.palm)
        self._palm_centre = self._data.geom_xpos[self._palm].copy()
        self._is_tip = [np.isin(links, f.tip_geoms) for links, f in zip(hand.links, hand.fingers, strict=True)]
        self._own = [
            _Pairs(hand.own[j], (*links, *hand.palm), (*links, *hand.palm), bound) for j, links in enumerate(hand.links)
        ]
        self._between = {
            (j, k): _Pairs(pairs, hand.links[j], hand.links[k], bound) for (j, k), pairs in hand.between.items()
        }

    def palm_to_object(self, position: Array, rotation: Array) -> float:
        """The least distance, m, of the palm from an object there."""
        self._place(position, rotation)
        return min((self._distance(g, self._object, FAR) for g in self._palm), default=FAR)

    def first_blocked(
        self, j: int, frames: Frames, positions: Array, rotations: Array, lengths: list[int], asked: Asked
    ) -> list[tuple[int, str]]:
        """Of rows of postures of finger j, for each the first that is blocked, and by what.

        Parameters
        ----------
        j
            The finger.
        frames
            Its shapes at the T postures of all rows, one row after the other.
        positions, rotations
            The object's poses, (T, 3) and (T, 3, 3).
        lengths
            Number of postures in each row.
        asked
            Distances below which a posture is blocked.

        Returns
        -------
        list
            The number of postures in the row, and an empty text, where none is blocked.
        """
        x = apply_all(rotations, frames.centre - positions[:, None])  # (T, L, 3) in O
        apart = self.spec.distance(x.reshape(-1, 3))[0].reshape(x.shape[:2]) - self._bound[list(self.hand.links[j])]
        near = (apart < asked.link) | self._is_tip[j]
        everything = self._with_palm(frames)
        near_own = self._own[j].near(everything, everything, asked.own)
        found, begin = [], 0
        for length in lengths:
            for s in range(begin, begin + length):
                words = self._blocked(j, frames, s, positions[s], rotations[s], near[s], near_own[s], asked)
                if words:
                    found.append((s - begin, words))
                    break
            else:
                found.append((length, ""))
            begin += length
        return found

    def _blocked(
        self,
        j: int,
        frames: Frames,
        s: int,
        position: Array,
        rotation: Array,
        near: NDArray[np.bool_],
        near_own: NDArray[np.bool_],
        asked: Asked,
    ) -> str:
        links, is_tip = self.hand.links[j], self._is_tip[j]
        self._place(position, rotation)
        for i in near.nonzero()[0]:
            self._set(links[i], frames, s, int(i))
            if is_tip[i]:
                distance = self._distance(links[i], self._object, asked.link)
                if distance < -asked.tip:
                    return f"more than the tip's sphere touches, by {-1e3 * distance:.1f} mm"
                continue
            distance = self._distance(links[i], self._object, asked.link)
            if distance < asked.link:
                return f"{self.hand.geom_name(links[i])} within {1e3 * distance:.1f} mm of the object"
        for pair in near_own.nonzero()[0]:
            distance = self._exact_own(j, frames, s, int(pair), asked.own)
            if distance < asked.own:
                names = [self.hand.geom_name(geom) for geom in self._own[j].geoms[pair]]
                return f"{names[0]} within {1e3 * distance:.1f} mm of {names[1]}"
        return ""

    def link_to_object(self, j: int, frames: Frames, position: Array, rotation: Array) -> float:
        """The least distance, m, of finger j's links, without its tip, from the object, at the first of `frames`."""
        self._place(position, rotation)
        least = FAR
        for i, geom in enumerate(self.hand.links[j]):
            if not self._is_tip[j][i]:
                self._set(geom, frames, 0, i)
                least = min(least, self._distance(geom, self._object, FAR))
        return least

    def between(self, j: int, k: int, frames_j: Frames, frames_k: Frames, enough: float) -> Gap:
        """The least distance between fingers j < k over all pairs of their postures; exact below `enough`."""
        pairs = self._between[j, k]
        least = Gap(enough)
        near = pairs.near(frames_j.centre[:, None], frames_k.centre[None], enough)
        for a, b, pair in zip(*near.nonzero(), strict=True):
            first, second = pairs.geoms[pair]
            self._set(first, frames_j, int(a), int(pairs.first[pair]))
            self._set(second, frames_k, int(b), int(pairs.second[pair]))
            distance = self._distance(first, second, least.distance)
            if distance < least.distance:
                least = Gap(distance, (self.hand.geom_name(first), self.hand.geom_name(second)))
        return least

    def _with_palm(self, frames: Frames) -> Array:
        palm = np.tile(self._palm_centre, (len(frames.centre), 1, 1))
        return np.concatenate([frames.centre, palm], axis=1)

    def _exact_own(self, j: int, frames: Frames, s: int, pair: int, most: float) -> float:
        pairs, count = self._own[j], len(self.hand.links[j])
        a, b = pairs.geoms[pair]
        for geom, index in ((a, int(pairs.first[pair])), (b, int(pairs.second[pair]))):
            if index < count:
                self._set(geom, frames, s, index)
        return self._distance(a, b, most)

    def _place(self, position: Array, rotation: Array) -> None:
        self._data.geom_xpos[self._object] = position
        self._data.geom_xmat[self._object] = rotation.ravel()

    def _set(self, geom: int, frames: Frames, s: int, i: int) -> None:
        self._data.geom_xpos[geom] = frames.centre[s, i]
        self._data.geom_xmat[geom] = frames.rotation[s, i].ravel()

    def _distance(self, a: int, b: int, most: float) -> float:
        return float(mujoco.mj_geomDistance(self._model, self._data, a, b, most, None))


class _Pairs:
    """Pairs of geoms, their places in two lists of geoms, and how far apart their centres must be at least."""

    def __init__(
        self, pairs: tuple[tuple[int, int], ...], a: tuple[int, ...], b: tuple[int, ...], bound: Array
    ) -> None:
        self.geoms = pairs
        self.first = np.array([a.index(x) for x, _ in pairs], dtype=np.intp)
        self.second = np.array([b.index(x) for _, x in pairs], dtype=np.intp)
        self._bound = np.array([bound[x] + bound[y] for x, y in pairs])

    def near(self, a: Array, b: Array, enough: float) -> NDArray[np.bool_]:
        """(..., pairs): whether bounding spheres at centres (..., A, 3) and (..., B, 3) come nearer than `enough`."""
        d = a[..., self.first, :] - b[..., self.second, :]
        return np.asarray((d * d).sum(axis=-1) < (self._bound + enough) ** 2)


def _with_object(hand: HandView, spec: ObjectSpec) -> tuple[mujoco.MjModel, int]:
    """A copy of the hand's model in which the probe of the object's family has the object's size, and its geom."""
    model, probe = copy.copy(hand.model), hand.probes[spec.family]
    size = np.zeros(3)
    size[: len(spec.size)] = spec.size
    model.geom_size[probe] = size
    model.geom_rbound[probe] = spec.size[0] if spec.family == "ball" else np.linalg.norm(spec.size)
    return model, probe
