"""Sets each cause's amplitude so that it changes the torque balance by the requested RMS, by coarse pilot runs."""

from dataclasses import replace

import numpy as np

from drake_tc.joint_simulator.amplitudes import AMPLITUDES
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.spec import DivergedError, RigSpec
from tests.benchmarks.blind.truth import beyond_refit

PILOT_STEP = 2.5e-4
PILOT_RUNS = ("sine", "multisine")
ROUNDS = 9


def calibrate(specs: list[RigSpec], rounds: int = ROUNDS) -> list[RigSpec]:
    """The same rigs with amplitudes that meet `targets`, each cause calibrated alone.

    Secant steps on log(strength) against log(|amplitude|), halving steps where the target lies between two trials and
    the secant leaves them (a saturation's strength jumps), from coarse simulations (0.25 ms) of the two moving
    runs; an amplitude stays within its plausible range, so that a strength may be missed (the truth file has
    the strength that was reached).
    """
    jobs = [(i, cause) for i, spec in enumerate(specs) for cause in spec.causes if cause in spec.targets]
    if not jobs:
        return list(specs)
    searches = [_Search(replace(specs[i], causes={c: specs[i].causes[c]}), c, specs[i].targets[c]) for i, c in jobs]
    for _ in range(rounds):
        active = [search for search in searches if not search.done]
        if active:
            for search, strength in zip(active, _pilot([s.spec for s in active]), strict=True):
                search.update(strength)
    found: list[RigSpec] = list(specs)
    for (i, cause), search in zip(jobs, searches, strict=True):
        found[i] = with_cause(found[i], cause, search.best.causes[cause])
    return found


def weakened(spec: RigSpec, factor: float = 0.7) -> RigSpec:
    """The rig with the amplitude of every cause nearer to nothing, for a joint that ran away."""
    for cause, values in spec.causes.items():
        amplitude = AMPLITUDES[cause]
        scale = factor if amplitude.power > 0 else 1.0 / factor
        spec = with_cause(spec, cause, dict(values) | {amplitude.name: values[amplitude.name] * scale})
    return spec


def with_cause(spec: RigSpec, cause: str, values: dict[str, float] | object) -> RigSpec:
    """The rig with other parameters of one cause; a rotor's inertia is kept equal to the joint's."""
    causes = dict(spec.causes) | {cause: values}
    joint = spec.joint
    if cause == "rotor_inertia":
        joint = replace(joint, rotor_inertia=float(causes[cause]["inertia"]))  # type: ignore[index]
    return replace(spec, causes=causes, joint=joint)  # type: ignore[arg-type]


def _pilot(specs: list[RigSpec]) -> list[float]:
    """Strength of each rig [N m]; infinity where its simulation diverges."""
    named = [replace(spec, name=str(i)) for i, spec in enumerate(specs)]
    columns = [spec for spec in named for _ in PILOT_RUNS]
    try:
        records = simulate(columns, list(PILOT_RUNS) * len(specs), PILOT_STEP, record_every=2)
    except DivergedError as error:
        calm = [spec for spec in named if spec.name not in error.names]
        rest = iter(_pilot(calm) if calm else [])
        return [np.inf if spec.name in error.names else next(rest) for spec in named]
    return [beyond_refit(records[2 * i : 2 * i + 2]) for i in range(len(specs))]


class _Search:
    """One amplitude's search."""

    def __init__(self, spec: RigSpec, cause: str, target: float) -> None:
        self.amplitude = AMPLITUDES[cause]
        self.cause, self.target = cause, target
        self.slope, self.done, self.miss = self.amplitude.power, False, np.inf
        self.last: tuple[float, float] | None = None
        self.weaker: float | None = None  # log |amplitude| of the trials next to the target
        self.stronger: float | None = None
        scale = (target / 0.8) ** (1.0 / self.slope)
        self.spec = self.best = self._at(spec, self._value(spec) * scale)

    def _value(self, spec: RigSpec) -> float:
        return float(spec.causes[self.cause][self.amplitude.name])

    def _at(self, spec: RigSpec, value: float) -> RigSpec:
        size = float(np.clip(abs(value), self.amplitude.lower, self.amplitude.upper))
        values = dict(spec.causes[self.cause]) | {self.amplitude.name: float(np.copysign(size, value))}
        return with_cause(spec, self.cause, values)

    def update(self, strength: float) -> None:
        """Take in the strength of the last trial and choose the next."""
        value = self._value(self.spec)
        miss = abs(np.log(max(strength, 1e-9) / self.target)) if np.isfinite(strength) else np.inf
        if miss < self.miss:
            self.best, self.miss = self.spec, miss
        if miss < 0.07:
            self.done = True
            return
        here = (np.log(abs(value)), np.log(max(strength, 1e-9)))
        if strength < self.target:
            self.weaker = here[0]
        else:
            self.stronger = here[0]
        if not np.isfinite(strength):
            middle = None if self.weaker is None else float(np.exp(0.5 * (self.weaker + here[0])))
            self._try(value, middle or abs(value) * (0.5 if self.slope > 0 else 2.0))
            return
        if self.last is not None and abs(here[0] - self.last[0]) > 1e-6:
            slope = (here[1] - self.last[1]) / (here[0] - self.last[0])
            low, high = sorted((0.3 * self.amplitude.power, 4.0 * self.amplitude.power))
            self.slope = float(np.clip(slope, low, high))
        self.last = here
        step = float(np.clip((np.log(self.target) - here[1]) / self.slope, -1.2, 1.2))
        self._try(value, np.exp(self._within(here[0] + step)))

    def _try(self, value: float, size: float) -> None:
        self.spec = self._at(self.spec, float(np.copysign(size, value)))

    def _within(self, proposed: float) -> float:
        """The proposed log |amplitude|, or the middle of the trials next to the target where it leaves them."""
        if self.weaker is None or self.stronger is None:
            return proposed
        low, high = sorted((self.weaker, self.stronger))
        margin = 0.05 * (high - low)
        return proposed if low + margin < proposed < high - margin else 0.5 * (low + high)
