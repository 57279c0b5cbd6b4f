"""The actuators of all joints over one step (`drake_tc.actuation.joint_step`), and one joint's over a run.

A joint whose effects all have a compiled equation is computed from end to end. Drives and the other torque effects of
another one are evaluated by the caller, between two calls: the first leaves in `work` what they need and what the
compiled ones resist with, the second takes from there what they gave.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels import equations
from drake_tc.kernels import joint_layout as at
from drake_tc.kernels.compiling import (
    FLAG,
    MATRIX,
    OUT_MATRIX,
    OUT_VECTOR,
    REAL,
    TABLE,
    VECTOR,
    helper,
    kernel,
    together,
)
from drake_tc.kernels.equations import Push
from drake_tc.kernels.torque_equations import JointState
from drake_tc.kernels.torque_terms import parts_of
from drake_tc.types import FloatArray, IntArray

_dead_zone, _switched, _saturated = helper(equations.dead_zone), helper(equations.switched), helper(equations.saturated)
_delayed, _lagged, _integrated = helper(equations.delayed), helper(equations.lagged), helper(equations.integrated)
_wound_up, _turned_over = helper(equations.wound_up), helper(equations.turned_over)
_friction_step, _gear_torque = helper(equations.friction_step), helper(equations.gear_torque)


class Tables(NamedTuple):
    """Constants of all joints.

    Attributes:
        layout: (n, 11) see `joint_layout`.
        numbers: (n, 14) the same.
        drives: (D, 2) kind of each effect of a drive, and place of its memory.
        parameters: (D, 3) its numbers, in the order of the equation.
        terms: (E, 4) torque effects, see `joint_layout`.
        values: Their numbers.
        travels: (m,) of the hysteretic states [rad].
    """

    layout: IntArray
    numbers: FloatArray
    drives: IntArray
    parameters: FloatArray
    terms: IntArray
    values: FloatArray
    travels: FloatArray


class Inputs(NamedTuple):
    """What one joint is given in a step.

    Attributes:
        command: Effort or position.
        q: Position [rad].
        v: Velocity [rad/s].
        load: Torque on the link side [N m], NaN where only the motion tells it.
        celsius: Temperature [deg C].
        at_tick: Whether a sampling period has passed since the last update.
    """

    command: float
    q: float
    v: float
    load: float
    celsius: float
    at_tick: bool


class Asked(NamedTuple):
    """What an effect of the drive is given.

    Attributes:
        value: What the effects before it passed on.
        raw: Effort or command asked for.
        direction: Deflection of the bristle.
    """

    value: float
    raw: float
    direction: float


@helper
def through_drive(tables: Tables, d: int, asked: Asked, memory: FloatArray) -> float:
    """The value that effect d of the drives passes on; updates its own part of the memory of all joints."""
    value, raw, direction = asked.value, asked.raw, asked.direction
    kind, place, numbers = tables.drives[d, 0], tables.drives[d, 1], tables.parameters[d]
    passed: float = value
    if kind == at.DEAD_ZONE:
        passed = _dead_zone(value, numbers[0])
    elif kind == at.SWITCH:
        passed = _switched(value, raw, direction, numbers[0])
    elif kind == at.SATURATION:
        passed = _saturated(value, numbers[0])
    elif kind == at.DELAY:
        passed = _delayed(value, int(numbers[0]), numbers[1], memory, place)
    elif kind == at.LAG:
        passed = _lagged(value, numbers, memory, place)
    elif kind == at.INTEGRAL:
        passed = _integrated(value, raw, numbers, memory, place)
    return passed


@helper
def begin(memory: FloatArray, tables: Tables, j: int, now: Inputs, work: FloatArray) -> None:
    """Faults, load and bristle of joint j, and what its effects see, into its `work` (11,)."""
    layout, numbers = tables.layout[j], tables.numbers[j]
    first, q, v, command, load = layout[at.FIRST], now.q, now.v, now.command, now.load
    work[at.STATUS] = work[at.FAULT] = 0.0
    if not (np.isfinite(q) and np.isfinite(v)):
        return
    if not np.isfinite(command):
        work[at.FAULT], command = 1.0, memory[first + at.COMMAND]
    started, torque = memory[first + at.STARTED], memory[first + at.TORQUE]
    if started == at.JUST_STARTED:
        memory[first + at.STARTED] = 1.0
    elif now.at_tick:
        slowed = (v - memory[first + at.VELOCITY]) / numbers[at.PERIOD]
        memory[first + at.LOAD] = torque - numbers[at.INERTIA] * slowed
        if np.isnan(load) and not layout[at.GEARED]:
            load = torque - numbers[at.ROTOR] * slowed
    drive_q, drive_v = q, v
    if layout[at.GEARED]:
        drive_q, drive_v = memory[first + at.MOTOR], memory[first + at.MOTOR_VELOCITY]
        if np.isnan(load):
            load = torque
    else:
        moved = q - memory[first + at.POSITION]
        memory[first + at.DEFLECTION] = _wound_up(memory[first + at.DEFLECTION], moved)
        turn_over(memory, layout, tables.travels, moved)
        if np.isnan(load):
            load = memory[first + at.LOAD]
    work[at.STATUS], work[at.ACTED] = 1.0, command
    work[at.DRIVE_POSITION], work[at.DRIVE_VELOCITY], work[at.LOAD_TORQUE] = drive_q, drive_v, load


@helper
def turn_over(memory: FloatArray, layout: IntArray, travels: FloatArray, moved: float) -> None:
    """Carry one joint's hysteretic states over a motion [rad] that has happened."""
    if moved != 0.0:
        for k in range(layout[at.HYSTERETIC], layout[at.HYSTERETIC_END]):
            memory[k] = _turned_over(memory[k], moved, travels[k])


