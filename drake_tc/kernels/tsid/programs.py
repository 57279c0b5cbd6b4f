"""The programs of robust TSID: a convex objective inside linear limits, at one x (N,), and its derivatives.

PLAIN, over x (n,) or (n + 1,) for the box:
    f(x) = ||D x - d||^2 + c^T x + w R(x),  R(x) = -sum log Phi(A x - risk_lower) - sum log Phi(risk_upper - A x)
    lower <= A x <= upper
    With u of all sides, lambda = hazard(u), kappa = lambda (lambda + u): gradient A^T (lambda_upper - lambda_lower) and
    Hessian A^T diag(kappa_upper + kappa_lower) A of R. Sides farther than SAFE sigmas do not show.
RECTANGLE, over (x, a, b) (n + 2 r,), K (m, r) the noise of the rows and K+- its positive and negative parts:
    f(x, a, b) = ||D x - d||^2 - w sum_j log(Phi(a_j) - Phi(-b_j))
    A x + K+ a + K- b <= upper, -A x + K- a + K+ b <= -lower         the worst corner of each side
    a + b >= width                                                   the paper's epsilon
    sides that x itself is to keep                                   signs (h,) of rows kept (h,)

Source: Del Prete and Mansard, 2015, eq. 7 and 13 to 16.

The standard normal's cdf, hazard and their derivatives, accurate in both tails; u has no unit.

    Phi(u) cdf, phi(u) = exp(-u^2 / 2) / sqrt(2 pi)
    d/du log Phi = hazard(u) = phi(u) / Phi(u)
    d/du hazard = -curvature(u),  curvature = hazard (hazard + u) in (0, 1)

With x = -u the Mills ratio's continued fraction gives hazard + u = 1 / (x + 2 / (x + 3 / (x + ...))) without the
cancellation that costs u^2 roundings where u << 0 (Abramowitz & Stegun 26.2.14); the scaled complementary error
function of large arguments has the fraction 1 / (sqrt(pi) (x + (1/2) / (x + 1 / (x + (3/2) / (x + ...))))) (7.1.14).
"""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linear_algebra import times_vector
from drake_tc.types import FloatArray, IntArray

CEILING = 37.0
"""Above it exp(u^2 / 2) nears the largest double, and hazard and curvature are below 1e-297."""

FRACTION_BELOW = -4.0
FRACTION_TERMS = 40
_SCALED_ABOVE, _SCALED_TERMS = 5.0, 30
_INVERSE_ROOT_2 = math.sqrt(0.5)
_ROOT_2_OVER_PI = math.sqrt(2.0 / math.pi)
_INVERSE_ROOT_PI = 1.0 / math.sqrt(math.pi)
_LOG_ROOT_2_PI = 0.5 * math.log(2.0 * math.pi)


@helper
def scaled_erfc(x: float) -> float:
    """exp(x^2) erfc(x); infinite below -26."""
    if not x > _SCALED_ABOVE:
        return math.exp(x * x) * math.erfc(x) if x > -26.6 else math.inf if x == x else x
    below = x
    for k in range(_SCALED_TERMS, 0, -1):
        below = x + 0.5 * k / below
    return _INVERSE_ROOT_PI / below


@helper
def log_cdf(u: float) -> float:
    """Log Phi(u)."""
    x = -_INVERSE_ROOT_2 * u
    if u > 0.0:
        return math.log1p(-0.5 * math.erfc(-x))
    if u == -math.inf:
        return u
    return math.log(0.5 * scaled_erfc(x)) - x * x if u < -1.0 else math.log(0.5 * math.erfc(x))


@helper
def hazard(u: float) -> float:
    """phi(u) / Phi(u); 0 where it is less than the smallest double."""
    return _ROOT_2_OVER_PI / scaled_erfc(-_INVERSE_ROOT_2 * u)


@helper
def curvature_of(u: float, rate: float) -> float:
    """Minus the second derivative of log Phi for u <= `CEILING`, from the hazard there."""
    if u >= FRACTION_BELOW:
        return rate * (rate + u)
    x = -u
    below = x
    for k in range(FRACTION_TERMS, 1, -1):
        below = x + k / below
    return rate / below


@helper
def around_zero(a: float, b: float) -> float:
    """-log of the mass of [-b, a], over sqrt 2, for a, b >= 0."""
    tails = 0.5 * (math.erfc(a) + math.erfc(b))
    if tails < 0.5:
        return -math.log1p(-tails)
    mass = 0.5 * (math.erf(a) + math.erf(b))
    return -math.log(mass) if mass > 0.0 else math.inf


@helper
def interval_risk(above: float, below: float) -> float:
    """-log P, P = Phi(a) - Phi(-b), of [-b, a] for a + b > 0; infinite where that is not so. Convex in (a, b).

    Whether the interval is wide, far out in one tail or both, P keeps its digits: -log(1 - tails) where they are small,
    erf where 0 is inside, scaled erfc where it is not.
    """
    a, b = _INVERSE_ROOT_2 * above, _INVERSE_ROOT_2 * below
    if a >= 0.0 and b >= 0.0:
        return around_zero(a, b)
    if not a + b > 0.0:
        return math.inf
    near, far = max(-a, -b), max(a, b)
    share = scaled_erfc(near) - math.exp((near - far) * (near + far)) * scaled_erfc(far)
    return near * near - math.log(0.5 * share) if share > 0.0 else math.inf


