"""What the model is worth in another simulator: errors of free runs on the held-out runs, and what the target lacks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ExportErrors:
    """RMS errors of the free-running position of a joint in a run [rad]; None where nothing could run.

    Attributes:
        joint: Its name.
        run: Name of the run.
        model: Of the identified model, in Drake with all its effects.
        export: Of the exported terms in the target.
        original: Of what the user's file had, in the target.
    """

    joint: str
    run: str
    model: float | None
    export: float | None
    original: float | None = None


@dataclass(frozen=True)
class ExportTrial:
    """An export that was run on the held-out runs.

    Attributes:
        to: The target, as `drake-tc export --to` takes it.
        target: Its name for people.
        runner: What ran the export.
        model_file: The model that was exported.
        losses: What the target lacks, a sentence each.
        rows: One a joint and run.
    """

    to: str
    target: str
    runner: str
    model_file: str
    losses: tuple[str, ...]
    rows: tuple[ExportErrors, ...]
