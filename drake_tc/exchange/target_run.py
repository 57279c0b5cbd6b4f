"""A recorded run driven through a target with a joint's terms: what the export is worth there.

The plant is that of Drake's free run: the motor's side of the gear under the recorded load torque, or the pendulum of
the rig file. Only the recorded command enters.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import LONGEST, Link, in_plant, longest_stretch, plant_side, recording_of
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import GRAVITY, FloatArray


@dataclass(frozen=True)
class RunInput:
    """What moves the joint of a target.

    Attributes:
        command: (T,) held over each period, in the drive's unit.
        load: (T,) torque that the joint passes on [N m].
        start: Position and velocity [rad, rad/s].
        period: Of command and load [s].
        substeps: Steps in one period.
    """

    command: FloatArray
    load: FloatArray
    start: tuple[float, float]
    period: float
    substeps: int = 1

    @property
    def step(self) -> float:
        """Of the target [s]."""
        return self.period / self.substeps


@dataclass(frozen=True)
class WrittenFile:
    """A file of the target, one of whose joints is run.

    Attributes:
        text: Of the file.
        joint: Name of the joint.
        folder: In which the file finds its meshes; None: it needs none.
        servo: Gain and damping of the user's controller [N m/rad, N m s/rad], where the file has no servo; None: the
            command is that of the file's own drive.
        torque_for_one: Torque for one unit of the command of a drive that is no servo [N m].
    """

    text: str
    joint: str
    folder: Path | None = None
    servo: tuple[float, float] | None = None
    torque_for_one: float = 1.0


Simulate = Callable[[Terms, Link | None, RunInput], FloatArray]
"""(T,) position of one joint [rad] with these terms and this link (None: the rotor alone); NaN once unstable."""
SimulateFile = Callable[[WrittenFile, Link | None, RunInput], FloatArray]
"""The same with a file and its own links; None in place of the link: the load is recorded."""


@dataclass(frozen=True)
class Runner:
    """What runs an export.

    Attributes:
        name: For people.
        simulate: The run.
        step: The longest one [s] at which the error of the integration is small beside that of a good model.
        simulate_file: The run of a file as it was written; None: a file has nothing that the terms do not have.
        file_step: The same of a file, whose integrator may be a simpler one.
        require: Raises ParamsError where it is not installed.
        too_old: Why the installed version cannot load these terms, a clause; "" where it can.
        ignores: Field of `Terms` that is written in the file and not used by the runner, to its name in the file.
    """

    name: str
    simulate: Simulate
    step: float
    simulate_file: SimulateFile | None = None
    file_step: float = 2e-4
    require: Callable[[], object] = lambda: None
    too_old: Callable[[Terms], str] = lambda _terms: ""
    ignores: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class PointMass:
    """A link with the inertia and gravity moment of a pendulum.

    Attributes:
        mass: [kg].
        arm: Distance of the centre of mass from the axis [m].
        inertia: About the centre of mass [kg m^2].
        zero: Position at which it hangs [rad].
    """

    mass: float
    arm: float
    inertia: float
    zero: float

    @classmethod
    def of(cls, link: Link) -> "PointMass":
        """Its mass is half of the length of the simple pendulum away; without a gravity moment it is on the axis."""
        if link.gravity_moment <= 0.0:
            return cls(1.0, 0.0, link.inertia, link.zero)
        arm = 0.5 * link.inertia * GRAVITY / link.gravity_moment
        mass = link.gravity_moment / (GRAVITY * arm)
        return cls(mass, arm, link.inertia - mass * arm**2, link.zero)

    def centre(self) -> tuple[float, float, float]:
        """At position 0, of a joint about the axis y [m]: the link hangs along -z at `zero`."""
        return self.arm * math.sin(self.zero), 0.0, -self.arm * math.cos(self.zero)


def target_free_run(
    runner: Runner, model: ActuatorModel, what: Terms | WrittenFile, rig: Rig, run: Run
) -> tuple[FloatArray, FloatArray] | None:
    """(recorded, simulated) position (T,) [rad] over the longest usable stretch of a run; None where nothing can run.

    Args:
        runner: Of the target.
        model: The identified one: its sensor effects are taken off the load and put on the position.
        what: Terms that the target is given on a bench, or a file that was written.
        rig: Of the run.
        run: Whose command drives it.

    Raises:
        ParamsError: the target is not installed, or refuses the model.
    """
    stretch = longest_stretch(run, LONGEST)
    if stretch is None:
        return None
    recording = recording_of(rig, model.joint, run, stretch)
    if recording.loop is not None:
        return None
    placed = in_plant(model, recording)
    if placed is None:
        return None
    side, recording = plant_side(*placed), placed[1]
    load = np.zeros(recording.time.size) if recording.load_torque is None else side.load
    given = RunInput(
        recording.command,
        load,
        (side.start, recording.initial_velocity),
        recording.period,
        max(1, math.ceil(recording.period / (runner.step if isinstance(what, Terms) else runner.file_step) - 1e-9)),
    )
    link, simulated = recording.pendulum, None
    if isinstance(what, WrittenFile) and runner.simulate_file is not None:
        simulated = runner.simulate_file(what, link, given)
    elif isinstance(what, Terms):
        simulated = runner.simulate(what, link, given)
    return None if simulated is None else (run.columns[f"{model.joint}/position"][stretch], side.shown(simulated))
