"""`JointLoop`: one joint of the torque loop (Del Prete et al., 2016, eq. 10 to 14), linear, sampled and in closed form.

Everything is a polynomial in the backward shift 1/z, so a point of a stability map costs one set of roots.

    plant     q[n+1] - 2 q[n] + q[n-1] = h^2/J (T[n] - K q[n]),   K = G + Ke
    drive     T = m - b v',   v' = (v[n] + h/J (m - K q[n-1]))/(1 + h b/J),   v[n] = (q[n] - q[n-1])/h
              m = y/K_tau,   b = K_v/K_tau         (viscous friction at the end of the step, as `ActuatorPlant` has it)
    filters   qhat, vhat, ahat = z^-(1+d) w_0, w_1, w_2 (1/z) q       a reader at a tick sees the tick before's samples
    force     fhat = D ahat + Gd qhat - z^-(1+d) u_0 (1/z) (D a + Gd q + Ke q),   a[n] = (v[n+1] - v[n])/h
    estimate  tau_hat = I ahat + G qhat - fhat
    control   tau_d = [G qhat] - Ks q - Kd vhat + Kf fhat
              y = K_tau' (tau_d + Kp (tau_d - tau_hat) + Ki h sum(tau_d - tau_hat)) + K_v' vhat

with the command q + y to a position servo whose effort is command - q. Primed: of the controller's model.

The numbers of a `JointLoop` by name, and those that stand for others: K6, K7 and the friction's over-estimate.

K6 = Ks K_tau' (1 + Kp) [-], K7 = Kd K_tau' (1 + Kp) [s], friction = K_v'/K_v [-].
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np

from drake_tc.control.stability_margins import ComplexArray, Margins, margins, sign_changes
from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import savgol_weights
from drake_tc.types import FloatArray

Source = Literal["estimate", "reference"]
_POSITIVE = ("inertia", "k_tau", "k_tau_model", "dt")
_NOT_NEGATIVE = (
    "link_inertia",
    "k_v",
    "kp",
    "ki",
    "ks",
    "kd",
    "environment_stiffness",
    "sensed_inertia",
)


@dataclass(frozen=True)
class JointLoop:
    """One joint in torque control; small motions about rest or steady sliding, where dry friction is constant.

    Attributes:
        inertia: J, what the drive moves: link and reflected rotor [kg m^2].
        link_inertia: I, what the torque estimate sees [kg m^2].
        k_tau, k_v: Of the true drive [rad/(N m)], [rad/(rad/s)].
        k_tau_model, k_v_model: K_tau', K_v', the controller's.
        window, order: Of the encoder's Savitzky-Golay filter [samples].
        dt: h, period of plant and controller [s].
        kp, ki, ks, kd: Gains [-], [1/s], [N m/rad], [N m s/rad].
        kf: Force feedback [-].
        environment_stiffness: Ke, of what the joint leans on beyond the force sensor [N m/rad]; 0: free.
        extra_delay: d, age added to all estimates [ticks]; the encoder's own reading stays fresh.
        gravity_stiffness: G, of the links' weight about the posture [N m/rad]; negative where the weight topples.
        gravity_at: Where the controller takes gravity: the delayed estimate or the reference.
        sensed_inertia, sensed_gravity: D, Gd, the shares of I and G beyond the force sensor [kg m^2], [N m/rad].
        inertial_order: Of the force sensor's filter, of the same window.
        at: Where in the window the polynomials are evaluated, in samples from the oldest; None: mid-window.
        velocity_from: The motion that friction is compensated for; "reference" feeds nothing back.
        rotor_model: Rotor inertia that the controller compensates at the reference's acceleration [kg m^2].

    Raises:
        ParamsError: a number that is not possible.
    """

    inertia: float
    link_inertia: float
    k_tau: float
    k_v: float
    k_tau_model: float
    k_v_model: float
    window: int = 80
    order: int = 2
    dt: float = 1e-3
    kp: float = 2.0
    ki: float = 0.0
    ks: float = 0.0
    kd: float = 0.0
    kf: float = 0.0
    environment_stiffness: float = 0.0
    extra_delay: int = 0
    gravity_stiffness: float = 0.0
    gravity_at: Source = "reference"
    sensed_inertia: float = 0.0
    sensed_gravity: float = 0.0
    inertial_order: int = 1
    at: float | None = None
    velocity_from: Source = "estimate"
    rotor_model: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, str):
                if value not in ("estimate", "reference"):
                    raise ParamsError(f"JointLoop.{field.name}: expected estimate or reference, got {value!r}")
            elif value is not None and not np.isfinite(value):
                raise ParamsError(f"JointLoop.{field.name}: expected a finite number, got {value!r}")
        for name in _POSITIVE:
            if not getattr(self, name) > 0.0:
                raise ParamsError(f"JointLoop.{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in _NOT_NEGATIVE:
            if getattr(self, name) < 0.0:
                raise ParamsError(f"JointLoop.{name}: expected a number >= 0, got {getattr(self, name)!r}")
        if self.extra_delay < 0 or self.extra_delay != int(self.extra_delay):
            raise ParamsError(f"JointLoop.extra_delay: expected a whole number of ticks >= 0, got {self.extra_delay!r}")
        self.late_weights(self.order, 0)

    @classmethod
    def with_equivalent_gains(cls, k6: float, k7: float = 0.0, kp: float = 2.0, **others: float) -> "JointLoop":
        """From K6 [-] and K7 [s]: Ks = K6/(K_tau' (1 + Kp)), Kd = K7/(K_tau' (1 + Kp)); K6 = 1: the servo's stiffness.

        Raises:
            ParamsError: as the class.
        """
        loop = others["k_tau_model"] * (1.0 + kp)
        values: dict[str, float] = {"kp": kp, "ks": k6 / loop, "kd": k7 / loop, **others}
        return cls(**values)  # type: ignore[arg-type]

    @property
    def holds_position(self) -> bool:
        """Whether anything pulls the joint to a position; without it, the loop acts on its speed alone."""
        return any((self.ks, self.gravity_stiffness, self.environment_stiffness))

    def characteristic(self) -> FloatArray:
        """Coefficients of the closed loop's characteristic polynomial in z, highest power first."""
        drag, drive = self.plant, self.drive_gain * np.append(0.0, self.feedback)
        return _sum(np.convolve(drag, self.integrator), -drive)

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Roots of the characteristic polynomial, largest first.

        A joint that nothing holds in position drifts: the root z = 1 that belongs to its position is left out.
        """
        polynomial = self.characteristic()
        if not self.holds_position:
            polynomial = np.cumsum(polynomial)[:-1]  # exact division by z - 1
        roots = np.roots(polynomial).astype(np.complex128)
        return np.asarray(roots[np.argsort(-np.abs(roots))])

    def spectral_radius(self) -> float:
        """Largest modulus of the eigenvalues: below 1 the loop is stable."""
        return float(np.abs(self.eigenvalues).max(initial=0.0))

    def open_loop(self, omega: FloatArray) -> ComplexArray:
        """L (W,) at omega [rad/s], the loop cut at the drive's effort y; negative feedback."""
        shift = np.exp(-1j * np.asarray(omega) * self.dt)
        denominator = _at(self.plant, shift) * _at(self.integrator, shift)
        return np.asarray(-self.drive_gain * shift * _at(self.feedback, shift) / denominator)

    def margins(self) -> Margins:
        """Of `open_loop`."""
        return margins(self.open_loop, self.dt)

    def tracking(self, omega: FloatArray) -> ComplexArray:
        """(q_d - q)/q_d (W,) at omega [rad/s], for a reference that gives its own derivatives."""
        omega = np.asarray(omega, dtype=np.float64)
        shift, s = np.exp(-1j * omega * self.dt), 1j * omega
        requested = self.ks + self.kd * s + self.link_inertia * s**2
        if self.gravity_at == "reference":
            requested = requested + self.gravity_stiffness
        integral = self.ki * self.dt * shift / (1.0 - shift) if self.ki else 0.0
        effort = self.k_tau_model * ((1.0 + self.kp + integral) * requested + self.rotor_model * s**2)
        if self.velocity_from == "reference":
            effort = effort + self.k_v_model * s
        closed = _at(self.plant, shift) - self.drive_gain * shift * _at(self.feedback, shift) / _at(
            self.integrator, shift
        )
        return np.asarray(1.0 - self.drive_gain * shift * effort / closed)

    @cached_property
    def plant(self) -> FloatArray:
        """A(1/z)/z with A q = h^2 beta/(J K_tau) y: plant and drive from effort to position."""
        h, alpha = self.dt, self.dt / self.inertia
        b, stiffness = self.k_v / self.k_tau, self.gravity_stiffness + self.environment_stiffness
        beta = 1.0 / (1.0 + alpha * b)
        drag = alpha * b * beta
        spring = alpha * h * stiffness
        return np.array([1.0, -2.0 + drag + spring, 1.0 - drag * (1.0 + spring)])

    @property
    def drive_gain(self) -> float:
        """h^2 beta/(J K_tau): what one unit of effort adds to the position over a period, before A(1/z) acts."""
        alpha = self.dt / self.inertia
        return self.dt * alpha / ((1.0 + alpha * self.k_v / self.k_tau) * self.k_tau)

    @property
    def integrator(self) -> FloatArray:
        """1 - 1/z where there is an integral, otherwise 1: coefficients of rising powers of 1/z."""
        return np.array([1.0, -1.0]) if self.ki else np.ones(1)

    @cached_property
    def feedback(self) -> FloatArray:
        """C(1/z), times 1 - 1/z where there is an integral, with y = C q."""
        q, v, a = (self.late_weights(self.order, k) for k in range(3))
        force = _sum(self.sensed_inertia * a, self.sensed_gravity * q, -self._felt())
        estimate = _sum(self.link_inertia * a, self.gravity_stiffness * q, -force)
        desired = _sum(np.array([-self.ks]), -self.kd * v, self.kf * force)
        if self.gravity_at == "estimate":
            desired = _sum(desired, self.gravity_stiffness * q)
        error = _sum(desired, -estimate)
        effort = self.k_tau_model * _sum(desired, self.kp * error)
        if self.velocity_from == "estimate":
            effort = _sum(effort, self.k_v_model * v)
        if not self.ki:
            return effort
        summed = self.k_tau_model * self.ki * self.dt * np.append(0.0, error)
        return _sum(np.convolve(effort, self.integrator), summed)

    def late_weights(self, order: int, derivative: int) -> FloatArray:
        """z^-(1+d) w(1/z): a Savitzky-Golay filter of the loop's window as a reader sees it, read-only.

        Args:
            order: Of its polynomials.
            derivative: 0, 1 or 2.

        Raises:
            ParamsError: as `savgol_weights`.
        """
        weights = _kept_weights(self.window, order, self.at, derivative, self.dt)
        return np.concatenate((np.zeros(1 + int(self.extra_delay)), weights[::-1]))

    def _felt(self) -> FloatArray:
        """What the filtered force sensor says of q."""
        smooth = self.late_weights(self.inertial_order, 0)
        felt = (self.sensed_gravity + self.environment_stiffness) * smooth
        acceleration = np.convolve(smooth[1:], np.array([1.0, -2.0, 1.0])) / self.dt**2  # of a tick ahead: no z^-1
        return _sum(felt, self.sensed_inertia * acceleration)


