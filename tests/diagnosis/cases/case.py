"""One row of the table: who records what, what is true of it, and which answers of `close_loop` count as right."""

import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import DrakeTcError

NULL = frozenset({"no_missing_effect"})
FOUND = frozenset({"effects_found"})
RED = frozenset({"unexplained_structure", "unexplained_residual", "cannot_tell"})
"""Verdicts that leave something open."""
ANY = NULL | FOUND | RED


@dataclass(frozen=True)
class Recorded:
    """A rig file with its training and held-out logs."""

    rig: Path
    train: Sequence[Path]
    held: Sequence[Path]


Record = Callable[[Path, int], Recorded]
"""Writes the files of a seed into a folder."""


@dataclass(frozen=True)
class Is:
    """A true value, and how far an estimate may be off: `within` of its size plus `by`.

    With `interval`, the 95 % interval, widened by as much on both sides, must hold the value instead.
    """

    value: float
    within: float = 0.05
    by: float = 0.0
    interval: bool = False

    def objection(self, estimate: Any) -> str:
        """Why the estimate is wrong, or nothing."""
        room = self.within * abs(self.value) + self.by
        low, high = estimate.ci95 if self.interval else (estimate.value, estimate.value)
        if low - room <= self.value <= high + room:
            return ""
        told = f"[{low:.6g}, {high:.6g}]" if self.interval else f"{low:.6g}"
        return f"{told}, expected {self.value:.6g} ± {room:.2g}"


@dataclass(frozen=True)
class Case:
    """A row.

    What is named is told as the id of an effect, as `joint/id` in a rig of several joints, as `id@place` where no
    single joint owns it, and as `set_up.kind@joints` for an error of a robot's set-up.

    Attributes:
        name: Unique. The part before the first colon is the theme.
        record: Writes the files.
        truth: What is missing in the declared model: name to parameters with their values (5 %) or an `Is`.
        allowed: Sets of names that count as right; None takes the names of `truth` alone.
        extras: Names that may stand beside each of these sets.
        never: If not empty, any set without one of these names is right, and `allowed` is not asked.
        verdicts: Allowed ones; None takes those that fit: none missing for no effects, found for some.
        values: Further parameters of the final model: `effect.parameter` (`joint/effect.parameter`).
        refusal: Pattern of the one-line message with which the input is refused.
        may_refuse: Pattern of a refusal that counts as right as well.
        twin: Records the same in another way: names, verdict and values (`twin_within`) must be the same.
        seeds: Of the recorder; each is a case of its own.
    """

    name: str
    record: Record
    truth: Mapping[str, Mapping[str, float | Is]] = field(default_factory=dict)
    allowed: Sequence[frozenset[str]] | None = None
    extras: frozenset[str] = frozenset()
    never: frozenset[str] = frozenset()
    verdicts: frozenset[str] | None = None
    values: Mapping[str, float | Is] = field(default_factory=dict)
    refusal: str = ""
    may_refuse: str = ""
    twin: Record | None = None
    twin_within: float = 1e-6
    seeds: Sequence[int] = (0,)

    @property
    def right(self) -> Sequence[frozenset[str]]:
        """Sets of names that count as right."""
        return (frozenset(self.truth),) if self.allowed is None else self.allowed

    @property
    def right_verdicts(self) -> frozenset[str]:
        """Verdicts that count as right."""
        if self.verdicts is not None:
            return self.verdicts
        if self.never:
            return ANY
        return frozenset().union(*(FOUND if names else NULL for names in self.right))


@dataclass(frozen=True)
class Answer:
    """What `close_loop` said: names with parameters, all parameters of the final models, verdict, or a refusal."""

    found: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    verdict: str = ""
    floors: Mapping[str, float] = field(default_factory=dict)
    indistinguishable: Sequence[Sequence[str]] = ()
    refusal: str = ""
    contradictions: Sequence[str] = ()

    def __str__(self) -> str:
        if self.refusal:
            return f"refused: {self.refusal}"
        named = [f"{name}({', '.join(_told(*p) for p in values.items())})" for name, values in self.found.items()]
        ties = (
            f", indistinguishable {[list(pair) for pair in self.indistinguishable]}" if self.indistinguishable else ""
        )
        left = ", ".join(f"{name or 'joint'} {floors:.2f}" for name, floors in self.floors.items())
        return f"found {', '.join(named) or 'nothing'}; verdict {self.verdict}; floors left {left}{ties}"


@dataclass(frozen=True)
class Outcome:
    """What came of one case."""

    case: str
    answer: Answer
    problems: Sequence[str]
    seconds: float

    @property
    def is_right(self) -> bool:
        return not self.problems


