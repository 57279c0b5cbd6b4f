"""The diagrams and reproductions that commands know by name, found when they are asked for.

`drake_tc.diagrams.catalogue` names those that come with the library. Other distributions add theirs by entry points of
the groups `drake_tc.diagrams` and `drake_tc.reproductions`:

    [project.entry-points."drake_tc.diagrams"]
    my_arm = "my_package.my_arm:ENTRY"          # a DiagramEntry, as `drake_tc.loops.entries` makes it

    [project.entry-points."drake_tc.reproductions"]
    "D.table1" = "my_package.tables:table1"     # seed and progress to a Reproduction
"""

import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.loops.entries import DiagramEntry, Kind, SeaEntry, TorqueLoopEntry, TsidEntry
    from drake_tc.report.figure_row import Progress, Reproduction

DIAGRAMS, REPRODUCTIONS = "drake_tc.diagrams", "drake_tc.reproductions"
"""Groups of entry points."""
PAPERS = "drake_tc.diagrams.papers"
"""The published tables, which the repository holds and a wheel does not."""
CATALOGUES = {DIAGRAMS: "drake_tc.diagrams.catalogue:DIAGRAMS", REPRODUCTIONS: f"{PAPERS}.catalogue:REPRODUCTIONS"}
"""Group to the table of names and `module:attribute` texts that comes with the library."""


def loaded(text: str) -> Any:
    """The object that `module:attribute` names.

    Raises:
        ParamsError: text of another form, a module that cannot be imported, or an attribute that is not there.
    """
    module, colon, attribute = text.partition(":")
    if not (module and colon and attribute):
        raise ParamsError(f"expected module:attribute, got {text!r}")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ParamsError(f"{text}: cannot be loaded: {error}") from error


@cache
def registered(group: str) -> Mapping[str, str]:
    """Name to `module:attribute`, of everything in a group; the library's own come first.

    Raises:
        ParamsError: two objects of one name.
    """
    found: dict[str, str] = dict(loaded(CATALOGUES[group])) if group == DIAGRAMS or papers_are_here() else {}
    for point in entry_points(group=group):
        if found.get(point.name, point.value) != point.value:
            raise ParamsError(f"{group}: {point.name!r} is registered twice: {found[point.name]} and {point.value}")
        found[point.name] = point.value
    return found


def papers_are_here() -> bool:
    """Whether the published tables can be imported: in a clone, not in an installed wheel."""
    return find_spec(PAPERS) is not None


def diagrams(kind: "Kind | None" = None) -> dict[str, "DiagramEntry[Any, Any]"]:
    """All diagrams by name, or those of one kind of loop; imports every one of them.

    Args:
        kind: Of loop; None takes all.
    """
    found = {name: loaded(text) for name, text in registered(DIAGRAMS).items()}
    return {name: entry for name, entry in found.items() if kind in (None, entry.kind)}


def runnable(name: str) -> "DiagramEntry[Any, Any]":
    """Any diagram that can be simulated and drawn.

    Args:
        name: Registered name; or `module:attribute`, a DiagramEntry or a function that returns a built Drake Diagram.

    Raises:
        ParamsError: there is none; the message lists the diagrams.
    """
    return _found(name, None)


def diagram_entry(name: str) -> "TorqueLoopEntry":
    """The diagram of the torque loop of that name.

    Raises:
        ParamsError: there is none; the message lists the diagrams of the torque loop.
    """
    return cast("TorqueLoopEntry", _found(name, "torque"))


def tsid_entry(name: str = "humanoid_tsid") -> "TsidEntry":
    """The diagram around robust TSID of that name.

    Raises:
        ParamsError: there is none; the message lists the diagrams around robust TSID.
    """
    return cast("TsidEntry", _found(name, "whole_body"))


def sea_entry(name: str = "sea_joint") -> "SeaEntry":
    """The diagram of a series-elastic joint of that name.

    Raises:
        ParamsError: there is none; the message lists the diagrams of series-elastic joints.
    """
    return cast("SeaEntry", _found(name, "series_elastic"))


def _found(name: str, kind: "Kind | None") -> "DiagramEntry[Any, Any]":
    if ":" in name:
        return _named(name, kind)
    text = registered(DIAGRAMS).get(name)
    entry = None if text is None else loaded(text)
    if entry is None or kind not in (None, entry.kind):
        raise ParamsError(f"no diagram {name!r}; diagrams: {', '.join(diagrams(kind))}")
    return cast("DiagramEntry[Any, Any]", entry)


def _named(name: str, kind: "Kind | None") -> "DiagramEntry[Any, Any]":
    """The diagram of `module:attribute`; modules in the working folder are found too."""
    from drake_tc.loops.entries import DiagramEntry
    from drake_tc.loops.function_diagram import function_entry

    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    found = loaded(name)
    entry = found if isinstance(found, DiagramEntry) else function_entry(name, found) if callable(found) else None
    if entry is None:
        raise ParamsError(
            f"{name}: expected a DiagramEntry or a function that returns a Diagram, got {type(found).__name__}"
        )
    if kind not in (None, entry.kind):
        raise ParamsError(f"{name}: expected a DiagramEntry of the {kind} loop for this command, got {entry.kind}")
    return entry


def reproductions(name: str) -> "dict[str, Callable[[int, Progress | None], Reproduction]]":
    """Id to a function of seed and progress, of the reproductions that a name stands for.

    Args:
        name: An id, or "all".

    Raises:
        ParamsError: no such id; the message lists the ids, or says that the published tables are not installed.
    """
    known = registered(REPRODUCTIONS)
    if name not in known and not papers_are_here() and not (name == "all" and known):
        raise ParamsError(
            f"reproduce {name}: the published tables are in the repository (diagrams/papers) and not in the installed "
            "package; run `drake-tc reproduce` from an installed clone"
        )
    if name != "all" and name not in known:
        raise ParamsError(f"no reproduction {name!r}; possible: {', '.join(known)}, all")
    return {id_: loaded(text) for id_, text in known.items() if name in ("all", id_)}
