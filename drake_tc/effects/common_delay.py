"""A delay that all joints of a robot share."""

from typing import ClassVar

from drake_tc.effects.context import Parameter
from drake_tc.effects.delay import Delay


class CommonDelay(Delay):
    """y*(t) = y(t - d) with one d for all joints: the fit of a single joint does not move it.

    No search of a joint looks for it; `drake_tc.diagnosis.robot.common_delay` finds it on all joints together.
    """

    shapes: ClassVar[tuple[Parameter, ...]] = ()
    given_shapes: ClassVar[tuple[Parameter, ...]] = Delay.shapes
