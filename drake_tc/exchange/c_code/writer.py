"""`to_c`: torque control as one C99 file and its header, without dependencies, allocation or state of its own.

The drives' tables are those of the `Compensator`, the equations those of the library in C (`expressions`), the links
those of the plant (`links`); the rest stands in the two templates beside this file.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from drake_tc.actuation.compensator import Compensator
from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.guard import GuardLaw, GuardSpec, rated_guard
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import LARGEST
from drake_tc.exchange.c_code.expressions import c_function, moved_links, number
from drake_tc.filtering.savitzky_golay import delay, savgol_weights
from drake_tc.kernels import compensation_layout as at
from drake_tc.kernels import equations as scalar
from drake_tc.kernels.guard import COMPLETE, UNTRUSTED
from drake_tc.kernels.guard import LARGEST as MOST
from drake_tc.kernels.joint_layout import DEAD_ZONE, TERM_END, TERM_FIRST, TERM_KIND
from drake_tc.kernels.torque_equations import EQUATIONS, REFERENCE_CELSIUS
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot

HERE = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class CSpec:
    """What the C file computes beside the drives' models.

    Attributes:
        name: Of the files, and before the name of each function.
        dt: Period of every call [s].
        window: Samples of the filter of positions.
        order: Of its polynomial.
        kp: Torque feedback Kp [-].
        ki: Integral of the torque error [1/s].
        residual_gain: K of the external torques [1/s].
        compensation: Motion for which the effects of the drives are compensated.
        guard: Limits and times of the guard. None: those of `GuardSpec`. Where it has no offset limit, a robot's rated
            torques give it; drives other than position servos have no guard without either.

    Raises:
        ParamsError: a name that is no identifier of C, or a number that is not possible.

    Example:
        >>> CSpec(name="arm", kp=2.0).window
        80
    """

    name: str = "torque_control"
    dt: float = 1e-3
    window: int = 80
    order: int = 2
    kp: float = 0.0
    ki: float = 0.0
    residual_gain: float = 30.0
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    guard: GuardSpec | None = None

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise ParamsError(f"name: expected an identifier of C in small letters, got {self.name!r}")
        for name in ("dt", "residual_gain"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ParamsError(f"{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in ("kp", "ki"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ParamsError(f"{name}: expected a number >= 0, got {getattr(self, name)!r}")


@dataclass(frozen=True)
class CFiles:
    """The two files.

    Attributes:
        name: Without ending.
        header: Text of `name`.h.
        source: Text of `name`.c.
    """

    name: str
    header: str
    source: str

    def write(self, folder: Path) -> list[Path]:
        """Write both; the folder must exist."""
        paths = [folder / f"{self.name}.h", folder / f"{self.name}.c"]
        for path, text in zip(paths, (self.header, self.source), strict=True):
            path.write_text(text, encoding="utf-8")
        return paths


def to_c(models: Models, robot: Robot | None = None, spec: CSpec | None = None) -> CFiles:
    """The C file of the torque control of joints, and its header.

    Args:
        models: One a joint, by joint or in order.
        robot: With a fixed base and these joints: adds inverse dynamics, gravity and external torques, and limits
            torques to the joints' efforts. None: the drives alone, without limits.
        spec: Period, filter, gains; None: the defaults.

    Raises:
        ParamsError: a drive with an effect of the user's own that has no compiled equation, or a robot that has no
            fixed base.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> files = to_c(load_models(robot.actuators), robot)
        >>> "torque_control_gravity" in files.header
        True
    """
    from drake_tc import __version__

    spec = CSpec() if spec is None else spec
    drives = model_list(models, None if robot is None else robot.joints)
    n, compensation = len(drives), spec.compensation
    compensator = Compensator(drives, compensation.direction_speed, compensation.smoothing)
    if compensator.interpreted:
        joint = compensator.joints[compensator.interpreted[0]]
        raise ParamsError(f"export --to c: joint {joint!r} has an effect without compiled equation")
    laws, kinds = _laws(compensator)
    links, gravity, order = ([], np.zeros(3), []) if robot is None else moved_links(robot)
    given = {"estimate": "motion", "reference": "reference", "none": ""}
    values: dict[str, Any] = {
        "name": spec.name,
        "upper": spec.name.upper(),
        "guard": f"{spec.name.upper()}_H",
        "version": __version__,
        "joints": compensator.joints,
        "window": spec.window,
        "dt": spec.dt,
        "delay": delay(spec.window, spec.dt),
        "weights": [savgol_weights(spec.window, spec.order, None, d, spec.dt) for d in range(3)],
        "equations": _equations(laws, kinds),
        "laws": laws,
        "kp": [spec.kp] * n,
        "ki": [spec.ki] * n,
        "limit": [math.inf] * n if robot is None else joint_limits(robot).effort,
        "servo": [float(model.drive.kind == "position_servo") for model in drives],
        "velocity": given[compensation.velocity],
        "direction": given[compensation.direction],
        "acceleration": given[compensation.acceleration],
        "per_speed": 1.0 / compensation.direction_speed,
        "celsius": REFERENCE_CELSIUS,
        "links": links,
        "gravity": gravity,
        "order": order,
        "blend": -math.expm1(-spec.residual_gain * spec.dt),
        "residual_gain": spec.residual_gain,
        "largest": LARGEST,
        "limits": _guard(drives, robot, spec),
        "num": number,
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)
    environment.filters["nums"] = lambda values: ", ".join(number(float(value)) for value in np.ravel(values))
    header, source = (
        environment.from_string((HERE / f"torque_control.{ending}.jinja").read_text(encoding="utf-8")).render(values)
        for ending in ("h", "c")
    )
    return CFiles(spec.name, header, source)


def _guard(drives: Sequence[ActuatorModel], robot: Robot | None, spec: CSpec) -> dict[str, Any] | None:
    """Numbers of the guard; None where nothing limits a drive that is no position servo."""
    guard, n = spec.guard or GuardSpec(), len(drives)
    servo = tuple(model.drive.kind == "position_servo" for model in drives)
    bounds = None if robot is None else joint_limits(robot)
    if bounds is not None:
        guard = rated_guard(guard, drives, bounds.effort, bounds.velocity)
    if guard.offset_limit is None and not all(servo):
        return None
    offset, step, start_step, _ = GuardLaw(n, spec.dt, guard, servo).limits
    none = np.full(n, np.inf)
    return {
        "offset": offset,
        "step": step,
        "start_step": start_step,
        "lower": -none if bounds is None else np.where(servo, bounds.lower, -none),
        "upper": none if bounds is None else np.where(servo, bounds.upper, none),
        "most": MOST,
        "untrusted": UNTRUSTED,
        "complete": COMPLETE,
        "start_rate": 1.0 / max(guard.start_time, spec.dt),
        "blend_rate": 1.0 / max(guard.blend_time, spec.dt),
        "recover": guard.recover_time - 0.5 * spec.dt,
        "hold": guard.hold_time + 0.5 * spec.dt,
        "damp_step": guard.damp_rate * spec.dt,
        "damp_share": spec.dt / max(guard.damp_time, spec.dt),
    }


def _laws(compensator: Compensator) -> tuple[list[dict[str, Any]], set[int]]:
    """Each joint's numbers, and the kinds of equations that any of them has."""
    rows, inverses, terms, numbers = compensator.tables
    laws: list[dict[str, Any]] = []
    kinds: set[int] = set()
    for name, row in zip(compensator.joints, rows, strict=True):
        own = [terms[t] for t in range(int(row[at.TERMS]), int(row[at.TERMS_END]))]
        kinds |= {int(term[TERM_KIND]) for term in own}
        undone = inverses[int(row[at.INVERSES]) : int(row[at.INVERSES_END])]
        laws.append(
            {
                "name": name,
                "parts": row[at.LEVEL : at.LEVEL + 3],
                "gain": row[at.GAIN],
                "inertia": row[at.INERTIA],
                "compliance": row[at.COMPLIANCE],
                "half_gap": row[at.HALF_GAP],
                "smoothing": row[at.SMOOTHING],
                "inverses": [{"dead_zone": kind == DEAD_ZONE, "number": value} for kind, value in undone],
                "terms": [
                    {
                        "equation": EQUATIONS[term[TERM_KIND]].__name__,
                        "numbers": numbers[term[TERM_FIRST] : term[TERM_END]],
                    }
                    for term in own
                ],
            }
        )
    return laws, kinds


def _equations(laws: list[dict[str, Any]], kinds: set[int]) -> list[str]:
    """The functions that any joint needs, each once."""
    needed = [c_function(EQUATIONS[kind], ("n",), 3) for kind in sorted(kinds)]
    undone = {inverse["dead_zone"] for law in laws for inverse in law["inverses"]}
    if True in undone:
        needed.append(c_function(scalar.dead_zone_inverse))
    if False in undone:
        needed.append(c_function(scalar.switch_inverse))
    if any(law["half_gap"] for law in laws):
        needed.append(c_function(scalar.soft_sign))
    return [*needed, c_function(scalar.needed_torque, ("parts",))]
