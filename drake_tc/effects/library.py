"""All effects, in the order in which ties are broken: the simpler and commoner cause first, other packages' last."""

from collections.abc import Sequence

from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.effects.asymmetric_friction import AsymmetricFriction, CoulombAsymmetry
from drake_tc.effects.backlash import Backlash
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.cable_spring import CableSpring, SpringBesideWeight
from drake_tc.effects.check import checked_effect
from drake_tc.effects.coulomb import Coulomb
from drake_tc.effects.current_lag import CommandLag, CurrentLag, WindingLag
from drake_tc.effects.deadzone import Deadzone
from drake_tc.effects.delay import CommandDelay, Delay
from drake_tc.effects.directional_efficiency import DirectionalEfficiency
from drake_tc.effects.drive_compression import DriveCompression
from drake_tc.effects.effort_bias import EffortBias
from drake_tc.effects.elasticity import Elasticity
from drake_tc.effects.encoder_eccentricity import EncoderEccentricity, SeparateEncoderEccentricity
from drake_tc.effects.encoder_offset import EncoderOffset
from drake_tc.effects.encoder_ripple import EncoderRipple
from drake_tc.effects.gain_ripple import GainRipple
from drake_tc.effects.load_dependent_friction import LoadDependentFriction
from drake_tc.effects.load_stribeck import LoadStribeck
from drake_tc.effects.load_tilt import LoadTilt
from drake_tc.effects.payload import DeclaredGainPayload, OwnArmPayload, Payload, PendulumPayload, SlidingPayload
from drake_tc.effects.position_dependent_friction import LinearPositionFriction, PositionDependentFriction
from drake_tc.effects.position_dependent_load import PositionDependentLoad
from drake_tc.effects.presliding_hysteresis import PreslidingHysteresis, SlidingPresliding
from drake_tc.effects.quadratic_viscous import QuadraticViscous
from drake_tc.effects.rotor_inertia import RotorInertia
from drake_tc.effects.run_in_friction import RunInFriction
from drake_tc.effects.saturation import Saturation, ServoSaturation, SupplyLimit
from drake_tc.effects.sensor_delay import PositionSensorDelay, TorqueSensorDelay
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.servo_integrator import ServoIntegrator
from drake_tc.effects.static_friction import StaticFriction
from drake_tc.effects.stribeck import Stribeck
from drake_tc.effects.supply_sag import SupplySag
from drake_tc.effects.thermal_friction import ThermalFriction
from drake_tc.effects.torque_ripple import TorqueRipple
from drake_tc.effects.torque_sensor_bias import TorqueSensorBias
from drake_tc.effects.torque_sensor_drift import TorqueSensorDrift
from drake_tc.effects.torque_sensor_gain import TorqueSensorGain
from drake_tc.effects.unknown_load import UNKNOWN_LOADS
from drake_tc.effects.velocity_sign_switch import VelocitySignSwitch
from drake_tc.effects.viscous import Viscous
from drake_tc.effects.viscous_power import ViscousPower
from drake_tc.effects.winding_heat import WindingHeat
from drake_tc.effects.winding_temperature import WindingTemperature
from drake_tc.errors import ParamsError
from drake_tc.extensions import EFFECTS

LIBRARY: tuple[Effect, ...] = (
    Viscous(),
    Coulomb(),
    RotorInertia(),
    Stribeck(),
    QuadraticViscous(),
    TorqueSensorBias(),
    EncoderOffset(),
    Deadzone(),
    LoadDependentFriction(),
    TorqueSensorDrift(),
    TorqueSensorGain(),
    VelocitySignSwitch(),
    ServoIntegrator(),
    Saturation(),
    ServoGain(),
    SupplySag(),
    SupplyLimit(),
    CommandDelay(),
    Delay(),
    TorqueSensorDelay(),
    PositionSensorDelay(),
    CurrentLag(),
    WindingLag(),
    Payload(),
    PendulumPayload(),
    DeclaredGainPayload(),
    OwnArmPayload(),
    SlidingPayload(),
    CableSpring(),
    SpringBesideWeight(),
    AsymmetricFriction(),
    CoulombAsymmetry(),
    EffortBias(),
    ThermalFriction(),
    WindingTemperature(),
    PreslidingHysteresis(),
    SlidingPresliding(),
    TorqueRipple(),
    LinearPositionFriction(),
    PositionDependentFriction(),
    Backlash(),
    Elasticity(),
    EncoderEccentricity(),
    SeparateEncoderEccentricity(),
    EncoderRipple(),
    DirectionalEfficiency(),
    PositionDependentLoad(),
)
"""Effects that a search looks for unasked, in the order in which ties are broken."""