_kept_weights = lru_cache(maxsize=512)(savgol_weights)
"""Kept: a map asks for the same ones again and again."""


def _sum(*polynomials: FloatArray) -> FloatArray:
    total = np.zeros(max(p.size for p in polynomials))
    for p in polynomials:
        total[: p.size] += p
    return total


def _at(polynomial: FloatArray, shift: ComplexArray) -> ComplexArray:
    """p(1/z)."""
    return np.asarray(np.polyval(polynomial[::-1], shift))


WHOLE = ("window", "order", "extra_delay", "inertial_order")
EQUIVALENT = ("k6", "k7", "friction")
"""Beside the fields of JointLoop: K6 [-] and K7 [s] in place of Ks and Kd, and `friction` = K_v'/K_v [-]."""


def parameters() -> tuple[str, ...]:
    """The numbers of a JointLoop, and EQUIVALENT."""
    texts = ("gravity_at", "velocity_from")
    return tuple(field.name for field in fields(JointLoop) if field.name not in texts) + EQUIVALENT


def value_of(loop: JointLoop, name: str) -> float:
    """The loop's own value of a parameter; NaN for `at` mid-window."""
    per = loop.k_tau_model * (1.0 + loop.kp)
    if name == "k6":
        return loop.ks * per
    if name == "k7":
        return loop.kd * per
    if name == "friction":
        return loop.k_v_model / loop.k_v if loop.k_v else np.nan
    value = getattr(loop, name)
    return np.nan if value is None else float(value)


