"""Figures that the first README's tables quote: row, cell, and the values on record that stand in it."""

from collections.abc import Callable
from functools import cache

from drake_tc.diagrams.papers.delprete2015.judge import wilson
from drake_tc.diagrams.papers.expected_values import expected_file, on_record

MAIN, TSID, SEA = "README.md", "drake_tc/tsid/README.md", "diagrams/sea_joint.md"
ANALYSIS, PAPER_C = "drake_tc/analysis/README.md", "diagrams/papers/faraji2015/README.md"
ROBOTS = 20
PERCENT, MILLI = 100.0, 1e3

Values = Callable[[], list[float | None]]


@cache
def recorded(id_: str) -> dict[str, float]:
    return {name: item.reached for name, item in on_record(expected_file(id_)).items()}


def each(id_: str, *names: str, times: float = 1.0) -> list[float | None]:
    """The rows of these names."""
    return [times * recorded(id_)[name] for name in names]


def group(id_: str, begin: str) -> list[float]:
    """All rows whose names begin so."""
    found = [value for name, value in recorded(id_).items() if name.startswith(begin)]
    assert found, f"{id_}: no row on record begins with {begin!r}"
    return found


def above_one(id_: str, begin: str) -> float:
    return float(sum(value > 1.0 for value in group(id_, begin)))


def motions(what: str, *ids: str, times: float = 1.0) -> list[float | None]:
    return [value for id_ in ids for value in each(id_, f"base {what} error, ours over foot centre", times=times)]


def base(id_: str, begin: str = "") -> list[float | None]:
    """Position, velocity and yaw."""
    return [
        each(id_, f"{begin}base {what} error, ours over foot centre")[0] for what in ("position", "velocity", "yaw")
    ]


def crossing(id_: str, begin: str, forms: tuple[str, ...]) -> list[float | None]:
    return each(id_, *(begin + form for form in forms))


def share(begin: str, way: str) -> list[float | None]:
    """Of the hundred controllers of B.test5, and the ends of its 95 % interval [%]."""
    (found,) = crossing("B.test5", begin, (way,))
    return [found, *(PERCENT * end for end in wilson(round(found), 100))]


def share_of_robots(form: str) -> list[float | None]:
    """Of the twenty robots of B.closed_loop that keep every limit, and the ends of the 95 % interval [%]."""
    (found,) = each("B.closed_loop", f"runs that keep every limit, {form}")
    return [found, *(PERCENT * end for end in wilson(round(found / PERCENT * ROBOTS), ROBOTS))]


TURNS = ("C.turn1hz", "C.turn_half_hz")
WAYS = ("forward", "backward", "sideways")
OURS_PUSHED = "whole-body torque control"
IND_RECT_BOX = ("p_ind", "p_rect", "p_box")
WAYS_5 = ("classic, w_f > 0", "p_ind")
ROBUST = ("individual", "rectangle", "box")

Quote = tuple[str, str, int, Values]
"""File, beginning of the row, cell, and the values whose numbers stand in that cell, in order."""