UNCOMMON: tuple[Effect, ...] = (
    LoadStribeck(),
    DriveCompression(),
    WindingHeat(),
    LoadTilt(),
    GainRipple(),
    StaticFriction(),
)
"""Effects that a search looks for only where LIBRARY leaves much unexplained: each resembles a more common one."""

MULTI_JOINT: tuple[Effect, ...] = (ViscousPower(), RunInFriction())
"""Effects that are looked for only in a robot: with all others where its links are fitted, else as uncommon ones."""

DECLARED_ONLY: tuple[Effect, ...] = (CommandLag(), ServoSaturation())
"""Effects that are part of a model only where they are declared: no search looks for them."""

BUILT_IN: tuple[Effect, ...] = (*LIBRARY, *UNCOMMON, *MULTI_JOINT, *UNKNOWN_LOADS, *DECLARED_ONLY)
"""Every effect of this package."""

PLACE = {effect.key: number for number, effect in enumerate((*LIBRARY, *UNCOMMON))}


def register_effect(effect: Effect | type[Effect]) -> None:
    """Add an effect to the library of this process, as if it were one file more in `drake_tc/effects`.

    Searches then look for it, model files may list it, rig files may declare it. A package does the same for every
    process, the command line included, by an entry point of the group `drake_tc.effects` whose name is the effect's id.

    Args:
        effect: An instance, or a class that is made without arguments.

    Raises:
        ParamsError: its id is taken, it lacks an attribute, or its columns have a wrong shape.

    Example:
        >>> class Seal(type(effect("viscous"))):
        ...     id = "seal"
        >>> register_effect(Seal)
        >>> effect("seal").id
        'seal'
    """
    name = getattr(effect, "id", None)
    if not isinstance(name, str) or not name.isidentifier():
        raise ParamsError(f"effect {effect!r}: expected an attribute `id` of letters, digits and underscores")
    form = getattr(effect, "form", "")
    made = checked_effect(f"{name}.{form}" if form else name, effect)
    if made.id in {known.id for known in BUILT_IN}:
        raise ParamsError(f"effect {made.id!r}: the library has an effect of this id")
    EFFECTS.add(made.key, made)


def registered_effects() -> tuple[Effect, ...]:
    """Effects of other packages: those that were registered, then those of entry points.

    Raises:
        ParamsError: an entry point cannot be loaded, or is no effect.
    """
    return tuple(EFFECTS.get(name, checked_effect) for name in EFFECTS.names())


def all_effects() -> tuple[Effect, ...]:
    """Every effect that a model may list."""
    return (*BUILT_IN, *registered_effects())


def looked_for(context: Context, effects: Sequence[Effect] | None = None) -> tuple[Effect, ...]:
    """The effects that a search over logs of this kind tries: `effects` where they are given, else the library."""
    if effects is not None:
        return tuple(effects)
    more = MULTI_JOINT if context.load == "links" else ()
    return tuple(e for e in (*LIBRARY, *more, *registered_effects()) if context.joint_type in e.joint_types)


def uncommon(context: Context) -> tuple[Effect, ...]:
    """The effects that are tried over logs of this kind where the others leave much."""
    return (*UNCOMMON, *(MULTI_JOINT if context.load == "robot" else ()))


def place(key: str) -> int:
    """Where an effect stands in the library, those of other packages last; 0 for what is only ever declared."""
    if key in PLACE:
        return PLACE[key]
    names = EFFECTS.names()
    return len(PLACE) + names.index(key) if key in names else 0


def effect(key: str) -> Effect:
    """The effect called `key` (`id` or `id.form`; a bare id takes the first form).

    Raises:
        ParamsError: there is no such effect; the message lists those there are.

    Example:
        >>> effect("stribeck").kind
        'friction'
    """
    every = (*BUILT_IN, *registered_effects())
    named = next((e for e in every if e.key == key), None) or next((e for e in every if e.id == key), None)
    if named is not None:
        return named
    ids = sorted({e.id for e in all_effects()})
    raise ParamsError(f"no effect {quoted(key)}{did_you_mean(key, ids)}; effects: {', '.join(ids)}")
