"""Types shared by every module. SI units throughout; samples come first, then joints.

The acceleration of gravity.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
Call: TypeAlias = Callable[[float], object]
"""A function of the time [s] that reads and writes the arrays to which it is bound."""


GRAVITY = 9.81
"""Drake's own [m/s^2]."""
