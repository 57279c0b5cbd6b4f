"""Simulated months: joints that are diagnosed once and recorded again later, changed or not, for `compare`.

The joints are those of `drake_tc.joint_simulator`, which shares no formula with the effects. A joint is recorded in
three runs for its model and in two for each later session. Friction differs by a hundredth from session to session and
by half of that from run to run; the room is warmer or colder, the motions and loads are others. Half of the joints have
a lubricant whose friction falls with the temperature. What changes is drawn here and compared with what is told.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import yaml

from drake_tc.joint_simulator.measurement import clean_log, measured, sample_clean
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.reference import run_generator
from drake_tc.joint_simulator.spec import Drive, Joint, RigSpec, Sensors
from tests.benchmarks.blind.joints import draw_joint, draw_pendulum
from tests.benchmarks.figures import BenchmarkRow

CHANGES = (
    "none", "worn", "backlash", "warm", "none", "payload", "regreased", "encoder_offset", "weaker", "worn",
)  # fmt: skip
"""Drawn in turn: half of the sessions in which nothing changed have another temperature."""
FRICTION = ("viscous", "coulomb")
CHANGED = ("parameters_changed", "new_effect")
DURATION, RATE, STEP = 16.0, 500, 2e-4
SESSION_SPREAD, RUN_SPREAD = 0.01, 0.005


@dataclass(frozen=True)
class Month:
    """One joint, the day of its model and a later session.

    Attributes:
        number: Of the joint.
        change: One of `CHANGES`.
        before, after: Rigs on both days, without the spread from session to session.
        causes: Effect ids that are right to name: parameters that changed, or the effect that appeared.
        sizes: By effect id, the true change of its first parameter.
        exact: Whether these are the changes of the model's numbers too: not where friction depends on the temperature.
    """

    number: int
    change: str
    before: RigSpec
    after: RigSpec
    causes: frozenset[str]
    sizes: dict[str, float] = field(default_factory=dict)
    exact: bool = True


@dataclass(frozen=True)
class Told:
    """What `compare` says of a month.

    Attributes:
        verdict: As it stands in compare.json.
        named: Effect ids that changed, appeared or went. alternatives: those that explain as much.
        held: By effect id, (true change, low end, high end) of the parameters whose change is known exactly.
        large: Whether every parameter that changed did so by at least the width of its interval.
        problem: The error that ended it; "" for none.
    """

    number: int
    change: str
    verdict: str
    named: tuple[str, ...]
    alternatives: tuple[str, ...]
    causes: tuple[str, ...]
    held: dict[str, tuple[float, float, float]]
    seconds: float
    large: bool = True
    problem: str = ""

    @property
    def right(self) -> bool:
        """Whether all causes and nothing else was named; alternatives count as named where a cause is among them."""
        if self.change in ("none", "warm"):
            return self.verdict == "unchanged"
        named = set(self.named)
        if named & set(FRICTION):
            named -= {"thermal_friction"}  # what friction loses for each kelvin grows with the friction
        missed = set(self.causes) - named
        return bool(named) and missed <= set(self.alternatives) and len(named) == len(self.causes)

    @property
    def false_alarm(self) -> bool:
        """Whether a session without a change of the joint is told to have one."""
        return self.change in ("none", "warm") and self.verdict in ("parameters_changed", "new_effect")


def draw_month(seed: int, number: int) -> Month:
    """The joint of this number."""
    rng = np.random.default_rng([seed, number, 53])
    change = CHANGES[number % len(CHANGES)]
    pendulum = draw_pendulum(rng) if change == "encoder_offset" or rng.random() < 0.3 else None
    drives: tuple[Drive, ...] = ("current", "voltage", "position_servo")
    drive: Drive = drives[int(rng.integers(3))]
    joint = draw_joint(rng, drive, pendulum=pendulum)
    oily = rng.random() < 0.5 or change == "warm"
    rate = float(rng.uniform(0.01, 0.05)) if oily else 0.0
    shares = {"coulomb_share": float(rng.uniform(0.2, 0.6)), "viscous_share": 1.0}
    causes = {"thermal_friction": {"rate": rate} | shares} if oily else {}
    before = RigSpec(
        name=f"joint_{number}", group="null", kind=change, strength="", joint=joint, seed=int(rng.integers(2**31)),
        causes=causes, sensors=Sensors(rate_hz=RATE, torque_noise=float(rng.uniform(0.05, 0.25))), pendulum=pendulum,
        duration=DURATION, motor_position=change == "backlash",
    )  # fmt: skip
    warmer = (
        float(rng.uniform(6.0, 14.0) * rng.choice([-1.0, 1.0])) if change == "warm" else float(rng.normal(0.0, 1.0))
    )
    later = _warmed(joint, warmer, rate, shares["coulomb_share"])
    scale, more, right = _changed(change, rng, joint)
    later = replace(later, **{name: getattr(later, name) * factor for name, factor in scale.items()})
    after = replace(
        before, joint=later, causes=causes | more, seed=int(rng.integers(2**31)), hand=float(rng.uniform(0.6, 1.3))
    )
    return Month(number, change, before, after, right, _sizes(joint, later), exact=not oily)


def _warmed(joint: Joint, kelvin: float, rate: float, coulomb_share: float) -> Joint:
    """The joint in a room that is warmer."""
    return replace(
        joint,
        ambient=joint.ambient + kelvin,
        viscous=joint.viscous * float(np.exp(-rate * kelvin)),
        coulomb=joint.coulomb * float(np.exp(-rate * coulomb_share * kelvin)),
    )


def _changed(
    change: str, rng: np.random.Generator, joint: Joint
) -> tuple[dict[str, float], dict[str, dict[str, float]], frozenset[str]]:
    """Factors of the joint's numbers, causes that are new, and the effect ids that are right."""
    if change == "worn":
        name = str(rng.choice(["coulomb", "both"]))
        factor = 1.0 + float(rng.uniform(0.15, 0.6))
        names = FRICTION if name == "both" else ("coulomb",)
        return dict.fromkeys(names, factor), {}, frozenset(names)
    if change == "regreased":
        thinner, smoother = float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.6, 0.85))
        return {"viscous": thinner, "coulomb": smoother}, {}, frozenset(FRICTION)
    if change == "weaker":
        return {"gain": 1.0 / (1.0 - float(rng.uniform(0.06, 0.2)))}, {}, frozenset({"drive"})
    if change == "backlash":
        return {}, {"backlash": {"half_gap": float(rng.uniform(2e-4, 1e-3))}}, frozenset({"backlash"})
    if change == "encoder_offset":
        slip = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.05))
        return {}, {"encoder_offset": {"offset": slip}}, frozenset({"encoder_offset"})
    if change == "payload":
        load = {"mass": float(rng.uniform(0.3, 1.5)), "arm": float(rng.uniform(0.25, 0.45))}
        return {}, {"payload": load}, frozenset({"payload"})
    return {}, {}, frozenset()


