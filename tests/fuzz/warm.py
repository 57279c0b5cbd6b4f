"""Has the kernels compiled that cases use: sound calls of the commands that compile any."""

from pathlib import Path

import numpy as np
import yaml

from drake_tc.cli.main import run

from .cases import MORE_FIELDS
from .sound import Sound


def warm(sound: Sound, folder: Path) -> None:
    """Simulate every diagram of the cases for a few ticks, with its further fields too, and estimate a base.

    Args:
        sound: Sound files.
        folder: For files of the calls; it is empty before.
    """
    for name, scenarios in sound.scenarios.items():
        ((scenario, own),) = scenarios.items()
        path = folder / f"{name}.yaml"
        path.write_text(yaml.safe_dump({scenario: own, "more": own | MORE_FIELDS[name]}), encoding="utf-8")
        for chosen in (scenario, "more"):
            _called("simulate", name, "--scenario-file", path, "--scenario-name", chosen, "--duration", 0.01, "--json")
    rig, log = folder / "rig.yaml", folder / "run.npz"
    rig.write_text(yaml.safe_dump(sound.base_rig), encoding="utf-8")
    np.savez(log, **sound.base)
    _called("estimate-base", "--rig", rig, "--log", log, "--out", folder / "out", "--json")


def _called(*arguments: object) -> None:
    assert run([str(argument) for argument in arguments]) == 0, arguments
