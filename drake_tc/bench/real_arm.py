"""What the benches of whole robots share: held-out errors joint by joint, as shares of each joint's torque."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drake_tc.bench.real_rows import RealRow
from drake_tc.diagnosis.arm import ArmHeldOut
from drake_tc.effects.base import Effect
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, SPECIAL
from drake_tc.types import FloatArray

LOOKED_FOR = (
    "viscous_power",
    "run_in_friction",
    "stribeck",
    "load_dependent_friction",
    "load_stribeck",
    "cable_spring",
    "asymmetric_friction",
    "presliding_hysteresis",
    "torque_ripple",
    "position_dependent_friction",
    "delay.torque_sensor",
)
"""Keys of the effects looked for on every shaft. Not those that need a measured load or a servo's command."""


def looked_for(keys: Sequence[str] = LOOKED_FOR) -> list[Effect]:
    """The effects of these keys."""
    return [e for e in (*LIBRARY, *SPECIAL, *MULTI_JOINT) if e.key in keys]


def rms(values: FloatArray) -> FloatArray:
    """(n,) over the rows."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def pooled(results: Sequence[ArmHeldOut]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """RMS (n,) of torque, declared and found residual over the held-out rows of all splits [N m]."""
    whole, before, after = (
        rms(np.concatenate([getattr(r, name) for r in results])) for name in ("torque", "before", "after")
    )
    return whole, before, after


def found_on(results: Sequence[ArmHeldOut], joint: int) -> str:
    """Effects found on shafts that load the joint, with the number of splits that found each."""
    seen: dict[str, int] = {}
    for result in results:
        axes = result.baseline.rows.axes
        here = [p for p in result.found if axes[p.axis].turns[joint] != 0.0]
        for label in {_label(axes[p.axis].name, p.term.effect.key, p.term.shape.get("cycles_per_turn")) for p in here}:
            seen[label] = seen.get(label, 0) + 1
    ordered = sorted(seen.items(), key=lambda item: -item[1])
    return ", ".join(f"{label} ({count}/{len(results)})" for label, count in ordered if 2 * count > len(results))


def _label(axis: str, key: str, cycles: float | None) -> str:
    return f"{axis} {key}" + ("" if cycles is None else f" {cycles:.0f}/turn")


def joint_rows(
    results: Sequence[ArmHeldOut], joints: Sequence[str], wanted: float, published: Sequence[float] | None = None
) -> list[RealRow]:
    """Three figures a joint: declared and found share of its torque's RMS, and their ratio, wanted at most `wanted`."""
    whole, before, after = pooled(results)
    out = []
    for j, joint in enumerate(joints):
        told = "" if published is None else f"data set's README: {published[j]:.3g}"
        limit = None if published is None else wanted * published[j]
        out += [
            RealRow(f"{joint}/declared_share", before[j] / whole[j], "-", note=f"of {whole[j]:.3g} N*m; {told}"),
            RealRow(
                f"{joint}/share", after[j] / whole[j], "-", limit, "max" if limit else "info", note=found_on(results, j)
            ),
            RealRow(f"{joint}/ratio", after[j] / before[j], "-", wanted, "max", note="found over declared, same rows"),
        ]
    return out


def set_folder(data: Path, name: str) -> Path:
    """The folder of a set: `data/name`, or `data` itself where it is the set."""
    return data / name if (data / name).is_dir() else data
