"""A validator of report.json, schema 1, written from the contract and not from the code that writes it."""

from collections.abc import Callable, Mapping
from typing import Any

Check = Callable[[str, Any], None]
VERDICTS = ("effects_found", "no_missing_effect", "unexplained_structure", "unexplained_residual", "cannot_tell")


def number(where: str, value: Any) -> None:
    assert isinstance(value, (int, float)) and not isinstance(value, bool), f"{where}: expected a number, got {value!r}"


def number_or_null(where: str, value: Any) -> None:
    if value is not None:
        number(where, value)


def text(where: str, value: Any) -> None:
    assert isinstance(value, str) and value, f"{where}: expected text, got {value!r}"


def text_or_null(where: str, value: Any) -> None:
    if value is not None:
        text(where, value)


def flag(where: str, value: Any) -> None:
    assert isinstance(value, bool), f"{where}: expected true or false, got {value!r}"


def each(check: Check) -> Check:
    def walk(where: str, value: Any) -> None:
        assert isinstance(value, list), f"{where}: expected a list, got {value!r}"
        for i, entry in enumerate(value):
            check(f"{where}[{i}]", entry)

    return walk


def named(check: Check) -> Check:
    def walk(where: str, value: Any) -> None:
        assert isinstance(value, dict), f"{where}: expected a mapping, got {value!r}"
        for key, entry in value.items():
            check(f"{where}.{key}", entry)

    return walk


def fields(wanted: Mapping[str, Check]) -> Check:
    """Every wanted key is there; more may be."""

    def walk(where: str, value: Any) -> None:
        assert isinstance(value, dict), f"{where}: expected a mapping, got {value!r}"
        missing = sorted(set(wanted) - set(value))
        assert not missing, f"{where}: missing {missing}"
        for key, check in wanted.items():
            check(f"{where}.{key}", value[key])

    return walk


def or_null(check: Check) -> Check:
    def walk(where: str, value: Any) -> None:
        if value is not None:
            check(where, value)

    return walk


def one_of(*possible: str) -> Check:
    def walk(where: str, value: Any) -> None:
        assert value in possible, f"{where}: expected one of {possible}, got {value!r}"

    return walk


def interval(where: str, value: Any) -> None:
    each(number_or_null)(where, value)
    assert len(value) == 2, f"{where}: expected [low, high]"
    if None not in value:
        assert value[0] <= value[1], f"{where}: expected low <= high, got {value}"


PARAMETER = fields({"value": number_or_null, "unit": text, "ci95": interval, "at_bound": flag})
ERRORS = fields({"train": number_or_null, "heldout": number_or_null, "free_run_heldout": number_or_null})
POSITION_ERRORS = fields({"rms": number_or_null, "mean_absolute": number_or_null})
REFINED = fields(
    {
        "status": one_of(
            "accepted",
            "no_gain",
            "worse_held_out",
            "implausible",
            "resolved",
            "nothing_to_simulate",
            "nothing_to_refine",
        ),
        "why": text_or_null,
        "model": text_or_null,
        "error": ERRORS,
        "parameters": each(fields({"effect": text, "parameter": text, "unit": text, "at_bound": flag})),
    }
)
JOINT = fields(
    {
        "baseline": fields({"effects": each(text), "parameters": named(named(number_or_null))}),
        "parameters": named(named(PARAMETER)),
        "correlation": or_null(fields({"names": each(text), "matrix": each(each(number))})),
        "noise_floor": number_or_null,
        "error": fields(
            {
                "unit": one_of("rad", "A", "V", "N*m"),
                "before": ERRORS,
                "after": ERRORS,
                "mean_absolute": fields({"before": ERRORS, "after": ERRORS}),
            }
        ),
        "effects": each(
            fields(
                {
                    "id": text,
                    "key": text,
                    "title": text,
                    "parameters": named(PARAMETER),
                    "heldout_gain": number,
                    "stability": number,
                }
            )
        ),
        "rejected": each(fields({"id": text, "heldout_gain": number_or_null, "why": text})),
        "did_not_hold": each(fields({"id": text, "why": text})),
        "indistinguishable": each(each(text)),
        "next_experiment": text_or_null,
        "plausible": named(named(fields({"range": interval, "source": text}))),
        "refinement": or_null(REFINED),
        "free_runs": each(
            fields({name: or_null(POSITION_ERRORS) for name in ("before", "after", "refined")} | {"run": text})
        ),
        "unexplained": fields(
            {"floors": number_or_null, "fraction": number_or_null, "structured": flag, "depends_on": each(text)}
        ),
        "remainder": or_null(
            fields(
                {
                    "signals": each(text),
                    "share": fields({"value": number_or_null, "ci95": each(number_or_null)}),
                    "rms": number_or_null,
                    "in_model": flag,
                }
            )
        ),
    }
)
EXPORT = fields(
    {
        "to": one_of("mjcf", "urdf", "drake-urdf", "sdf", "bam"),
        "runner": text,
        "model": text,
        "losses": each(text),
        "free_runs": each(
            fields(
                {"joint": text, "run": text, "unit": one_of("rad")}
                | dict.fromkeys(("model", "export", "original"), number_or_null)
            )
        ),
    }
)
REPORT = fields(
    {
        "schema": number,
        "verdict": one_of(*VERDICTS),
        "joints": named(JOINT),
        "export": or_null(EXPORT),
        "shared": each(fields({"id": text, "where": text, "parameters": named(PARAMETER), "heldout_gain": number})),
        "seconds": number,
    }
)


def check_report(document: Any) -> None:
    """Raise AssertionError with the path of the first thing that is not as the contract says."""
    REPORT("report", document)
    assert document["schema"] == 1
    assert document["joints"], "report: no joint"
