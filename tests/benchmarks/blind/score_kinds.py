"""The score by group and kind: how many rigs were answered rightly, and what the others were taken for."""

from collections.abc import Sequence

import pandas as pd

from tests.benchmarks.blind.outcome import Outcome


def kind_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """One row for each group, kind and strength: `group`, `kind`, `strength`, `rigs`, `right`, `acting`.

    `right` counts answers that are right by the rule of the group (`Outcome.right`); `acting` counts rigs whose causes
    act in the training runs.
    """
    rows = [(o.group, o.kind, o.strength, 1, int(o.right), int(o.acts)) for o in outcomes]
    table = pd.DataFrame(rows, columns=["group", "kind", "strength", "rigs", "right", "acting"])
    return table.groupby(["group", "kind", "strength"], as_index=False, sort=True).sum()


def describe_wrong(outcome: Outcome) -> str:
    """One line on a rig that was answered wrongly."""
    rig = f"{outcome.name}: {outcome.group} {outcome.kind} {outcome.strength}".rstrip()
    if not outcome.answered:
        return f"{rig}: no report; {outcome.refusal or 'none was written'}"
    said = [f"named {', '.join(outcome.named) or 'nothing'}", f"verdict {outcome.verdict}"]
    if outcome.did_not_hold:
        said.append(f"did not hold: {', '.join(outcome.did_not_hold)}")
    if not outcome.acts:
        said.append("the cause does not act in the training runs")
    return f"{rig}: {'; '.join(said)}"