def with_values(loop: JointLoop, values: Mapping[str, float]) -> JointLoop:
    """The loop with other values; K6 and K7 stay what they are unless Ks, Kd, or they themselves are given.

    Raises:
        ParamsError: a value that is not possible.
    """
    plain: dict[str, Any] = {name: value for name, value in values.items() if name not in EQUIVALENT}
    for name in WHOLE:
        if name in plain:
            if plain[name] != round(plain[name]):
                raise ParamsError(f"JointLoop.{name}: expected a whole number, got {plain[name]:g}")
            plain[name] = round(plain[name])
    if "friction" in values:
        plain["k_v_model"] = values["friction"] * loop.k_v
    changed = replace(loop, **plain)
    per = changed.k_tau_model * (1.0 + changed.kp)
    kept = {name: values.get(name, value_of(loop, name)) for name in ("k6", "k7")}
    ks = changed.ks if "ks" in plain else kept["k6"] / per
    kd = changed.kd if "kd" in plain else kept["k7"] / per
    return replace(changed, ks=ks, kd=kd)


POINTS = 8192
"""Of the transform: at h = 1 ms, a frequency every 0.77 rad/s."""


def quick_margins(loop: JointLoop) -> Margins | None:
    """Margins of `JointLoop.margins`, to the grid's resolution; None where the closed loop is unstable."""
    closed = np.fft.rfft(loop.characteristic(), POINTS)[1:]
    if abs(np.unwrap(np.angle(closed))[-1] - np.angle(closed[0])) > 0.5 * np.pi:
        return None
    plant = np.fft.rfft(np.convolve(loop.plant, loop.integrator), POINTS)[1:]
    omega: FloatArray = np.arange(1.0, closed.size + 1.0) * (2.0 * np.pi / (POINTS * loop.dt))
    return grid_margins(closed / plant - 1.0, omega)


