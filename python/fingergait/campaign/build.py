"""Which build of fingergait this is: rows of different builds are not comparable."""

import hashlib
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

import fingergait
from fingergait import _core

_WINGS = ("hand", "object", "scenario", "sim", "run")
"""What decides how a run goes."""


@cache
def build_id() -> str:
    """Digest of the installed package (compiled core, Python, models) and of the versions that results depend on."""
    digest = hashlib.sha256()
    for version in (_core.__version__, mujoco.mj_versionString(), np.__version__):
        digest.update(version.encode())
    root = Path(fingergait.__file__).resolve().parent
    sources = [path for wing in _WINGS for path in (root / wing).rglob("*.py")]
    models = [*(root / "models").rglob("*.xml"), *(root / "models" / "controllers").glob("*.json")]
    for path in sorted([*sources, root / "campaign" / "trial.py", Path(_core.__file__), *models]):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
