"""Errors of one joint, told in its units."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

P = ParamSpec("P")
R = TypeVar("R")
OfJoint = Callable[Concatenate[Sequence[Run], Sequence[Run], Rig, str, P], R]


def errors_in_joint_units(function: OfJoint[P, R]) -> OfJoint[P, R]:
    """The function of (training runs, held-out runs, rig, joint, ...), whose errors have the units of the joint."""

    @wraps(function)
    def told(
        train: Sequence[Run], held: Sequence[Run], rig: Rig, joint: str, /, *args: P.args, **kwargs: P.kwargs
    ) -> R:
        try:
            return function(train, held, rig, joint, *args, **kwargs)
        except IdentificationError as error:
            if not rig.units_of(joint).slides:
                raise
            raise IdentificationError(rig.units_of(joint).text(str(error))) from error

    return told