def grid_margins(opened: ComplexArray, omega: FloatArray) -> Margins:
    """Margins of a stable loop from its open response on a grid, to the grid's resolution.

    Args:
        opened: (W,) L, negative feedback.
        omega: (W,) rising frequencies up to that of Nyquist [rad/s].
    """
    peak = float(np.max(np.abs(1.0 / (1.0 + opened))))
    phase, late, crossover = _unity(opened, omega)
    gain, turning = _real(opened, omega)
    return Margins(gain, phase, late, peak, crossover, turning)


def _unity(opened: ComplexArray, omega: FloatArray) -> tuple[float, float, float]:
    """(phase margin, delay margin, crossover) where |L| = 1, between grid points by a straight line."""
    size = np.log(np.abs(opened))
    at = sign_changes(size)
    if not at.size:
        return np.inf, np.inf, np.nan
    share = size[at] / (size[at] - size[at + 1])
    value = opened[at] + share * (opened[at + 1] - opened[at])
    where = omega[at] + share * (omega[at + 1] - omega[at])
    angle = np.angle(-value)
    nearest = int(np.argmin(np.abs(angle)))
    late = float(np.min(np.where(angle > 0.0, angle, angle + 2.0 * np.pi) / where))
    return float(angle[nearest]), late, float(where[nearest])


def _real(opened: ComplexArray, omega: FloatArray) -> tuple[float, float]:
    """(gain margin, its frequency): the factor nearest to 1 that brings L to -1."""
    imaginary, real = opened.imag, opened.real
    at = sign_changes(imaginary)
    share = imaginary[at] / (imaginary[at] - imaginary[at + 1])
    value = real[at] + share * (real[at + 1] - real[at])
    where = omega[at] + share * (omega[at + 1] - omega[at])
    value, where = np.append(value, real[-1]), np.append(where, omega[-1])  # L is real at the Nyquist frequency
    behind = value < 0.0
    if not behind.any():
        return np.inf, np.nan
    factor, where = -1.0 / value[behind], where[behind]
    nearest = int(np.argmin(np.abs(np.log(factor))))
    return float(factor[nearest]), float(where[nearest])
