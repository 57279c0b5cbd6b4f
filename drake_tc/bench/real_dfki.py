"""`bench real-dfki`: the model equation of a quasi-direct-drive pendulum on runs that took no part in the fit."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from drake_tc.bench.real_fit import HeldOut, hold_out
from drake_tc.bench.real_rows import RealRow
from drake_tc.logs.importers.dfki import TORQUE_PER_AMPERE, convert
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig

DATA_SET = "dfki-simple-pendulum"
GOOD = {
    "ddp": ("control_method_ddp__data_measured", None),
    "direct_collocation": ("control_method_direct_collocation__data_measured", None),
    "energy_shaping": ("control_method_energy_shaping__data_measured", 7.0),
    "sac": ("control_method_sac__data_measured", 7.0),
}
"""Runs that nobody touches; the last two only until the first push by hand [s]."""
HELD = ("ddp", "direct_collocation")
PUBLISHED = {"ddp": 0.236, "direct_collocation": 0.296}
"""In-sample residual [N m] of five free parameters after an 80 ms Savitzky-Golay filter."""
WIDTHS = {"80ms": 0.057, "shared_band": 0.16}
"""Twice through a kernel of 57 ms is as narrow as the published filter once. Twice through 160 ms passes half the power
at 4.7 Hz. From 3.4 Hz up the coherence of torque and motion is below 0.5 in three of the four runs (ddp: from 5.6 Hz);
where it rises again, in direct_collocation, its phase is that of the controller's answer to the encoder. This width was
chosen with all runs in sight, the held-out ones included: the figures of that band are not blind to it."""
WANTED = 0.15
LEFT_OUT = ("saturation", "deadzone")
"""A current drive rated at 12 N m, asked for at most 4: it neither clips nor has a dead zone."""
FLOOR = 0.01


def good_runs(data: Path) -> tuple[dict[str, Run], Rig]:
    """The good runs by short name, and their rig.

    Raises:
        LogError: the set is not in `data`.
    """
    with TemporaryDirectory() as scratch:
        convert(data / DATA_SET, Path(scratch))
        folder = Path(scratch) / "simple"
        rig = load_rig(folder / "rig.yaml")
        runs = {}
        for name, (file, end) in GOOD.items():
            run = load_runs([folder / f"{file}.parquet"], rig)[0]
            if end is not None:
                segment = run.segment.copy()
                segment[run.time - run.time[0] > end] = -1
                run = replace(run, segment=segment)
            runs[name] = run
    return runs, rig


def held_out(data: Path, width_s: float) -> dict[str, HeldOut]:
    """Each of `HELD` predicted from all other good runs."""
    runs, rig = good_runs(data)
    return {
        name: hold_out([run for other, run in runs.items() if other != name], runs[name], rig, width_s, LEFT_OUT, FLOOR)
        for name in HELD
    }


def rows(data: Path) -> list[RealRow]:
    """The table: residual [N m of reported torque] before and after, and as a share of the torque's RMS."""
    out = []
    for label, width in WIDTHS.items():
        for name, result in held_out(data, width).items():
            before, after = (result.command_error(m) * TORQUE_PER_AMPERE for m in (result.baseline, result.chosen))
            whole = result.command_rms() * TORQUE_PER_AMPERE
            found = ", ".join(result.found) or "nothing"
            out += [
                RealRow(
                    f"{name}/{label}/residual_before", before, "N*m", note=f"published in-sample {PUBLISHED[name]}"
                ),
                RealRow(f"{name}/{label}/residual", after, "N*m", WANTED, "max", note=f"found: {found}"),
                RealRow(f"{name}/{label}/residual_share", after / whole, "-", note=f"of {whole:.2f} N*m RMS"),
            ]
    return out
