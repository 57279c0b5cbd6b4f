"""Figures of the loop of Faraji et al. (2015) in README tables: contacts, failing sensors, errors of the base."""

from readme_quotes import MILLI, PAPER_C, Quote, Values, each, recorded

BASE = "drake_tc/estimation/base/README.md"
ONE_FOOT, THREE_CONTACTS = "C.one_foot", "C.three_contacts"
ERRORS = ("position RMSE [m]", "velocity RMSE [m/s]", "yaw RMSE [rad]")
"""Of the base; tables have them in mm, mm/s and mrad."""
OVER_CENTRE = tuple(f"base {what} error, ours over foot centre" for what in ("position", "velocity", "yaw"))
SLIPS = "ticks with a slip seen by the estimator"
"""A tick is a millisecond."""
OURS, CENTRE = "CoP estimator: ", "foot centre: "
MOTIONS = ("C.turn1hz", "C.turn_half_hz", "C.genuflection")
FLAGGED = ": flagged after [s]"
SOLES = (
    "stiffness 30 % too large",
    "stiffness 30 % too small",
    "taken for rigid",
    "rigid, floor not known to be level",
)


def of(id_: str, *names: str, times: float = 1.0) -> Values:
    """The rows of these names on record."""
    return lambda: each(id_, *names, times=times)


def joined(*parts: Values) -> Values:
    """One after the other."""
    return lambda: [value for part in parts for value in part()]


def settings(count: int) -> Values:
    """Numbers of a cell that are not computed."""
    return lambda: [None] * count


def both_cases(begin: str, *names: str, times: float = 1.0) -> list[Quote]:
    """The same rows on one foot and on three contacts."""
    cases = enumerate((ONE_FOOT, THREE_CONTACTS), 1)
    return [(PAPER_C, begin, cell, of(id_, *names, times=times)) for cell, id_ in cases]


def base_errors(begin: str, id_: str, *estimates: str) -> list[Quote]:
    """A row of base errors: each cell has one error of all these estimates."""
    names = ([f"{estimate}: base {error}" for estimate in estimates] for error in ERRORS)
    return [(BASE, begin, cell, of(id_, *each_of, times=MILLI)) for cell, each_of in enumerate(names, 1)]


def flag_times() -> list[Quote]:
    """Every case of C.faults; the contact lost on one foot stands in the first column, with the standing robot's."""
    columns = {"stand": 1, "one_foot": 1, "turn_1hz": 2}
    names = [name for name in recorded("C.faults") if name.endswith(FLAGGED)]
    split = [(name, *name.removesuffix(FLAGGED).split(": ")) for name in names]
    return [
        (
            PAPER_C,
            f"{case} " if scenario == "one_foot" else f"{case} |",
            columns[scenario],
            of("C.faults", name, times=MILLI),
        )
        for name, scenario, case in split
    ]


COMAN: list[Quote] = [
    *both_cases("stands |", "time on these contacts [s]"),
    *both_cases(
        "centre of mass off", "centre of mass, largest error [m]", "centre of mass, error at the end [m]", times=MILLI
    ),
    (PAPER_C, "the lifted foot", 1, of(ONE_FOOT, "lifted foot, least height [m]", times=MILLI)),
    (
        PAPER_C,
        "normal force at the hand",
        2,
        joined(of(THREE_CONTACTS, "hand, least normal force [N]"), settings(1)),
    ),
    *both_cases(
        "a standing foot's normal force",
        "foot that stands, least normal force [N]",
        "foot that stands, largest tilt [rad]",
    ),
    *both_cases("torque, share of the limit", "largest share of a torque limit", "ticks without an answer"),
    (PAPER_C, "slips that the estimator sees", 1, of(ONE_FOOT, SLIPS)),
    (
        PAPER_C,
        "slips that the estimator sees",
        2,
        joined(of(THREE_CONTACTS, SLIPS, times=1.0 / MILLI), of(THREE_CONTACTS, "hand, moved by [m]", times=MILLI)),
    ),
    *both_cases("base errors: position", *(f"base {error}" for error in ERRORS), times=MILLI),
    *both_cases("over the foot centre's", *OVER_CENTRE),
    *both_cases("largest factor of", "largest factor on the pushes that is survived"),
    *flag_times(),
    *((PAPER_C, f"`{id_}`", 2, of(id_, f"{CENTRE}falls at [s]")) for id_ in MOTIONS[:2]),
    *base_errors("1 Hz, ours / chain", "C.turn1hz", "CoP estimator", "foot centre, in the same run"),
    *base_errors("0.5 Hz, ours / chain", "C.soles", "as it is", "foot centre, in the first run"),
    *base_errors("0.5 Hz, the chain with", "C.soles", "foot centre with the IMU"),
    *base_errors("0.5 Hz, ours, stiffness", "C.soles", *SOLES),
    *base_errors("0.5 Hz, friction 0.3", "C.slip", "CoP estimator", "foot centre"),
    (
        BASE,
        "0.5 Hz, friction 0.3",
        0,
        joined(
            settings(3),
            of("C.slip", *(f"{foot}: turned by at most [rad]" for foot in ("right_sole", "left_sole")), times=MILLI),
        ),
    ),
]

STANDS: list[tuple[str, str, int, dict[str, list[str]]]] = [
    *((PAPER_C, f"`{id_}`", cell, {id_: [loop]}) for id_ in MOTIONS for cell, loop in ((1, OURS), (2, CENTRE))),
]
"""File, beginning of the row, cell, and by reproduction the loops that the words `stands` and `falls` are of."""


def stands_or_falls(loops: dict[str, list[str]]) -> list[str]:
    """A word for each loop on record."""
    fell = [recorded(id_)[f"{name}fell"] for id_, names in loops.items() for name in names]
    return ["falls" if one else "stands" for one in fell]