FIRST_PAGE: list[Quote] = [
    (MAIN, "drive constants", 1, lambda: [*each("A.table1", "K_tau and K_v within family-wise intervals, of 12"), 12]),
    (MAIN, "joints on which `close", 1, lambda: [*each("A.table1", "deadzone found when not declared, joints"), 6]),
    (MAIN, "squared error, servo", 1, lambda: [min(group("A.table2", "squared error ratio, K6 = 1, "))]),
    (MAIN, "printed joints", 1, lambda: [*each("A.table2", "joints with a ratio of 3 or more at K6 = 1"), 5]),
    (MAIN, "the same at K6 = 0.5", 1, lambda: [min(group("A.table2", "squared error ratio, K6 = 0.5, "))]),
    (
        MAIN,
        "force sine",
        1,
        lambda: [
            max(0.0, *group("A.fig5", "overshoot of fz")),
            *each("A.fig5", "coupling to fx", times=PERCENT),
            *each("A.fig5", "delay of fz", times=MILLI),
        ],
    ),
    (
        MAIN,
        "joints that run away",
        1,
        lambda: [above_one("A.stability", "growth, symmetric"), 6, above_one("A.stability", "growth, asymmetric")],
    ),
    (
        MAIN,
        "torque estimate, RMS",
        1,
        lambda: [max(group("A.torque_estimate", f"{run}: rms error")) for run in ("identify_motion", "stairs_swing")],
    ),
    (MAIN, "pushes whose growth", 1, lambda: [*group("A.stability", "pushes that prediction"), 24]),
    (MAIN, "linear verdict", 1, lambda: each("A.stability_grid", "verdicts that disagree")),
    (
        MAIN,
        "largest Kf",
        1,
        lambda: crossing("A.stability", "Kf at the border of force control, ", ("predicted", "simulated")),
    ),
    (
        MAIN,
        "K6 = 0.1, squared error",
        1,
        lambda: [
            min(group("A.beyond", "squared error ratio, K6 = 0.1, ")),
            min(group("A.table2", "squared error ratio, K6 = 0.1, ")),
        ],
    ),
    (MAIN, "K6 = 1, RMS error", 1, lambda: [min(group("A.beyond", "without over with, K6 = 1, "))]),
    (
        MAIN,
        "K_tau and K_v wrong",
        1,
        lambda: [
            min(group("A.beyond", "worst ratio, K6 = 0.1, K_tau x")),
            *each("A.beyond", "worst ratio, K6 = 0.1, sensors 5 ms late"),
        ],
    ),
    (
        MAIN,
        "tuned over the paper's setting",
        1,
        lambda: each(
            "A.tune",
            "tracking error, tuned over paper's, geometric mean of joints",
            "perturbed plants: tuned over paper's, median",
        ),
    ),
    (
        MAIN,
        "twenty robots",
        1,
        lambda: crossing("B.closed_loop", "runs that keep every limit, ", ("classic", *ROBUST)),
    ),
    (MAIN, "error of the cheapest", 1, lambda: each("B.test1", "mean |p - p_ind|")),
    (
        MAIN,
        "p over the classic",
        1,
        lambda: [pick(group("B.test2", "p over that of classic, w_f")) for pick in (min, max)],
    ),
    (
        MAIN,
        "wrong masses",
        1,
        lambda: crossing(
            "B.test5", "p_ind over classic, ", ("states with a missed limit", "controllers that miss a limit")
        ),
    ),
    (
        MAIN,
        "torque over wanted torque",
        1,
        lambda: crossing(
            "C.bode",
            "observer + P: ",
            ("largest | |H| |, 2 to 10 Hz [dB]", "phase off the pure delay, largest, 2 to 10 Hz [deg]"),
        ),
    ),
    (MAIN, "−3 dB bandwidth", 1, lambda: each("C.bode", "bandwidth, observer + P over PI")),
    (
        MAIN,
        "held joint at 1 Hz",
        1,
        lambda: each("C.held", "torque RMSE, observer + P over momentum observer", "the same but for the delay"),
    ),
    (
        MAIN,
        "hand's torque",
        1,
        lambda: each(
            "C.held",
            "transparency, observer + P: hand's torque over friction at 0.5 rad/s",
            "observer + P: hand's torque over friction, RMS over the whole motion",
            times=PERCENT,
        ),
    ),
    (
        MAIN,
        "base errors in these turns",
        1,
        lambda: [value for what in ("position", "velocity", "yaw") for value in motions(what, *TURNS)],
    ),
    (
        MAIN,
        "at 0.5 Hz with soles",
        1,
        lambda: [
            *base("C.soles", "taken for rigid: "),
            *(value for what in ("position", "velocity", "yaw") for value in group("C.soles", f"base {what} error")),
            *base("C.slip"),
        ],
    ),
    (
        MAIN,
        "joint damping over none",
        1,
        lambda: [value for id_ in reversed(TURNS) for value in each(id_, "trunk RMS, joint damping over none")],
    ),
    (
        MAIN,
        "largest push survived",
        1,
        lambda: each("C.pushes", *(f"{way}: {OURS_PUSHED} over stiff positions" for way in WAYS)),
    ),
    (MAIN, "33 sensor faults", 1, lambda: each("C.faults", "cases flagged within 50 ms", "cases that fell")),
]