@helper
def interval_density(end: float, risk: float) -> float:
    """phi(end) / P of an interval that ends there, from -log P."""
    return math.exp(risk - _LOG_ROOT_2_PI - 0.5 * end * end)


PLAIN, RECTANGLE = 0, 1
SAFE = 12.0
"""Margin beyond which a side bends R by less than 1e-30 and counts as this far."""
DAMPING = 1e-9
"""Of the largest diagonal entry: with much less, singular costs cost their factors too many digits."""
RISK_DAMPING = 1e-6
"""The same over w."""
SIDE_DAMPING = 1e-6
"""Curvature, over w, of a rectangle's side that nothing holds and that gains nothing any more."""


class Program(NamedTuple):
    """See the module; arrays that a kind does not use are empty.

    Attributes:
        kind: PLAIN or RECTANGLE.
        matrix: (m, n) A.
        noise, reach: (m, r) K and |K| of a rectangle.
        kept, signs: (h,) rows and sides that a rectangle's x keeps.
        cost: (c, n) D.
        target: (c,) d.
        linear: (N,) c, or empty for none.
        risk_lower, risk_upper: (m,).
        weight: w; 0 for no R.
        quadratic: (n, n) 2 D^T D with its damping.
    """

    kind: int
    matrix: FloatArray
    noise: FloatArray
    reach: FloatArray
    kept: IntArray
    signs: FloatArray
    cost: FloatArray
    target: FloatArray
    linear: FloatArray
    risk_lower: FloatArray
    risk_upper: FloatArray
    weight: float
    quadratic: FloatArray


class Point(NamedTuple):
    """The objective at one x: f and R in `value`, and what its derivatives need.

    Attributes:
        x: (N,).
        value: (2,) f, and how many sides show.
        residual: (c,) D x - d.
        margins, rates: (2 m,) u and hazard of the sides that show; of a rectangle's axes: -log P in `margins`.
        sides: (2 m,) which; lower sides are counted first, upper sides from m on.
    """

    x: FloatArray
    value: FloatArray
    residual: FloatArray
    margins: FloatArray
    rates: FloatArray
    sides: IntArray


@helper
def point_of(program: Program, size: int) -> Point:
    """Memory for points of N = size."""
    count = program.noise.shape[1] if program.kind == RECTANGLE else 2 * program.matrix.shape[0]
    if program.kind == PLAIN and not program.weight > 0.0:
        count = 0
    return Point(
        np.empty(size),
        np.empty(2),
        np.empty(program.target.size),
        np.empty(count),
        np.empty(count),
        np.empty(count, dtype=np.int64),
    )


@helper
def quadratic_of(cost: FloatArray, damping: float, least: float) -> FloatArray:
    """2 D^T D, on its diagonal damping + DAMPING of the largest entry, or `least` where that is 0."""
    n = cost.shape[1]
    quadratic = np.dot(cost.T, cost) if cost.shape[0] else np.zeros((n, n))
    largest = 0.0
    for i in range(n):
        for j in range(n):
            quadratic[i, j] *= 2.0
        largest = max(largest, quadratic[i, i])
    more = damping + DAMPING * largest
    for i in range(n):
        quadratic[i, i] += more if more != 0.0 else least
    return quadratic


@helper
def rows_of(program: Program) -> int:
    """How many rows limit x."""
    m: int = program.matrix.shape[0]
    return m if program.kind == PLAIN else 2 * m + program.noise.shape[1] + program.kept.size


@helper
def times_into(program: Program, x: FloatArray, out: FloatArray) -> None:
    """The rows' values at x, or along x."""
    matrix = program.matrix
    m, n = matrix.shape
    if program.kind == PLAIN:
        times_vector(out, matrix, x)
        return
    r = program.noise.shape[1]
    middle, half = np.empty(r), np.empty(r)
    for j in range(r):
        above, below = x[n + j], x[n + r + j]
        middle[j], half[j] = 0.5 * (above - below), 0.5 * (above + below)
        out[2 * m + j] = -(above + below)
    own, value, room = np.empty(m), np.empty(m), np.empty(m)
    times_vector(own, matrix, x[:n])
    times_vector(value, program.noise, middle)
    times_vector(room, program.reach, half)
    for i in range(m):
        value[i] += own[i]
        out[i], out[m + i] = room[i] + value[i], room[i] - value[i]
    for i in range(program.kept.size):
        out[2 * m + r + i] = program.signs[i] * own[program.kept[i]]


@helper
def row_into(program: Program, row: int, out: FloatArray) -> None:
    """A row (N,) written out."""
    m, n = program.matrix.shape
    if program.kind == PLAIN:
        out[:] = program.matrix[row]
        return
    r = program.noise.shape[1]
    out[:] = 0.0
    if row < 2 * m:
        index, sign = (row, 1.0) if row < m else (row - m, -1.0)
        for j in range(n):
            out[j] = sign * program.matrix[index, j]
        for j in range(r):
            noise = sign * program.noise[index, j]
            out[n + j] = max(noise, 0.0)
            out[n + r + j] = out[n + j] - noise
    elif row < 2 * m + r:
        out[n + row - 2 * m] = out[n + row - 2 * m + r] = -1.0
    else:
        i = row - 2 * m - r
        for j in range(n):
            out[j] = program.signs[i] * program.matrix[program.kept[i], j]


@helper
def value_at(program: Program, point: Point) -> None:
    """F at point.x, and what the derivatives need."""
    x, cost = point.x, program.cost
    n = cost.shape[1]
    value = 0.0
    times_vector(point.residual, cost, x[:n])
    for i in range(cost.shape[0]):
        point.residual[i] -= program.target[i]
        value += point.residual[i] * point.residual[i]
    for j in range(program.linear.size):
        value += program.linear[j] * x[j]
    point.value[1] = 0.0
    if program.kind == RECTANGLE:
        total, r = 0.0, program.noise.shape[1]
        n = program.matrix.shape[1]
        for j in range(r):
            point.margins[j] = interval_risk(x[n + j], x[n + r + j])
            total += point.margins[j]
        value += program.weight * total
    elif program.weight > 0.0:
        value += program.weight * _near_sides(program, point)
    point.value[0] = value


@helper
def _near_sides(program: Program, point: Point) -> float:
    """R of the sides that show, collected in the point; its digits are those of the largest margin squared."""
    m = program.matrix.shape[0]
    along = np.empty(m)
    times_vector(along, program.matrix, point.x)
    count, total = 0, 0.0
    for i in range(2 * m):
        u = along[i] - program.risk_lower[i] if i < m else program.risk_upper[i - m] - along[i - m]
        if not u >= SAFE:
            point.sides[count], point.margins[count], point.rates[count] = i, u, hazard(u)
            total -= log_cdf(u)
            count += 1
    point.value[1] = count
    return total


@helper
def risk_at(program: Program, point: Point) -> float:
    """R of the point to the last digit."""
    total = 0.0
    if program.kind == RECTANGLE:
        for j in range(point.margins.size):
            total += point.margins[j]
        return total
    for k in range(int(point.value[1])):
        total -= log_cdf(point.margins[k])
    return total


@helper
def gradient_into(program: Program, point: Point, out: FloatArray) -> None:
    """The gradient (N,) at the point."""
    cost, m = program.cost, program.matrix.shape[0]
    out[:] = 0.0
    for i in range(cost.shape[0]):
        double = 2.0 * point.residual[i]
        for j in range(cost.shape[1]):
            out[j] += double * cost[i, j]
    for j in range(program.linear.size):
        out[j] += program.linear[j]
    if program.kind == RECTANGLE:
        n, r = program.matrix.shape[1], program.noise.shape[1]
        for j in range(r):
            out[n + j] = -program.weight * interval_density(point.x[n + j], point.margins[j])
            out[n + r + j] = -program.weight * interval_density(point.x[n + r + j], point.margins[j])
        return
    for k in range(int(point.value[1])):
        side = point.sides[k]
        row = side if side < m else side - m
        share = program.weight * point.rates[k] * (-1.0 if side < m else 1.0)
        for j in range(cost.shape[1]):
            out[j] += share * program.matrix[row, j]


@helper
def hessian_into(program: Program, point: Point, out: FloatArray) -> None:
    """The Hessian: (n, n), or of a rectangle (n + 2 r, n + 2 r), which is a block for x and one of 2 by 2 an axis."""
    n = program.quadratic.shape[0]
    if program.kind == RECTANGLE:
        _rectangle_hessian(program, point, out)
        return
    out[:] = program.quadratic
    count, m = int(point.value[1]), program.matrix.shape[0]
    if count == 0:
        return
    root = np.empty((count, n))
    for k in range(count):
        side = point.sides[k]
        row = side if side < m else side - m
        scale = math.sqrt(program.weight * curvature_of(point.margins[k], point.rates[k]))
        for j in range(n):
            root[k, j] = scale * program.matrix[row, j]
    out += np.dot(root.T, root)


@helper
def _rectangle_hessian(program: Program, point: Point, out: FloatArray) -> None:
    n, r, weight = program.quadratic.shape[0], program.noise.shape[1], program.weight
    out[:] = 0.0
    out[:n, :n] = program.quadratic
    for j in range(r):
        above, below = point.x[n + j], point.x[n + r + j]
        by_a, by_b = interval_density(above, point.margins[j]), interval_density(below, point.margins[j])
        first = weight * (max(by_a * (above + by_a), 0.0) + SIDE_DAMPING)
        mixed = weight * by_a * by_b
        second = weight * (by_b * (below + by_b) + SIDE_DAMPING)
        out[n + j, n + j] = first
        out[n + j, n + r + j] = out[n + r + j, n + j] = mixed
        out[n + r + j, n + r + j] = max(second, mixed * mixed / first + SIDE_DAMPING * weight)
