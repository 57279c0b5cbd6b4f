"""The velocity update of a tick: what the contacts carry, base velocity and centres of pressure."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.attitude import Attitude
from drake_tc.estimation.base.contact_switch import Slip, carries, slipping
from drake_tc.estimation.base.imu_filters import GRAVITY
from drake_tc.estimation.base.kinematics import BaseKinematics, Posture, skews
from drake_tc.estimation.base.sinking import Sinking, sinking
from drake_tc.estimation.base.soft_sole import SoftSole, soft_sole
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import CONTACT_FLAGS, BaseState
from drake_tc.estimation.base.valid_sample import ValidSample
from drake_tc.estimation.base.velocity import Soles, VelocityProblem, soles_of, solve_velocity
from drake_tc.types import FloatArray, IntArray

_LIMITED = CONTACT_FLAGS.index("limited")
_LEAST_LOAD = 1.0
"""Below which a load says nothing about a centre of pressure [N]."""
_FIRST = 1e-3
"""Share of `velocity_time` that the rest before the first tick is trusted."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What of a specification is worked out once.

    Attributes:
        spec: The specification.
        soles: Limits of the centres of pressure.
        flat: (k,) whether a contact is a sole; all_flat: whether all are.
        at: Indices of the soles, all of them as a slice.
        middle: Middle of each sole [m].
        limits: (make, break) of each contact [N].
        level: Whether the ground is level.
        soft: How each sole gives way; None of a rigid one; any_soft: whether any does.
    """

    spec: BaseEstimatorSpec
    soles: Soles
    flat: FloatArray
    all_flat: bool
    at: slice | IntArray
    middle: list[tuple[float, float]]
    limits: list[tuple[float, float]]
    level: bool
    soft: list[SoftSole | None]
    any_soft: bool

    @classmethod
    def of(cls, spec: BaseEstimatorSpec) -> "Setting":
        """Work it out.

        Raises:
            ParamsError: a sole that is not convex.
        """
        soles = soles_of(spec.contacts)
        soft = [soft_sole(contact) for contact in spec.contacts]
        whole = bool(soles.flat.all())
        return cls(
            spec=spec,
            soles=soles,
            flat=soles.flat,
            all_flat=whole,
            at=slice(None) if whole else np.flatnonzero(soles.flat),
            middle=[(x, y) for x, y in soles.middle.tolist()],
            limits=[(contact.make, contact.break_) for contact in spec.contacts],
            level=spec.ground == "level",
            soft=soft,
            any_soft=any(sole is not None for sole in soft),
        )


class Loads(NamedTuple):
    """What the contacts carry.

    Attributes:
        load: k [N]. on: Which carry load. new: Since this tick. changed: Whether any is new or off.
        wrench: (k, 6) [f; t] at the contacts, their axes [N, N m]. up: (k, 3) the vertical in them.
        pressure: k centres of pressure as measured [m].
    """

    load: list[float]
    on: list[bool]
    new: list[bool]
    changed: bool
    wrench: FloatArray
    up: FloatArray
    pressure: list[tuple[float, float]]


class Motion(NamedTuple):
    """What stage 1 finds.

    Attributes:
        velocity: (3,) ydot [m/s]. pressure: (k, 2) centres of pressure [m]. limited: Which soles end there.
        velocity_innovation: (3,) ydot less what the accelerometer carried on [m/s].
        slip: What was dropped. weight: (k,) loads of the contacts that count [N].
    """

    velocity: FloatArray
    pressure: FloatArray
    limited: list[bool]
    velocity_innovation: FloatArray
    slip: Slip
    weight: FloatArray


def find_loads(
    setting: Setting,
    kinematics: BaseKinematics,
    state: BaseState,
    sample: ValidSample,
    posture: Posture,
    pose: Attitude,
    switch: FloatArray,
) -> Loads:
    """What the contacts carry: external wrenches at the contacts, and which of them touch.

    Args:
        setting: Worked out once.
        kinematics: Of the robot.
        state: Before the tick.
        sample: Readings after validation.
        posture: Contacts against the base.
        pose: Orientation.
        switch: (k,) of `Readings`.
    """
    up = pose.up @ posture.rotation[:-1]
    wrench = kinematics.external_wrench(sample.wrench, -GRAVITY * up)
    force = wrench[:, 2]
    if not setting.all_flat:
        force = np.where(setting.flat > 0.0, force, np.sqrt((wrench[:, :3] ** 2).sum(axis=1)))
    load, was = force.tolist(), state.contacts[:, 0].tolist()
    on = carries(load, was, setting.limits, switch.tolist())
    new = [touches and not before for touches, before in zip(on, was, strict=True)]
    seen = zip(wrench.tolist(), on, setting.soles.flat.tolist(), setting.middle, strict=True)
    pressure = []
    for (_, _, fz, tx, ty, _), touches, flat, middle in seen:
        bearing = max(fz, _LEAST_LOAD)
        pressure.append((-ty / bearing, tx / bearing) if touches and flat else middle)
    return Loads(load, on, new, not all(on) or any(new), wrench, up, pressure)


def find_sinking(setting: Setting, state: BaseState, posture: Posture, loads: Loads) -> Sinking | None:
    """How soft soles give way; None where all are rigid.

    Args:
        setting: Worked out once.
        state: Before the tick.
        posture: Contacts against the base, turning with it.
        loads: What the contacts carry.
    """
    if not setting.any_soft:
        return None
    return sinking(setting.soft, posture, loads.on, loads.load, loads.pressure, state, setting.spec.period)


def find_motion(
    setting: Setting, state: BaseState, sample: ValidSample, posture: Posture, pose: Attitude, loads: Loads
) -> Motion:
    """Base velocity and centres of pressure.

    Args:
        setting: Worked out once.
        state: Before the tick.
        sample: Readings after validation.
        posture: Contacts against the base.
        pose: Orientation.
        loads: What the contacts carry.
    """
    spec, dt, first = setting.spec, setting.spec.period, not state.started
    reference = np.zeros(3)
    if not first:
        reference = (state.rotation @ (state.velocity + state.lever)) @ pose.predicted - posture.velocity[-1]
        if not sample.has_accel and not any(loads.on):
            reference = np.zeros(3)  # nothing says how the base moves: it is held
        elif sample.has_accel:
            reference += dt * (pose.accel - GRAVITY * pose.up)
    flat = setting.soles.flat
    pressure, spread = np.array(loads.pressure), flat * spec.cop_moment / np.maximum(loads.wrench[:, 2], _LEAST_LOAD)
    R, offset = posture.rotation[:-1], posture.velocity[:-1]
    matrix = skews(posture.rate[:-1]) @ R[:, :, :2]
    still = offset + (matrix @ pressure[:, :, None])[:, :, 0]
    before = Slip(state.drift, state.contacts[:, 2].tolist())
    new = [True] * len(loads.on) if first else loads.new
    slip = slipping(loads.on, new, loads.load, -still - reference, before, spec)
    rows = zip(loads.on, loads.load, slip.dropped, strict=True)
    forces = [max(force, _LEAST_LOAD) if touches and not dropped else 0.0 for touches, force, dropped in rows]
    total = sum(forces) or 1.0
    weight = np.array(forces)
    problem = VelocityProblem(
        reference=reference,
        trust=(_FIRST if first else 1.0) * spec.velocity_time / dt / spec.contact_velocity**2,
        matrix=matrix,
        still=still,
        pressure=pressure,
        spread=spread,
        weight=weight / total,
        deviation=spec.contact_velocity,
    )
    at_edge = bool(state.contact_flags[:, _LIMITED].any())
    velocity, pressure, limited = solve_velocity(problem, setting.soles, at_edge=at_edge)
    velocity_innovation = np.zeros(3) if first or not sample.has_accel else velocity - reference
    return Motion(velocity, pressure, limited, velocity_innovation, slip, weight)