def run_case(case: Case, seed: int, folder: Path) -> Outcome:
    """Record, diagnose and judge; the seconds are those of the processor in the diagnosis alone."""
    recorded = case.record(_made(folder / "case"), seed)
    begin = time.process_time()
    answer = answer_of(recorded)
    seconds = time.process_time() - begin
    problems = list(objections(case, answer))
    if case.twin is not None and not answer.refusal:
        other = answer_of(case.twin(_made(folder / "twin"), seed))
        problems += differences(answer, other, case.twin_within)
    return Outcome(f"{case.name}[{seed}]", answer, problems, seconds)


def answer_of(recorded: Recorded) -> Answer:
    """What `close_loop` says of these files."""
    try:
        result = close_loop(recorded.rig, recorded.train, recorded.held)
    except DrakeTcError as refused:
        return Answer(refusal=str(refused))
    several = len(result.joints) > 1
    found: dict[str, Mapping[str, Any]] = {}
    values: dict[str, Any] = {}
    for joint, each in result.joints.items():
        place = f"{joint}/" if several else ""
        found |= {place + e.id: e.parameters for e in each.effects}
        for key, group in each.final_parameters.items():
            values |= {f"{place}{key}.{name}": estimate for name, estimate in group.items()}
    found |= {f"{e.id}@{e.where}": e.parameters for e in result.shared}
    if result.set_up is not None:
        found |= {f"set_up.{e.kind}@{','.join(e.joints or sorted(e.runs))}": {} for e in result.set_up.errors}
    if result.links is not None:
        for run, payload in result.links.payloads.items():
            values |= {f"{run}.{name}": estimate for name, estimate in payload.items()}
    floors = {name if several else "": each.unexplained.floors for name, each in result.joints.items()}
    ties = [pair for each in result.joints.values() for pair in each.indistinguishable]
    return Answer(found, values, result.verdict, floors, ties, contradictions=tuple(contradictions(result.joints)))


def contradictions(joints: Mapping[str, JointResult]) -> Iterator[str]:
    """Effects that a result says to lack evidence although its own odds name them, or tells twice."""
    for joint, each in joints.items():
        told = [e.id for e in (*each.effects, *each.did_not_hold)]
        for other in each.rejected:
            if other.reason == "too_little_evidence" and other.log_odds >= ALTERNATIVE:
                yield f"{joint}: {other.key} has log odds of {other.log_odds:+.1f} and is not named"
            if other.id in told:
                yield f"{joint}: {other.key} is told twice"


def objections(case: Case, answer: Answer) -> Iterator[str]:
    """What is wrong with an answer, one line each."""
    if answer.refusal:
        pattern = case.refusal or case.may_refuse
        if not pattern:
            yield f"refused: {answer.refusal}"
        elif not re.search(pattern, answer.refusal):
            yield f"refused with {answer.refusal!r}, expected {pattern!r}"
        elif "\n" in answer.refusal:
            yield f"the refusal has several lines: {answer.refusal!r}"
        return
    if case.refusal:
        yield f"expected a refusal: {case.refusal!r}"
        return
    yield from answer.contradictions
    named = frozenset(answer.found)
    if case.never:
        if named & case.never:
            yield f"names {sorted(named & case.never)}, which must not be named"
    elif not any(right <= named <= right | case.extras for right in case.right):
        yield f"names {sorted(named)}, allowed {[sorted(right) for right in case.right]}"
    if answer.verdict not in case.right_verdicts:
        yield f"verdict {answer.verdict}, allowed {sorted(case.right_verdicts)}"
    for name, parameters in case.truth.items():
        for parameter, true in parameters.items():
            if name in answer.found:
                yield from _off(f"{name}.{parameter}", answer.found[name].get(parameter), true)
    for name, true in case.values.items():
        yield from _off(name, _value(answer.values, name), true)


def differences(one: Answer, other: Answer, within: float) -> Iterator[str]:
    """What two answers of the same recording do not share."""
    if other.refusal or (one.verdict, set(one.found)) != (other.verdict, set(other.found)):
        yield f"recorded in another way: {other}"
        return
    for name, estimate in one.values.items():
        if abs(other.values[name].value - estimate.value) > within * abs(estimate.value):
            yield f"recorded in another way, {name} is {other.values[name].value:.8g} and not {estimate.value:.8g}"


def _value(values: Mapping[str, Any], name: str) -> Any:
    """The parameter of this name; `load.moment` is that of an unknown load of whatever form."""
    place, load, parameter = name.rpartition("load.")
    if load:
        names = [key for key in values if key.startswith(f"{place}unknown_load.") and key.endswith(f".{parameter}")]
        return values[names[0]] if names else None
    return values.get(name)


def _off(name: str, estimate: Any, true: float | Is) -> Iterator[str]:
    if estimate is None:
        yield f"no value of {name}"
    elif objection := (true if isinstance(true, Is) else Is(true)).objection(estimate):
        yield f"{name} is {objection}"


def _told(name: str, estimate: Any) -> str:
    return f"{name} {estimate.value:.4g} [{estimate.ci95[0]:.4g}, {estimate.ci95[1]:.4g}]"


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder
