"""A joint's logs as `close-loop` fits them: the most probable set of effects, its noise, and the posterior.

What is said of logs before a diagnosis, or of an experiment before it is made, follows from this one fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.diagnose import asked_of, decided, joint_model, without_attenuation
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.intervals import parameters_of
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.search import find
from drake_tc.effects.base import Context, Effect, JointNumbers, Shape, Signals, Signature
from drake_tc.effects.context import Obstacle
from drake_tc.effects.library import looked_for
from drake_tc.effects.sensor_delay import SensorDelay
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray


class LateEffort(SensorDelay):
    """y_meas(t) = y(t - d): a filter, a bus or another clock makes the record of the effort late.

    The drive then acts before its record does. In a servo, the derivatives of the command take up what such a delay
    does, so that a log does not tell it.
    """

    title = "delay of the recorded effort"
    equation = "y_meas(t) = y(t - delay)"
    form = "effort_record"
    delayed = ("effort",)
    ages_of: ClassVar[Mapping[str, float]] = {"effort": 1.0}
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the effort"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a measured torque, and an effort that does not hold the position."""
        if context.drive == "position_servo" or context.load != "torque":
            return "only a measured torque tells when an effort acts that does not hold the position"
        return ""

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Rate of the torque of the drive (T, 1)."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        return np.asarray(np.gradient(signals.expected_torque, signals.period))[:, None]


@dataclass(frozen=True)
class Noise:
    """What the most probable model leaves.

    Attributes:
        floor: What the sensors' noise alone leaves [N m].
        left: RMS that the model leaves, at least the floor [N m].
        independent: Number of rows that count.
    """

    floor: float
    left: float
    independent: float


@dataclass(frozen=True, eq=False)
class FittedJoint:
    """One joint with the set of effects that its logs make most probable.

    Attributes:
        prepared: Its filtered rows and its declared model.
        evidence: Under the noise that the set leaves.
        best: The set.
        final: The set without what noise takes off its coefficients, with the evidence at which it is linearised.
        floor: Noise floor [effort].
        usable: Effects that a diagnosis looks for.
        obstacles: Key of each other effect, and what stands in its way.
        known: Numbers of the joint where the logs do not tell them, because they are simulated.
    """

    prepared: Prepared
    evidence: Evidence
    best: Scored
    final: tuple[Evidence, Scored]
    floor: float
    usable: tuple[Effect, ...] = ()
    obstacles: Mapping[str, Obstacle] = field(default_factory=dict)
    known: JointNumbers | None = None

    def alone(self) -> "FittedJoint":
        """The declared model by itself, under the noise that the most probable set leaves."""
        declared = self.evidence.refined(self.evidence.score(self.evidence.model.declared))
        return replace(self, best=declared, final=(self.evidence, declared))

    @property
    def context(self) -> Context:
        """What the logs offer to effects."""
        return self.prepared.context

    @property
    def found(self) -> tuple[Term, ...]:
        """Effects that the logs show beside the declared model."""
        return tuple(t for t in self.best.terms if not self.evidence.model.is_declared(t.effect))

    @cached_property
    def parameters(self) -> Mapping[str, Mapping[str, Estimate]]:
        """Every parameter of the set with its 95 % interval, as `close-loop` reports it."""
        return parameters_of(*self.final)

    @property
    def gain(self) -> float:
        """K [effort/(N m)]."""
        return float(self.final[1].b[0])

    @property
    def noise(self) -> float:
        """Standard deviation of the white noise of rows that count [N m]."""
        return float(np.sqrt(self.best.posterior.variance)) / self.gain

    @cached_property
    def balance(self) -> Noise:
        """What the set leaves of the torque balance."""
        evidence, floor = self.evidence, self.floor / self.gain
        left = rms(evidence.residual(evidence.model.train, self.best)) / self.gain
        independent = evidence.noise.share * evidence.model.train.rows.index.size
        return Noise(floor, max(left, floor), max(independent, 3.0))

    @property
    def seconds(self) -> float:
        """Time in motion [s]."""
        return moving_seconds(self.prepared.train.samples)

    @property
    def per_second(self) -> float:
        """Rows that count in a second of motion."""
        return self.balance.independent / max(self.seconds, 1e-9)

    @cached_property
    def numbers(self) -> JointNumbers:
        """The declared model by itself in numbers, and the largest values of the rows."""
        if self.known is not None:
            return self.known
        context, s = self.context, self.evidence.model.train.samples.signals
        rows = self.evidence.model.train.samples.rows
        parameters = self.alone().parameters
        gain = parameters["drive"]["gain"].value
        declared = {
            name: max(parameters[name][name].value, 0.0) if name in parameters else 0.0
            for name in ("viscous", "coulomb", "rotor_inertia")
        }
        tau, link = s.load_torque[rows], s.link_inertia
        if link == 0.0 and np.ptp(tau) > 0.0:
            q, v, a = s.position[rows], s.velocity[rows], s.acceleration[rows]
            basis = np.column_stack([a, np.sin(q), np.cos(q), v])
            link = max(float(np.linalg.lstsq(basis, tau, rcond=None)[0][0]), 0.0)
        rotor = s.rotor_inertia + declared["rotor_inertia"]
        return JointNumbers(
            gain=gain,
            viscous=declared["viscous"],
            coulomb=declared["coulomb"],
            inertia=link + rotor,
            torque=context.effort / gain,
            effort=context.effort,
            speed=context.max_speed,
            span=float(np.ptp(context.position_span)),
            rotor=rotor,
        )


def moving_seconds(samples: Samples) -> float:
    """Time in motion [s]."""
    return float(np.count_nonzero(samples.moving)) * samples.signals.period


def fitted_joint(
    prepared: Prepared, effects: Sequence[Effect] | None = None, *, links_fitted: bool = False
) -> FittedJoint:
    """Search the rows of a prepared joint as a diagnosis does.

    Args:
        prepared: One joint with its declared model.
        effects: In place of the library.
        links_fitted: Whether a diagnosis fits the robot's links, so that it does not look for what these take up.
    """
    searched = replace(prepared, context=replace(prepared.context, load="links")) if links_fitted else prepared
    library = looked_for(prepared.context) if links_fitted and effects is None else effects
    asked = asked_of(searched, DiagnosisOptions(effects=None if library is None else tuple(library)))
    model, late = joint_model(prepared), LateEffort()
    own = (late,) if effects is None and late.unavailable(prepared.context) is None else ()
    sought = (*asked.usable, *own)
    decision = decided(find(Evidence(model).heard(model.declared, spread=False), sought), sought)
    return FittedJoint(
        prepared,
        decision.found.evidence,
        decision.best,
        without_attenuation(decision),
        decision.floor,
        tuple(asked.usable),
        dict(asked.obstacles),
    )


def rig_alone(rig: Rig, joint: str) -> Rig:
    """The rig of one joint; a load that a robot's model gives is a column here."""
    load = rig.load[joint]
    return replace(
        rig,
        joints=(joint,),
        drive={joint: rig.drive[joint]},
        load={joint: "torque" if isinstance(load, RobotLoad) else load},
        declared={joint: rig.declared[joint]},
        robot=None,
        coupled={},
    )