@helper
def resist(memory: FloatArray, tables: Tables, j: int, celsius: float, work: FloatArray) -> None:
    """Level, damping and rest of joint j's torque effects with compiled equations, into its `work` (11,)."""
    layout, numbers, terms, values = tables.layout[j], tables.numbers[j], tables.terms, tables.values
    q, v, tau = work[at.DRIVE_POSITION], work[at.DRIVE_VELOCITY], work[at.LOAD_TORQUE]
    direction = memory[layout[at.FIRST] + at.DEFLECTION]
    level, damping, rest = numbers[at.LEVEL], numbers[at.DAMPING], numbers[at.REST]
    for t in range(layout[at.TERMS], layout[at.TERMS_END]):
        own, state = values[terms[t, at.TERM_FIRST] : terms[t, at.TERM_END]], terms[t, at.TERM_STATE]
        z = memory[state] if state >= 0 else 0.0
        a, b, c = parts_of(terms[t, at.TERM_KIND], JointState(q, v, direction, tau, celsius, z), own)
        level, damping, rest = level + a, damping + b, rest + c
    work[at.NOW_LEVEL], work[at.NOW_DAMPING], work[at.NOW_REST] = level, damping, rest


@helper
def drive(memory: FloatArray, tables: Tables, j: int, work: FloatArray) -> None:
    """Effects of joint j's drive with compiled equations, into its `work` (11,)."""
    layout = tables.layout[j]
    direction, command = memory[layout[at.FIRST] + at.DEFLECTION], work[at.ACTED]
    target = command
    for d in range(layout[at.DRIVES], layout[at.EFFORT_DRIVES]):
        target = through_drive(tables, d, Asked(target, command, direction), memory)
    away = work[at.DRIVE_POSITION] if layout[at.SERVO] else 0.0
    asked, effort = command - away, target - away
    for d in range(layout[at.EFFORT_DRIVES], layout[at.DRIVES_END]):
        effort = through_drive(tables, d, Asked(effort, asked, direction), memory)
    work[at.ASKED], work[at.EFFORT] = asked, effort


