"""What a link of a robot whose links are fitted carries in some logs and not in others."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import RigError
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Payload:
    """An unknown load.

    Attributes:
        runs: Names of the logs in which it is carried; one load for each.
        link: Number of the link that carries it, in the order of the tree.
    """

    runs: tuple[str, ...]
    link: int

    def columns(self, links: FloatArray, run: str) -> FloatArray:
        """Columns (T, n, 10 m) of the m loads in one run: those of the link that carries them, 0 of other runs' loads.

        Args:
            links: (T, n, 10 n) columns of all links' parameters in this run.
            run: Its name.
        """
        size = len(LINK_PARAMETERS)
        own = links[:, :, size * self.link : size * (self.link + 1)]
        parts = [own if run == name else np.zeros_like(own) for name in self.runs]
        return np.concatenate([links[:, :, :0], *parts], axis=2)


def payload_of(rig: Rig, runs: Sequence[str], links: LinkModel) -> Payload:
    """The unknown load that a rig file declares.

    Args:
        rig: Of the robot.
        runs: Names of all logs.
        links: The robot's moving links.

    Raises:
        RigError: A log is not among the runs, the robot's joints move no link of that name, or the rig file names no
            link and the robot has several outermost ones.
    """
    load = next(iter(rig.load.values()))
    if not isinstance(load, RobotLoad) or not load.payload:
        return Payload((), 0)
    source, known = rig.source or "rig", links.tree.links
    for name in load.payload:
        if name not in runs:
            raise RigError(
                f"{source}: load: unknown_payload: no log {name!r}{did_you_mean(name, runs)}; logs: {', '.join(runs)}"
            )
    if not load.carrier and len(links.outermost) > 1:
        raise RigError(
            f"{source}: load: payload_link: the robot has several outermost links ({', '.join(links.outermost)}); name "
            "the one that carries the unknown load"
        )
    carrier = load.carrier or links.outermost[0]
    if carrier not in known:
        raise RigError(
            f"{source}: load: payload_link: no joint of the robot moves a link {carrier!r}"
            f"{did_you_mean(carrier, known)}; "
            f"links: {', '.join(known)}"
        )
    return Payload(load.payload, known.index(carrier))
