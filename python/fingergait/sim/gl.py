"""MuJoCo, imported so that a GL library that is named but missing costs the pictures and not the run.

MuJoCo loads the library that MUJOCO_GL names as it is imported, and fails if it can't. Import this module first.
"""

import os
import sys

WANTED = os.environ.get("MUJOCO_GL")
"""The GL library that the user named, if any."""

problem: str | None = None
"""Why that library can't be used, if it can't."""

try:
    import mujoco  # noqa: F401
except Exception as error:  # whatever the GL wrapper raises: it has no error of its own
    if not WANTED:
        raise
    problem = f"{type(error).__name__}: {error}"
    for name in [name for name in sys.modules if name.split(".")[0] == "mujoco"]:
        del sys.modules[name]
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco  # noqa: F401
