"""The complete model of the leg's drives from the experiment's logs, and what `close-loop` finds when one effect of it
is not declared.

Declared, values unknown: viscous and Coulomb friction, dead zone, velocity-sign switch, reflected rotor inertia. The
inertia is fitted although it is known, because a sampled simulation adds to it: its friction acts on the velocity at
the end of a step h, half a step after the effort, and b qdot(t + h/2) = b qdot + (b h/2) qddot. Held at the known value
the fit would pay for that with K_tau: up to 1 %, and up to 7 % without the swaying run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagrams.papers.delprete2016.identification import Experiment
from drake_tc.errors import IdentificationError
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig

COMPLETE = ("viscous", "coulomb", "rotor_inertia", "velocity_sign_switch", "deadzone")
CALIBRATION = 0.005
"""Tolerance of the F/T sensors' scale, as a share: a torque that reads 1 + s too large makes K_tau 1/(1 + s) too small.
No log of these sensors tells s; K_v = K_tau b does not depend on it."""


@dataclass(frozen=True)
class DriveEstimate:
    """One coefficient of the actuator model (Del Prete et al., 2016, eq. 6) against the truth of the simulation.

    Attributes:
        joint: Name.
        name: "K_tau" [rad/(N m)] or "K_v" [rad/(rad/s)].
        value: Identified.
        truth: Simulated.
        half: Half width of its 95 % interval, from the scatter of the samples alone.
        tolerance: What the F/T sensors' calibration may add, in the value's unit.
    """

    joint: str
    name: str
    value: float
    truth: float
    half: float
    tolerance: float

    @property
    def error(self) -> float:
        """Of the value, as a share of the truth."""
        return self.value / self.truth - 1.0

    def inside(self, factor: float = 1.0, *, calibrated: bool = False) -> bool:
        """Whether the truth lies within `factor` times the interval, tolerance included unless `calibrated`."""
        slack = 0.0 if calibrated else self.tolerance
        return abs(self.value - self.truth) <= factor * self.half + slack


@dataclass(frozen=True, eq=False)
class Logs:
    """The experiment's logs, read once."""

    experiment: Experiment
    rig: Rig
    train: Sequence[Run]
    held: Sequence[Run]
    unscaled: Sequence[Run]


def read_logs(experiment: Experiment) -> Logs:
    """Read the logs of the complete model's fit through the rig file beside them.

    Raises:
        RigError, LogError: files that cannot be used.
    """
    rig = load_rig(experiment.rig)
    groups = (experiment.train, experiment.held, experiment.unscaled)
    return Logs(experiment, rig, *(load_runs(files, rig) for files in groups))


def diagnose(logs: Logs, joint: str, hidden: str | None = None, seed: int = 0) -> JointResult:
    """`close-loop` on one joint, with the complete model declared but for `hidden`.

    Raises:
        IdentificationError: the runs cannot identify the declared model.
    """
    with threadpool_limits(1):
        options = replace(DiagnosisOptions(), seed=seed)
        return diagnose_joint(logs.train, logs.held, _rig(logs, joint, hidden), joint, options)


def control(logs: Logs, joint: str) -> JointResult:
    """The complete model without any search, on the logs whose F/T sensors have no scale error."""
    with threadpool_limits(1):
        options = DiagnosisOptions(effects=())
        return diagnose_joint(logs.unscaled, logs.held, _rig(logs, joint), joint, options)


def _rig(logs: Logs, joint: str, hidden: str | None = None) -> Rig:
    """The rig with all but `hidden` of the complete model declared, values unknown."""
    declared: dict[str, Any] = {joint: dict.fromkeys(name for name in COMPLETE if name != hidden)}
    return replace(logs.rig, declared={**logs.rig.declared, **declared})


def drive_estimates(result: JointResult, logs: Logs) -> tuple[DriveEstimate, DriveEstimate]:
    """K_tau and K_v = K_tau F_v of a joint, with their 95 % intervals, which include every nuisance of the diagnosis.

    Raises:
        IdentificationError: the result has no correlation of its parameters.
    """
    if result.correlation is None:
        raise IdentificationError(f"joint {result.joint}: expected a result with the correlation of its parameters")
    gain, viscous = (result.final_parameters[key][name] for key, name in (("drive", "gain"), ("viscous", "viscous")))
    truth = logs.experiment.truth[result.joint]
    true_viscous = next(e.parameters["viscous"] for e in truth.effects if e.key == "viscous")
    one, other = (0.5 * (e.ci95[1] - e.ci95[0]) / e.value for e in (gain, viscous))
    together = result.correlation.of("drive.gain", "viscous.viscous")
    half = gain.value * viscous.value * float(np.sqrt(one**2 + other**2 + 2.0 * together * one * other))
    own = (gain.value, truth.drive.gain, one * gain.value, CALIBRATION * gain.value)
    damping = (gain.value * viscous.value, truth.drive.gain * true_viscous, half, 0.0)
    return DriveEstimate(result.joint, "K_tau", *own), DriveEstimate(result.joint, "K_v", *damping)
