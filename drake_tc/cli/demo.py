"""The demo's rig: a simulated servo joint on a bench, whose owner's model lacks something.

    record_demo(folder, seed) -> rig.yaml, the training runs, the held-out runs

A pendulum on a position servo of high gear ratio, simulated by `drake_tc.loops.joint_bench`. The rig file declares
the rotor's inertia, and viscous and Coulomb friction as always; what else the simulated joint has is left out of it
and has to be found. The seed picks the missing effects and the sensors' noise.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.actuation.free_run import model_to_simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.analysis.sweep import processes
from drake_tc.identification.excitation import (
    Motion,
    MotionLimits,
    growing_sinusoid,
    multisine,
    postures_with_pushes,
)
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig, save_rig
from drake_tc.types import FloatArray

JOINT = "simulated_knee"
"""The name says in every table and report that nobody measured this."""
ROTOR_INERTIA = 0.31
"""[kg m^2], reflected through the gear; the only number that the demo's rig file declares."""
LINK_INERTIA, GRAVITY_MOMENT = 0.9, 18.0
"""Of the pendulum on the joint [kg m^2], [N m]."""
LIMITS = MotionLimits(position=(-1.1, 1.1), velocity=2.5, acceleration=14.0)
ENCODER_STEP = 2.0 * np.pi / 2**18
"""[rad]: a motor-side encoder seen through the gear."""
PUSH = 45.0
"""Largest push on the link [N m]."""

MISSING: tuple[tuple[EffectValue, ...], ...] = (
    (
        EffectValue("stribeck", {"stribeck": 4.0, "stribeck_velocity": 0.12, "stribeck_exponent": 1.6}),
        EffectValue("deadzone", {"deadzone": 1.2e-3}),
    ),
    (
        EffectValue("load_dependent_friction", {"load_friction": 0.12}),
        EffectValue("deadzone", {"deadzone": 1.5e-3}),
    ),
    (
        EffectValue("stribeck", {"stribeck": 5.0, "stribeck_velocity": 0.15, "stribeck_exponent": 1.6}),
        EffectValue("torque_ripple", {"ripple_cosine": 1.2, "ripple_sine": 0.9, "cycles_per_turn": 50.0}),
    ),
)
"""What a demo's joint has and its model lacks; seed modulo the number of rows picks one."""


@dataclass(frozen=True)
class DemoLength:
    """How long each run is [s] and how often it is sampled [s]; the simulation's step divides the period [s]."""

    duration: float = 30.0
    period: float = 1e-3
    step: float = 5e-4


def demo_model(seed: int) -> ActuatorModel:
    """The joint that is simulated: what its owner models and what he does not."""
    known = (
        EffectValue("rotor_inertia", {"rotor_inertia": ROTOR_INERTIA}),
        EffectValue("viscous", {"viscous": 32.0}),
        EffectValue("coulomb", {"coulomb": 6.0}),
    )
    return ActuatorModel(JOINT, Drive("position_servo", 2e-4), known + MISSING[seed % len(MISSING)])


def demo_excitation(seed: int, length: DemoLength) -> Mapping[str, tuple[Motion, FloatArray]]:
    """By run: the commanded motion, and the torque on the link from outside (T,) [N m].

    Source: Del Prete et al., 2016, section 3.
    """
    time = _clock(length)
    rng = np.random.default_rng([seed, 1])
    postures = postures_with_pushes(time, (-0.8, -0.2, 0.3, 0.9), PUSH, 4, LIMITS, rng)
    sinusoid = growing_sinusoid(time, 0.5, 0.05, 0.6 / length.duration, LIMITS)
    held = _from_rest(multisine(time, (0.1, 1.0), 8, LIMITS, rng))
    push = 0.4 * PUSH * np.sin(2.0 * np.pi * 0.23 * time)
    return {
        "postures_with_pushes": postures,
        "growing_sinusoid": (sinusoid, np.zeros_like(time)),
        "multisine_held_out": (held, push),
    }


def _from_rest(motion: Motion) -> Motion:
    """The same periodic motion, begun where its velocity is nearest to 0."""
    first = int(np.argmin(np.abs(motion.velocity)))
    q, v, a = (np.roll(x, -first) for x in (motion.position, motion.velocity, motion.acceleration))
    return Motion(q, v, a, motion.scale)


def record_demo(
    folder: Path,
    seed: int,
    length: DemoLength | None = None,
    jobs: int = 2,
) -> tuple[Path, list[Path], list[Path]]:
    """Simulate three runs of the demo's rig and write them as canonical Parquet logs beside `rig.yaml`.

    Args:
        folder: Where to write; made if need be.
        seed: Picks the missing effects, the pushes and the sensors' noise.
        length: Of the runs; None for 30 s at 1 kHz.
        jobs: Runs simulated beside each other, in processes of their own; 1 simulates them here.

    Returns:
        The rig file, the two runs to fit, and the run that is held out.
    """
    length = length or DemoLength()
    folder.mkdir(parents=True, exist_ok=True)
    names = tuple(demo_excitation(seed, length))
    paths = [folder / f"{name}.parquet" for name in names]
    if jobs == 1:
        for name, path in zip(names, paths, strict=True):
            _record_one(name, path, seed, length)
    else:
        with processes(jobs) as pool:
            for done in [pool.submit(_record_one, n, p, seed, length) for n, p in zip(names, paths, strict=True)]:
                done.result()
    rig = parse_rig({"joint": JOINT, "drive": "position_servo", "declared": {"rotor_inertia": ROTOR_INERTIA}})
    saved = save_rig(rig, folder / "rig.yaml", "Simulated bench of the demo: a geared joint under its vendor's servo.")
    return saved, paths[:2], paths[2:]


def demo_run(model: ActuatorModel, name: str, seed: int, length: DemoLength, rng: np.random.Generator) -> Run:
    """One run of the demo's bench.

    Args:
        model: The actuator as it is simulated with the step of `length`.
        name: Of the run, as in `demo_excitation`.
        seed: Of the excitation.
        length: Of the run.
        rng: Of the sensors' noise.
    """
    from drake_tc.loops.joint_bench import BenchScenario, Table, record_bench

    motion, push = demo_excitation(seed, length)[name]
    scenario = BenchScenario(
        duration=length.duration,
        log_period=length.period,
        step=length.step,
        link_inertia=LINK_INERTIA,
        gravity_moment=GRAVITY_MOMENT,
        encoder_resolution=ENCODER_STEP,
        torque_noise=0.15,
    )
    return record_bench(model, Table(_clock(length), motion.position, applied=push), scenario, rng, name)


def _record_one(name: str, path: Path, seed: int, length: DemoLength) -> None:
    """Simulate one run and write its log."""
    names = list(demo_excitation(seed, length))
    rng = np.random.default_rng([seed, 2, names.index(name)])
    run = demo_run(model_to_simulate(demo_model(seed), length.step), name, seed, length, rng)
    pd.DataFrame({"time": run.time, **run.columns}).to_parquet(path, index=False)


def _clock(length: DemoLength) -> FloatArray:
    return np.asarray(np.arange(round(length.duration / length.period) + 1) * length.period)
