"""Which build of fingergait this is: rows of different builds are not comparable."""

import hashlib
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

import fingergait
from fingergait import _core


@cache
def build_id() -> str:
    """Digest of the installed package (compiled core, Python, models) and of the versions that results depend on."""
    digest = hashlib.sha256()
    for version in (_core.__version__, mujoco.mj_versionString(), np.__version__):
        digest.update(version.encode())
    root = Path(fingergait.__file__).resolve().parent
    for path in sorted([*root.glob("*.py"), root / "campaign" / "trial.py", Path(_core.__file__)]):
        digest.update(path.name.encode() + path.read_bytes())
    models = root / "models"
    for path in sorted([*models.glob("*.xml"), *(models / "controllers").glob("*.json")]):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
