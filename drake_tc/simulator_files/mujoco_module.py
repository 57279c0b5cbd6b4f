"""MuJoCo, where it is installed."""

import os
from typing import Any


def mujoco_module() -> Any:
    """The module.

    Raises:
        ImportError: it is not installed.
        OSError: a library that it needs is missing.
    """
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn, so no display and no OpenGL are needed
    import mujoco  # type: ignore[import-untyped]

    return mujoco