@helper
def through_gear(memory: FloatArray, tables: Tables, j: int, now: Inputs, push: Push) -> tuple[float, float]:
    """Mean torque through the gear and mean friction over a step, see `drake_tc.actuation.joint_effects`.

    The memory's motor and bristle go to the end of the step.
    """
    first, numbers, q, v = tables.layout[j, at.FIRST], tables.numbers[j], now.q, now.v
    theta, omega, z = memory[first + at.MOTOR], memory[first + at.MOTOR_VELOCITY], memory[first + at.DEFLECTION]
    load, h, inertia = memory[first + at.LOAD], numbers[at.SUB_STEP], numbers[at.MOTOR_INERTIA]
    count = int(numbers[at.SUB_STEPS])
    gap, compliance, contact_time = numbers[at.HALF_GAP], numbers[at.COMPLIANCE], numbers[at.CONTACT_TIME]
    passed = rubbed_in_all = 0.0
    for _ in range(count):
        tau = _gear_torque(theta - q, omega - v, gap, compliance, contact_time)
        z, omega, rubbed = _friction_step(z, omega, Push(push.thrust - tau, push.level, push.damping), inertia, h)
        theta += h * omega
        v += h * (tau - load) / numbers[at.LINK_INERTIA]
        q += h * v
        passed += tau
        rubbed_in_all += rubbed
    memory[first + at.MOTOR], memory[first + at.MOTOR_VELOCITY], memory[first + at.DEFLECTION] = theta, omega, z
    return passed / count, rubbed_in_all / count


@helper
def finish(
    memory: FloatArray, tables: Tables, j: int, now: Inputs, work: FloatArray
) -> tuple[float, float, float, float, float]:
    """Friction and gear of joint j over the step; the five outputs of the joint."""
    layout, numbers = tables.layout[j], tables.numbers[j]
    first = layout[at.FIRST]
    motor, rest = work[at.EFFORT] * numbers[at.PER_EFFORT], work[at.NOW_REST]
    level, damping = max(work[at.NOW_LEVEL], 0.0), max(work[at.NOW_DAMPING], 0.0)
    if layout[at.GEARED]:
        before = memory[first + at.MOTOR]
        torque, rubbed = through_gear(memory, tables, j, now, Push(motor - rest, level, damping))
        turn_over(memory, layout, tables.travels, memory[first + at.MOTOR] - before)
    else:
        push = Push(motor - rest - memory[first + at.LOAD], level, damping)
        z, inertia, period = memory[first + at.DEFLECTION], numbers[at.INERTIA], numbers[at.PERIOD]
        _, _, rubbed = _friction_step(z, now.v, push, inertia, period)
        torque = motor - rest - rubbed
    memory[first + at.POSITION], memory[first + at.VELOCITY] = now.q, now.v
    memory[first + at.TORQUE], memory[first + at.COMMAND] = torque, work[at.ACTED]
    return torque, motor, rubbed, work[at.ASKED], work[at.FAULT]


TABLES = together(TABLE, MATRIX, TABLE, MATRIX, TABLE, VECTOR, VECTOR)
"""See `Tables`."""


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, REAL), TABLES, FLAG, OUT_MATRIX, OUT_VECTOR)
def advance(given: tuple[Any, ...], constants: tuple[Any, ...], again: bool, work: FloatArray, out: FloatArray) -> int:
    """The step of all joints.

    Args:
        given: (m + 1,) memories of the joints, and the time of the last update [s]; (n,) command; (2n,) [q; v]; (n,)
            torque on the link side [N m], NaN where only the motion tells it; (n,) temperature [deg C]; time [s].
        constants: See `Tables`.
        again: Whether this is the second call, for the joints whose effects the caller has evaluated.
        work: (n, 11) what passes between the two calls; without rows where every joint is compiled.
        out: (5n + m + 1,) the outputs of the first joint, of the second, and so on, then the next `kept`; written.

    Returns:
        DONE; UNSTARTED where a joint must be started first, nothing being written; or PENDING.
    """
    (kept, command, state, load, celsius, time), tables = given, Tables(*constants)
    layout, numbers = tables.layout, tables.numbers
    n, end = layout.shape[0], out.shape[0] - 1
    memory = out[at.OUTPUTS * n : end]
    rows = work if work.shape[0] else np.empty((n, at.WORK))
    at_tick = time - kept[kept.shape[0] - 1] > 0.99 * numbers[0, at.PERIOD]
    if not again:
        for j in range(n):
            if kept[layout[j, at.FIRST]] == 0.0 and np.isfinite(state[j]) and np.isfinite(state[n + j]):
                return at.UNSTARTED
        memory[:] = kept[: kept.shape[0] - 1]
        out[end] = time
    result = at.DONE
    for j in range(n):
        shown = out[at.OUTPUTS * j : at.OUTPUTS * (j + 1)]
        now = Inputs(command[j], state[j], state[n + j], load[j], celsius[j], at_tick)
        if not again:
            begin(memory, tables, j, now, rows[j])
            if rows[j, at.STATUS]:
                resist(memory, tables, j, celsius[j], rows[j])
        if rows[j, at.STATUS] == 0.0:
            shown[:] = 0.0
            shown[4] = 1.0
        elif layout[j, at.COMPILED] or again:
            if not again:
                drive(memory, tables, j, rows[j])
            if not (again and layout[j, at.COMPILED]):
                shown[0], shown[1], shown[2], shown[3], shown[4] = finish(memory, tables, j, now, rows[j])
        else:
            result = at.PENDING
    return result


