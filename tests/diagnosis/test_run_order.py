"""Runs have one order, by what they hold alone: not by files, names, units, zeros or signs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_tc.logs.prepare import in_order
from drake_tc.logs.record import Run

from .rigs import Joint, record, rig_of, servo

SHORT = Joint(duration=2.0, period=1e-2, encoder_noise=1e-4)
RIG = rig_of(SHORT)


def runs_of(joint: Joint) -> list[Run]:
    """Five runs: other motions, one longer, one at another period."""
    made = [record(joint, f"run{k}", 0.4 * k, k) for k in range(3)]
    made.append(record(replace(joint, duration=2.5), "longer", 0.1, 7))
    return [*made, record(replace(joint, period=1.25e-2, duration=2.5), "slower", 0.3, 8)]


RUNS = runs_of(SHORT)


def positions(runs: list[Run]) -> list[tuple[float, ...]]:
    """First samples, without sign or zero, by which a run is known."""
    return [tuple(np.abs(np.diff(r.columns["joint/position"][:4])).round(9)) for r in runs]


@settings(max_examples=60)
@given(
    st.permutations(range(5)),
    st.permutations(["a", "b", "c", "d", "e"]),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-3.0, 3.0),
)
def test_files_names_signs_and_zeros_do_not_change_the_order(order, names, sign, zero):
    made = []
    for k, name in zip(order, names, strict=True):
        columns = {n: sign * x + (zero if n.endswith("position") else 0.0) for n, x in RUNS[k].columns.items()}
        made.append(replace(RUNS[k], name=name, source=Path(name), columns=columns))
    assert positions(in_order(made, RIG)) == positions(in_order(RUNS, RIG))


def test_length_and_period_come_first():
    found = in_order(RUNS, RIG)
    assert [len(r) for r in found] == sorted(len(r) for r in RUNS)
    two = [record(replace(SHORT, period=p, duration=200 * p), f"{p}") for p in (2e-2, 1e-2)]
    assert [r.period for r in in_order(two, RIG)] == [1e-2, 2e-2]


def test_the_same_motion_under_another_load_has_its_place():
    """The command tells apart what the position does not."""
    light, heavy = (replace(SHORT, encoder_noise=0.0, gain=g) for g in (0.08, 0.09))
    made = [record(light, "light"), record(heavy, "heavy")]
    assert [r.name for r in in_order(made, RIG)] == ["light", "heavy"]
    assert [r.name for r in in_order(made[::-1], RIG)] == ["light", "heavy"]


def test_a_servo_is_ordered_by_its_position_command():
    joint = servo(duration=2.0, period=1e-2)
    made = [record(joint, "soft"), record(replace(joint, gain=4e-2), "softer")]
    first = in_order(made, rig_of(joint))
    assert [r.name for r in first] == [r.name for r in in_order(made[::-1], rig_of(joint))]
    with pytest.raises(KeyError):
        in_order(made, RIG)  # the rig of a current drive has no current to go by
