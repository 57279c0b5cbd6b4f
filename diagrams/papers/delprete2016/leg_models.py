"""The leg's identified models as committed data: the paper's two linear fits, and the complete model.

python -m drake_tc.diagrams.papers.delprete2016.leg_models models/hrp2_like    # writes them anew
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import save_models
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagrams.papers.delprete2016.identification import WEIGHT
from drake_tc.diagrams.papers.delprete2016.table1 import Table1, identify_table1

STEM = "hrp2_like_leg"
EXPERIMENT = "diagrams/papers/delprete2016/identification.py"
LINEAR_NOTE = (
    "effort = K_tau torque + K_v velocity, viscous = K_v/K_tau; no Coulomb column and no rotor inertia, as in the paper"
)
HOW: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "symmetric": ("least squares on K_tau, K_v", LINEAR_NOTE, ("motion", "pushes")),
    "asymmetric": (f"asymmetric penalty, w = {WEIGHT:g}, on K_tau, K_v", LINEAR_NOTE, ("motion", "pushes")),
    "identified": (
        "close-loop; declared without values: viscous, coulomb, rotor_inertia, velocity_sign_switch; found: deadzone",
        "rotor_inertia holds b h/2 of the sampled simulation besides (h = 1 ms); torques read 0.5 % too large",
        ("motion", "sway"),
    ),
}
"""Name to method, note and the runs it was fitted to."""


def leg_models(data: Table1) -> dict[str, dict[str, ActuatorModel]]:
    """The three models of what was identified with the dead zone not declared."""
    identified = {joint: model_of(result, final=True) for joint, result in data.hidden["deadzone"].items()}
    return {**{penalty: dict(models) for penalty, models in data.linear.items()}, "identified": identified}


def write_leg_models(models: Mapping[str, Mapping[str, ActuatorModel]], folder: Path, seed: int = 0) -> list[Path]:
    """Write one model file each into `folder`; their paths."""
    paths = []
    for name, by_joint in models.items():
        method, note, runs = HOW[name]
        provenance = {
            "identified_by": "diagrams/papers/delprete2016/leg_models.py",
            "method": method,
            "record": [f"simulated run {run!r} of {EXPERIMENT}, seed {seed}" for run in runs],
            "note": note,
        }
        paths.append(folder / f"{STEM}_{name}.yaml")
        save_models(by_joint, paths[-1], provenance=provenance)
    return paths


def main() -> None:
    """Record the experiment anew, identify every joint, and write the files into the folder that is named."""
    folder = Path(sys.argv[1])
    for path in write_leg_models(leg_models(identify_table1(0, hidden=("deadzone",))), folder):
        print(path)


if __name__ == "__main__":
    main()
