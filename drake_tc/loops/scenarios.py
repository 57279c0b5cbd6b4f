"""Scenario files: what all of them have, their checks, and how they are read.

`ScenarioBase`: how every scenario is read from its file, and changed.

Files of scenarios: many by name, one extending another, with changes laid over.

What every scenario's fields must be, whatever it runs.

The parts of a scenario, each one mapping in its YAML file: gains, filters, motion, forces, pushes and objects.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from drake_tc.actuation.model import ActuatorModel
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.records import (
    Checked,
    Finite,
    FromZero,
    Positive,
    Range,
    Six,
    Three,
    ThreeFromZero,
    ThreePositive,
    read_record,
)
from drake_tc.config.yaml_file import merged, parse_yaml, read_yaml
from drake_tc.errors import ParamsError


def scenario_names(path: Path) -> list[str]:
    """The scenarios of a file, in its order.

    Raises:
        ParamsError: the file cannot be read.
    """
    return list(read_mapping(path))


def changes_in(text: str) -> dict[str, Any]:
    """The fields in a YAML text.

    Raises:
        ParamsError: text that is no mapping.
    """
    changes = parse_yaml(text, "scenario text")
    if not isinstance(changes, dict):
        raise ParamsError(f"scenario text: expected a mapping of fields, got {quoted(text)}")
    return changes


def read_mapping(path: Path) -> dict[str, Any]:
    """A YAML file's top-level mapping.

    Raises:
        ParamsError: no such file, not YAML, or no mapping.
    """
    document = read_yaml(path)
    if not isinstance(document, dict):
        raise ParamsError(f"{path}: expected a mapping, got {quoted(document)}")
    return document


def _extended(path: Path, document: dict[str, Any], name: str, seen: tuple[str, ...]) -> dict[str, Any]:
    if name not in document:
        hint = did_you_mean(str(name), document)
        raise ParamsError(f"{path}: no scenario {quoted(name)}{hint}; scenarios here: {', '.join(document)}")
    if name in seen:
        raise ParamsError(f"{path}: {name}: extends itself ({' -> '.join((*seen, name))})")
    if not isinstance(document[name] or {}, dict):
        raise ParamsError(f"{path}: {name}: expected a mapping of fields, got {quoted(document[name])}")
    own = dict(document[name] or {})
    parent = own.pop("extends", None)
    if parent is not None and not isinstance(parent, str):
        raise ParamsError(f"{path}: {name}.extends: expected the name of a scenario, got {quoted(parent)}")
    return own if parent is None else merged(_extended(path, document, parent, (*seen, name)), own)


SEEDS = 2**64
"""How many seeds there are: what the counter-based generators take as a key."""
Seed = Annotated[int, Range("a whole number from 0 to 2^64 - 1", 0, SEEDS - 1, whole=True)]


class ScenarioBase(Checked):
    """Base of the frozen dataclasses that are scenarios; `source`, where one has it, is the folder of its files."""

    SCHEMA: ClassVar[str] = ""
    """What `drake-tc schema` calls its file."""
    seed: Seed
    """Of all random numbers."""
    duration: Positive
    """Simulated time [s]."""

    @classmethod
    def load(cls, path: Path, name: str, text: str | None = None) -> Self:
        """The scenario `name` of a file, with the fields in `text` changed.

        Args:
            path: Scenario file.
            name: Scenario.
            text: YAML mapping of fields to change, like `{duration: 3.0, gains: {k6: 0.25}}`.

        Raises:
            ParamsError: no such file or scenario, an unknown field, or a value that is not possible.
        """
        kind: Any = cls
        folder = {"source": str(path.parent)} if any(field.name == "source" for field in fields(kind)) else {}
        document = _extended(path, read_mapping(path), name, ())
        document = document if text is None else merged(document, changes_in(text))
        return read_record(cls, document, str(path), more=folder, within=name)

    def changed(self, **changes: Any) -> Self:
        """The same with other values; those that are None stay."""
        own: Any = self
        other: Self = replace(own, **{name: value for name, value in changes.items() if value is not None})
        return other

    def path(self, name: str) -> Path:
        """A file that the scenario names, relative to the file it stands in."""
        own: Any = self
        return Path(own.source) / name


def check_masses(factors: Mapping[str, float]) -> None:
    """Factors on the masses of links are positive.

    Raises:
        ParamsError: one is not; names the link.
    """
    for link, factor in factors.items():
        if not 0.0 < factor < math.inf:
            raise ParamsError(f"masses.{link}: expected a positive factor, got {factor}")


@dataclass(frozen=True)
class GainSpec:
    """Feedback gains, the same for all joints unless `by_joint` says otherwise (Del Prete et al., 2016, eq. 10 to 14).

    Attributes:
        k6: Position feedback relative to the stiffness of the vendor's servo: K6 = K_tau (1 + Kp) Ks [-].
        k7: Velocity feedback K7 = K_tau (1 + Kp) Kd [s].
        kp: Torque feedback Kp [-].
        ki: Integral of the torque error [1/s].
        kf: Force feedback Kf [-], one number or six [fx fy fz tx ty tz].
        by_joint: Gains of single joints, `{JOINT: {k6: ...}}` (kf has no joint).
    """

    k6: float = 1.0
    k7: float = 0.0
    kp: float = 2.0
    ki: float = 0.0
    kf: float | tuple[float, ...] = 0.0
    by_joint: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.kf, tuple) and len(self.kf) != 6:
            raise ParamsError(f"gains.kf: expected one number or six [fx fy fz tx ty tz], got {len(self.kf)}")

    def of(self, name: str, joints: tuple[str, ...]) -> list[float]:
        """The gain `name` of every joint.

        Raises:
            ParamsError: `by_joint` names a joint or a gain that is not there.
        """
        for joint, gains in self.by_joint.items():
            if joint not in joints:
                raise ParamsError(f"gains.by_joint: no joint {joint!r}; joints: {', '.join(joints)}")
            for gain in gains:
                if gain not in ("k6", "k7", "kp", "ki"):
                    raise ParamsError(f"gains.by_joint.{joint}: no gain {gain!r}; possible: k6, k7, kp, ki")
        return [float(self.by_joint.get(joint, {}).get(name, getattr(self, name))) for joint in joints]


@dataclass(frozen=True)
class FilterSpec(Checked):
    """Savitzky–Golay filters (Del Prete et al., 2016, section 2), evaluated in the middle of the window.

    Attributes:
        window: Length [samples].
        encoder_order: Order of the polynomial for encoders.
        inertial_order: Order of the polynomial for IMU and F/T sensors.

    Example:
        >>> TorqueLoopSpec(filters=FilterSpec(window=40)).filters.encoder_order
        2
    """

    window: Annotated[int, Range("a whole number from 1 to 10000", 1, 10_000, whole=True)] = 80
    encoder_order: int = 2
    inertial_order: int = 1


@dataclass(frozen=True)
class ModelFactors(Checked):
    """Factors on what the controller believes of every drive: an error of the model, on purpose.

    Attributes:
        k_tau: Factor on the drive gain K_tau [-].
        k_v: Factor on K_v = K_tau x viscous friction [-].
    """

    k_tau: Positive = 1.0
    k_v: FromZero = 1.0


@dataclass(frozen=True)
class SuspensionSpec(Checked):
    """Springs and dampers that carry the base, which then floats: a bushing between the world and a point of it.

    At the base's pose in the robot file the springs carry the robot's weight; the rest of the balance it finds itself.

    Attributes:
        stiffness, damping: Stiffness and damping along the world's axes [N/m, N s/m].
        turn_stiffness, turn_damping: The same about roll, pitch and yaw [N m/rad, N m s/rad].
        point: Point of the base link at which the springs act [m].
    """

    stiffness: ThreeFromZero
    damping: ThreeFromZero
    turn_stiffness: ThreeFromZero
    turn_damping: ThreeFromZero
    point: Three = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stiffness[2] <= 0.0:
            raise ParamsError("suspension.stiffness: expected a positive one along z, which carries the weight, got 0")


@dataclass(frozen=True)
class SinusoidSpec(Checked):
    """q(t) = centre + (start + growth t) sin(2 pi f t).

    Attributes:
        frequency_hz: Frequency f [Hz].
        start: Amplitude at t = 0 [rad].
        growth: Growth of the amplitude [rad/s].
    """

    frequency_hz: Positive
    start: Finite = 0.0
    growth: Finite = 0.0


@dataclass(frozen=True)
class MotionSpec:
    """Where the joints are to be: the posture, knots over it, sinusoids over that.

    Attributes:
        posture: Positions [rad] by joint. Default: the posture of the robot file.
        times: Times of the knots [s]; the first one is 0.
        knots: Positions at these times [rad], by joint; other joints keep the posture.
        sinusoids: Growing sinusoids that are added, by joint.
    """

    posture: Mapping[str, float] = field(default_factory=dict)
    times: tuple[float, ...] = ()
    knots: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    sinusoids: Mapping[str, SinusoidSpec] = field(default_factory=dict)


@dataclass(frozen=True)
class ForceSpec(Checked):
    """f(t) = offset + amplitude sin(2 pi f (t - begin)), risen from `begin` on over `ramp`.

    Attributes:
        offset: Constant part [fx fy fz tx ty tz] [N, N m].
        amplitude: Amplitude of the sine [fx fy fz tx ty tz] [N, N m].
        frequency_hz: Frequency f [Hz].
        begin: Start [s].
        ramp: Duration of the rise [s].
    """

    offset: Six = (0.0,) * 6
    amplitude: Six = (0.0,) * 6
    frequency_hz: Positive = 0.5
    begin: Finite = 0.5
    ramp: Positive = 0.5


@dataclass(frozen=True)
class PushSpec(Checked):
    """A wrench on a link in world axes, risen and fallen as sin^2 within [begin, begin + duration].

    Attributes:
        link: Name of the link.
        begin: Start [s].
        duration: Duration [s].
        force: Largest force [fx fy fz] [N].
        torque: Largest torque [tx ty tz] [N m].
        point: Where the force acts, in the link's frame [m].
    """

    link: str
    begin: Finite
    duration: Positive
    force: Three = (0.0, 0.0, 0.0)
    torque: Three = (0.0, 0.0, 0.0)
    point: Three = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ObjectSpec(Checked):
    """A rigid box, fixed to the world.

    Attributes:
        size: Lengths of the edges [m].
        xyz: Position of the centre [m].
        rpy: Roll, pitch and yaw [rad].
        friction: Coefficient of friction [-].
    """

    size: ThreePositive
    xyz: Three
    rpy: Three = (0.0, 0.0, 0.0)
    friction: FromZero = 0.8


def erring(
    models: Iterable[ActuatorModel], factors: Mapping[str, float], where: str = "model_factors"
) -> list[ActuatorModel]:
    """What a controller takes drives for: their models with errors, on purpose.

    Args:
        models: The simulated drives.
        factors: `gain` or an effect, to a factor on all its parameters.
        where: Place of the factors in the scenario.

    Raises:
        ParamsError: a factor for what no drive has.
    """
    drives = list(models)
    known = sorted({"gain", *(value.key for model in drives for value in model.effects)})
    if strange := [name for name in factors if name not in known]:
        raise ParamsError(f"{where}: the models have no {strange[0]!r}; possible: {', '.join(known)}")
    out = []
    for model in drives:
        drive = replace(model.drive, gain=model.drive.gain * factors.get("gain", 1.0))
        effects = [
            replace(value, parameters={k: factors.get(value.key, 1.0) * v for k, v in value.parameters.items()})
            for value in model.effects
        ]
        out.append(replace(model, drive=drive, effects=tuple(effects)))
    return out