@kernel(VECTOR, VECTOR, TABLE, MATRIX, OUT_VECTOR)
def motors(kept: FloatArray, state: FloatArray, layout: IntArray, numbers: FloatArray, out: FloatArray) -> None:
    """(3n,) motor angles and speeds over the gear ratio, and torques through the gears at a tick; as `advance`."""
    n = layout.shape[0]
    for j in range(n):
        first, q, v = layout[j, at.FIRST], state[j], state[n + j]
        out[j], out[n + j], out[2 * n + j] = q, v, 0.0
        if layout[j, at.GEARED] and kept[first] != 0.0:
            theta, omega = kept[first + at.MOTOR], kept[first + at.MOTOR_VELOCITY]
            gap, compliance, contact_time = (
                numbers[j, at.HALF_GAP],
                numbers[j, at.COMPLIANCE],
                numbers[j, at.CONTACT_TIME],
            )
            out[j], out[n + j] = theta, omega
            out[2 * n + j] = _gear_torque(theta - q, omega - v, gap, compliance, contact_time)


STEP, SUBSTEPS, MOVED, MOMENT, ZERO, KNOWN, START, VELOCITY, CENTRE, LIMIT = range(10)


@kernel(MATRIX, TABLES, VECTOR, OUT_VECTOR, OUT_VECTOR)
def positions(
    samples: FloatArray, constants: tuple[Any, ...], plant: FloatArray, memory: FloatArray, out: FloatArray
) -> None:
    """Position (T,) [rad] into out, which stays as it is from where the joint has left its range.

    Args:
        samples: (T, 4) command, load [N m], its change in a step, and temperature [deg C].
        constants: `Tables` of the joint, whose effects all have a compiled equation.
        plant: h, steps in a sample, inertia that is moved, moment of the pendulum's weight and where it hangs, 1 where
            the load is all that the gear transmits, position and velocity at the start, middle and half of the range.
        memory: (m,) of the joint, which has started; updated.
        out: Written.
    """
    tables = Tables(*constants)
    q, v, work = plant[START], plant[VELOCITY], np.zeros(at.WORK)
    for k in range(samples.shape[0]):
        out[k] = q
        for n in range(int(plant[SUBSTEPS])):
            outside = samples[k, 1] + n * samples[k, 2]
            load = outside if plant[KNOWN] else np.nan
            now = Inputs(samples[k, 0], q, v, load, samples[k, 3], True)
            begin(memory, tables, 0, now, work)
            if work[at.STATUS] == 0.0:
                return
            resist(memory, tables, 0, samples[k, 3], work)
            drive(memory, tables, 0, work)
            torque = finish(memory, tables, 0, now, work)[0]
            v += plant[STEP] * (torque - plant[MOMENT] * math.sin(q - plant[ZERO]) - outside) / plant[MOVED]
            q += plant[STEP] * v
        if not abs(q - plant[CENTRE]) <= plant[LIMIT]:
            return
