"""Fingers as chains: from the fingertips inwards, which joints belong to which finger, and which to none."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from fingergait.hand.facts import Facts
from fingergait.hand.obstacle import Notes

NAMELESS = "fingergait_nameless_"
"""What the names begin with that the importer gives to what has none."""


@dataclass
class Chain:
    """One finger by names in the model: its tip's geom and the joints from the base on; `name` is the finger's."""

    name: str
    tip: int
    joints: list[int] = field(default_factory=list)


def find_chains(model: mujoco.MjModel, facts: Facts, notes: Notes) -> tuple[list[Chain], list[int]]:
    """Fingers of a compiled model in the order of their tips, and the joints that are in none and have to be held.

    A tip is what the facts name; else each sphere whose name ends in "tip"; else the last part that can touch of each
    chain of bodies that ends.
    """
    tips = _named(model, facts, notes) if facts.tips else (_by_name(model, notes) or _last_bodies(model))
    chains = [Chain(_label(model, geom), geom, _joints_to(model, geom)) for geom in tips]
    chains = [chain for chain in chains if chain.joints]
    left_out = [c for c in chains if c.name in facts.leave_out or model.geom(c.tip).name in facts.leave_out]
    for name in facts.leave_out:
        if not any(name in (c.name, model.geom(c.tip).name, _body(model, c.tip)) for c in chains):
            known = ", ".join(c.name for c in chains) or "none"
            notes.obstacle("facts: leave_out", f"a finger ({known})", repr(name), "correct the name")
    left_out += [c for c in chains if _body(model, c.tip) in facts.leave_out and c not in left_out]
    chains = [c for c in chains if c not in left_out]
    _tell_apart(chains)
    if not 2 <= len(chains) <= 6:
        found = f"{len(chains)} ({', '.join(c.name for c in chains) or 'none'})"
        notes.obstacle(
            "fingers",
            "2 to 6 fingers",
            found,
            'name their tips in the facts file: tips = ["<geom, body or site>", ...], or leave_out = ["<finger>"]',
        )
        return chains, []
    uses: dict[int, int] = {}
    for chain in chains:
        for joint in chain.joints:
            uses[joint] = uses.get(joint, 0) + 1
    held = [
        joint
        for joint in range(model.njnt)
        if uses.get(joint, 0) != 1 or facts.of(model.joint(joint).name).held is not None
    ]
    for chain in chains:
        chain.joints = [joint for joint in chain.joints if joint not in held]
        if not chain.joints:
            notes.obstacle(
                f"finger {chain.name}",
                "a joint of its own",
                "none",
                f'leave it out: leave_out = ["{chain.name}"]',
            )
    return chains, held


def _named(model: mujoco.MjModel, facts: Facts, notes: Notes) -> list[int]:
    geoms = []
    for name in facts.tips:
        geom = _resolve(model, name)
        if geom is None:
            notes.obstacle(
                "facts: tips",
                "the name of a geom, body or site with a part that can touch",
                repr(name),
                "correct the name, or give the part a collision geom",
            )
        else:
            geoms.append(geom)
    return geoms


def _resolve(model: mujoco.MjModel, name: str) -> int | None:
    """The geom that is meant by the name of a geom, body or site."""
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    if geom >= 0 and touches(model, geom):
        return int(geom)
    body = int(model.geom_bodyid[geom]) if geom >= 0 else mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if body >= 0:
        return _outermost(model, body)
    if site >= 0:
        geoms = _touching_parts(model, int(model.site_bodyid[site]))
        near = [(float(np.linalg.norm(model.geom_pos[g] - model.site_pos[site])), g) for g in geoms]
        return min(near)[1] if near else None
    return None


def _by_name(model: mujoco.MjModel, notes: Notes) -> list[int]:
    named = [g for g in range(model.ngeom) if model.geom(g).name.endswith("tip")]
    tips: list[int] = []
    for geom in named:
        chosen: int | None = geom
        if not touches(model, geom):
            chosen = _outermost(model, int(model.geom_bodyid[geom]))
            if chosen is None:
                continue
            notes.change(f"{model.geom(geom).name} can't touch anything: {geom_name(model, chosen)} is the tip instead")
        if chosen is not None and chosen not in tips:
            tips.append(chosen)
    return tips


def _last_bodies(model: mujoco.MjModel) -> list[int]:
    """The outermost part that can touch of each chain of bodies that has joints and ends."""
    parents = set(model.body_parentid[1:].tolist())
    ends = [b for b in range(1, model.nbody) if b not in parents and _joints_of(model, b)]
    tips: list[int] = []
    last: dict[int, list[int]] = {}
    for end in ends:
        last.setdefault(_joints_of(model, end)[-1], []).append(end)
    # A part that hangs on a finger's inner link ends a chain too, and is no finger.
    inner = {joint for end in ends for joint in _joints_of(model, end)[:-1]}
    for bodies in (bodies for joint, bodies in last.items() if joint not in inner):
        geoms: list[int] = []
        for body in bodies:
            while body and not _touching_parts(model, body):
                body = int(model.body_parentid[body])
            geoms += _touching_parts(model, body) if body else []
        if geoms:
            tips.append(_farthest(model, geoms))
    return tips


def touches(model: mujoco.MjModel, geom: int) -> bool:
    """True where the geom can touch anything: visual parts can't."""
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def _touching_parts(model: mujoco.MjModel, body: int) -> list[int]:
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    return [g for g in range(first, first + count) if touches(model, g)]


def _outermost(model: mujoco.MjModel, body: int) -> int | None:
    geoms = _touching_parts(model, body)
    return _farthest(model, geoms) if geoms else None


def _farthest(model: mujoco.MjModel, geoms: list[int]) -> int:
    """The geom that reaches farthest from the last joint before it."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)

    def reach(geom: int) -> float:
        joints = _joints_of(model, int(model.geom_bodyid[geom]))
        origin = data.xanchor[joints[-1]] if joints else np.zeros(3)
        return float(np.linalg.norm(data.geom_xpos[geom] - origin))

    return max(geoms, key=reach)


def _joints_to(model: mujoco.MjModel, geom: int) -> list[int]:
    return _joints_of(model, int(model.geom_bodyid[geom]))


def _joints_of(model: mujoco.MjModel, body: int) -> list[int]:
    """Joints between the world and `body`, from the base on."""
    joints: list[int] = []
    while body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints[:0] = range(first, first + count)
        body = int(model.body_parentid[body])
    return joints


def _body(model: mujoco.MjModel, geom: int) -> str:
    return str(model.body(int(model.geom_bodyid[geom])).name)


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom, or of what it is part of."""
    name = str(model.geom(geom).name)
    return f"a {_kind(model, geom)} of {_body(model, geom)}" if name.startswith(NAMELESS) else name


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Name of a joint, or of the body that it moves."""
    name = str(model.joint(joint).name)
    if not name.startswith(NAMELESS):
        return str(name)
    return "of " + str(model.body(int(model.jnt_bodyid[joint])).name)


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return str(mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower())


def _label(model: mujoco.MjModel, geom: int) -> str:
    name = model.geom(geom).name
    if name.startswith(NAMELESS):
        name = _body(model, geom)
    return str(name.removesuffix("tip").rstrip("_-. ") or name)


def _tell_apart(chains: list[Chain]) -> None:
    seen: dict[str, int] = {}
    for chain in chains:
        seen[chain.name] = seen.get(chain.name, 0) + 1
        if seen[chain.name] > 1:
            chain.name = f"{chain.name}_{seen[chain.name]}"
