"""MuJoCo is imported without OpenGL: nothing is drawn here."""

import os

os.environ.setdefault("MUJOCO_GL", "disable")