def _sizes(before: Joint, after: Joint) -> dict[str, float]:
    return {
        "drive": after.gain - before.gain,
        "viscous": after.damping - before.damping,
        "coulomb": after.coulomb - before.coulomb,
    }


def write_month(month: Month, folder: Path) -> None:
    """rig.yaml, then_*.parquet and now_*.parquet."""
    rng = np.random.default_rng([month.before.seed, 1])
    record(month.before, ("static", "sine", "multisine"), folder, "then", np.ones(2), rng)
    session = np.exp(rng.normal(0.0, SESSION_SPREAD, 2))
    record(month.after, ("static", "multisine"), folder, "now", session, rng)
    write_rig(month.before, folder)


def record(
    spec: RigSpec, runs: Sequence[str], folder: Path, day: str, session: np.ndarray, rng: np.random.Generator
) -> list[Path]:
    """Simulate runs of a session and write DAY_RUN.parquet; `session` are its factors of viscous and Coulomb friction.

    Friction differs by `RUN_SPREAD` from run to run beside it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    specs, paths = [], []
    for _ in runs:
        factor = session * np.exp(rng.normal(0.0, RUN_SPREAD, 2))
        joint = replace(spec.joint, viscous=spec.joint.viscous * factor[0], coulomb=spec.joint.coulomb * factor[1])
        specs.append(replace(spec, joint=joint))
    for recorded in simulate(specs, list(runs), STEP):
        noise = run_generator(recorded.spec, recorded.run, 1)
        log = clean_log(recorded)
        clean = sample_clean(log, np.zeros_like(log.time), recorded.spec.sensors, noise)
        paths.append(folder / f"{day}_{recorded.run}.parquet")
        measured(clean, recorded.spec, noise).to_parquet(paths[-1], index=False)
    return paths


def write_rig(spec: RigSpec, folder: Path) -> None:
    """rig.yaml of a joint."""
    rig: dict[str, object] = {
        "joint": "joint",
        "drive": spec.joint.drive,
        "declared": {"rotor_inertia": spec.joint.rotor_inertia},
    }
    if spec.pendulum is not None:
        rig["load"] = {"pendulum": dict(zip(("mass", "length"), spec.pendulum, strict=True))}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")


def watch_month(seed: int, number: int, root: Path) -> Told:
    """Simulate, diagnose and compare one month."""
    import warnings

    from drake_tc.diagnosis.options import DiagnosisOptions
    from drake_tc.diagnosis.result.models import models_of
    from drake_tc.diagnosis.run import close_loop
    from drake_tc.errors import DrakeTcError
    from drake_tc.watch.compare import compare

    warnings.simplefilter("ignore")
    month, folder = draw_month(seed, number), root / f"joint_{number}"
    options = DiagnosisOptions(assess_residual=False)
    try:
        if not (folder / "model_after.yaml").exists():
            write_month(month, folder)
            then = [folder / f"then_{run}.parquet" for run in ("static", "sine", "multisine")]
            models_of(close_loop(folder / "rig.yaml", then[:2], then[2:], options), folder)
        logs = [folder / f"now_{run}.parquet" for run in ("static", "multisine")]
        found = compare(folder / "model_after.yaml", logs, options=options)
    except (DrakeTcError, ArithmeticError) as error:
        return Told(number, month.change, "refused", (), (), tuple(sorted(month.causes)), {}, 0.0, problem=str(error))
    (joint,) = found.joints.values()
    changed = [p for p in joint.parameters if p.changed]
    moved = [e.key for e in joint.effects if e.status in ("appeared", "gone")]
    others = [a.split(".")[0] for p in changed for a in p.alternatives]
    others += [b for a, b in joint.diagnosis.indistinguishable if a in moved]
    held = {
        p.key: (month.sizes[p.key], *p.change.ci95)
        for p in joint.parameters
        if p.key in month.sizes and p.name in (p.key, "gain")
    }
    return Told(
        number,
        month.change,
        found.verdict,
        tuple(sorted({key.split(".")[0] for key in [*(p.key for p in changed), *moved]})),
        tuple(sorted(set(others))),
        tuple(sorted(month.causes)),
        held if month.exact else {},
        found.seconds,
        all(abs(true) >= high - low for key, (true, low, high) in held.items() if key in month.causes),
    )


def months(seed: int, count: int, folder: Path, pool: Executor, progress: Callable[[str, float], None]) -> list[Told]:
    """What is told of `count` joints."""
    waiting = [pool.submit(watch_month, seed, number, folder) for number in range(count)]
    out = []
    for done, each in enumerate(waiting):
        out.append(each.result())
        progress("months", (done + 1) / count)
    return out


def month_rows(told: Sequence[Told]) -> list[BenchmarkRow]:
    """Shares of right answers, false alarms and intervals that hold."""
    still = [t for t in told if t.change in ("none", "warm")]
    moved = [t for t in told if t not in still]
    large = [t for t in moved if t.large]
    held = [low <= true <= high for t in told for true, low, high in t.held.values()]
    rows = [
        BenchmarkRow.share("cause right, of changes of an interval's width", [t.right for t in large], "min", 0.95),
        BenchmarkRow.share("cause right, of all changes", [t.right for t in moved]),
        BenchmarkRow.share("cause among those named, of all changes", [set(t.causes) <= set(t.named) for t in moved]),
        BenchmarkRow.share("change noticed, of all changes", [t.verdict in CHANGED for t in moved]),
        BenchmarkRow.share("false alarms, of sessions without a change", [t.false_alarm for t in still], "max", 0.01),
        BenchmarkRow.share("intervals of changes that hold", held, "within", 0.95, 0.03),
    ]
    return rows + [
        BenchmarkRow.share(f"right: {c}", [t.right for t in told if t.change == c]) for c in dict.fromkeys(CHANGES)
    ]
