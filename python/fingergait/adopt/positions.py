"""Where an object could be in the hand: off the palm, within reach of every tip, with contacts on enough sides."""

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.clearance import Clearance
from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.library import Library
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.stroke import Poses, Rows

Array = NDArray[np.float64]

NEAR = 0.008  # m: a posture this near the surface is moved onto it
_TIPS, _DRAWS, _CELLS = 512, 96, 14


def object_positions(
    spec: ObjectSpec,
    clearance: Clearance,
    library: Library,
    frame: Array,
    options: SearchOptions,
    rng: np.random.Generator,
    funnel: Funnel,
) -> Poses:
    """At most `options.positions` poses of the object, the most promising first."""
    grid, spacing = _grid(library, rng)
    turn = np.zeros(len(grid)) if spec.symmetric else rng.uniform(0.0, np.pi / 2.0, len(grid))
    poses = Poses(grid, turn, frame)
    rotations = poses.rotation()
    room = np.empty(len(grid))
    for i in range(len(grid)):
        room[i] = clearance.palm_to_object(grid[i], rotations[i])
    free = room >= options.palm_clearance
    funnel.passes("room", int(free.sum()))
    poses = poses.take(np.flatnonzero(free))
    if not len(poses.position):
        funnel.misses("room", 0.0, "the object fits nowhere within the fingers' reach without touching the palm")
        return poses
    near, normals = _touches(spec, library, poses, options, funnel)
    poses = poses.take(near)
    if not len(near):
        return poses
    gap, count = _sides(normals, frame, rng)
    limit = np.pi + 2.0 * np.arctan(options.friction)
    ok = np.flatnonzero(gap < limit)
    funnel.passes("surround", len(ok))
    if not len(ok):
        found = np.rad2deg(gap.min())
        funnel.misses(
            "surround",
            0.0,
            f"with one finger away the others leave a gap of {found:.0f} degrees round the object, where friction "
            f"{options.friction:g} allows {np.rad2deg(limit):.0f}",
        )
        ok = np.argsort(gap)[: options.positions]
    worth = np.log2(count[ok] + 1.0) - 20.0 * np.maximum(0.0, gap[ok] / limit - 0.75)
    rank = ok[np.argsort(-worth, kind="stable")]
    return poses.take(_spread(poses.position, rank, 1.2 * spacing, options.positions))


def _grid(library: Library, rng: np.random.Generator) -> tuple[Array, float]:
    """Points (P, 3) that fill the box round all tip places, shifted at random, and their spacing."""
    tips = np.concatenate([centre[:_TIPS] for centre in library.centre])
    low, high = np.quantile(tips, 0.02, axis=0), np.quantile(tips, 0.98, axis=0)
    spacing = float((high - low).max()) / _CELLS
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points + rng.uniform(0.0, spacing, points.shape), spacing


def _touches(
    spec: ObjectSpec, library: Library, poses: Poses, options: SearchOptions, funnel: Funnel
) -> tuple[Rows, list[list[Array]]]:
    """Poses that every tip can nearly touch, and for each finger and pose the normals (k, 3) in W that it can touch."""
    count, rotations = len(poses.position), poses.rotation()
    normals: list[list[Array]] = []
    missed = np.zeros((count, len(library.chains)))
    for j, chain in enumerate(library.chains):
        tips = library.centre[j][:_TIPS]
        radius = chain.finger.tip_radius
        x = np.einsum("pji,ptj->pti", rotations, tips[None] - poses.position[:, None]).reshape(-1, 3)
        distance, normal = spec.distance(x)
        side = spec.touchable(x - distance[:, None] * normal, normal, options.rim * radius).reshape(count, -1)
        off = np.abs(distance - radius).reshape(count, -1)
        hit = (off < NEAR) & side
        missed[:, j] = np.where(side, off, np.inf).min(axis=1)
        normal_W = np.einsum("pij,ptj->pti", rotations, normal.reshape(count, -1, 3))
        normals.append([normal_W[p, hit[p]] for p in range(count)])
    all_touch = np.flatnonzero((missed < NEAR).all(axis=1))
    funnel.passes("reach", len(all_touch))
    if not len(all_touch):
        best = int(missed.max(axis=1).argmin())
        j = int(missed[best].argmax())
        by = f"by {1e3 * missed[best, j]:.0f} mm" if np.isfinite(missed[best, j]) else "its side altogether"
        funnel.misses(
            "reach", 0.0, f"where the other tips reach the object, finger {library.chains[j].finger.name} misses {by}"
        )
    return all_touch, [[own[p] for p in all_touch] for own in normals]


def _sides(normals: list[list[Array]], frame: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """For each pose: of drawn choices of contacts, the least of the widest gap (rad) between neighbours with any one
    finger away, seen along the axis; and the number of touches of the finger that has fewest."""
    n, count = len(normals), len(normals[0])
    least, fewest = np.empty(count), np.empty(count)
    for p in range(count):
        azimuth = np.empty((_DRAWS, n))
        for j in range(n):
            plane = normals[j][p] @ frame[:, :2]
            azimuth[:, j] = np.arctan2(plane[:, 1], plane[:, 0])[rng.integers(0, len(plane), _DRAWS)]
        least[p] = widest_gap(azimuth).min()
        fewest[p] = min(len(normals[j][p]) for j in range(n))
    return least, fewest


def widest_gap(azimuth: Array) -> Array:
    """The widest gap (N,) between neighbouring azimuths (N, n), rad, with the finger away that leaves the widest.

    With three fingers or fewer all stay: two contacts never surround an object.
    """
    n = azimuth.shape[1]
    widest = np.zeros(len(azimuth))
    for away in range(n) if n > 3 else [-1]:
        kept = np.sort(np.delete(azimuth, away, axis=1) if away >= 0 else azimuth, axis=1)
        gaps = np.diff(np.column_stack([kept, kept[:, 0] + 2.0 * np.pi]), axis=1)
        widest = np.maximum(widest, gaps.max(axis=1))
    return widest


def _spread(position: Array, rank: Rows, apart: float, most: int) -> Rows:
    """The first of `rank` that lie apart from each other, filled up with the first that don't."""
    kept: list[int] = []
    for index in rank:
        if len(kept) == most:
            break
        if not kept or np.linalg.norm(position[kept] - position[index], axis=1).min() >= apart:
            kept.append(int(index))
    rest = [int(index) for index in rank if int(index) not in kept]
    return np.array([*kept, *rest[: most - len(kept)]], dtype=np.intp)
