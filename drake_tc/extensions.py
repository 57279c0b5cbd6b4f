"""What other packages add to drake_tc: objects by name, registered from Python or declared as entry points.

An installed package that declares an entry point is seen by every command and every script; nothing has to be imported:

    [project.entry-points."drake_tc.effects"]
    cogging = "my_package.cogging:Cogging"

The name of an entry point is the name under which files and reports know the object. An object is loaded when it is
first needed.
"""

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from drake_tc.errors import ParamsError

T = TypeVar("T")


class ExtensionPoint:
    """One kind of thing that other packages may add.

    Attributes:
        group: Group of the entry points.
        what: One word for messages.
    """

    def __init__(self, group: str, what: str) -> None:
        self.group, self.what = group, what
        self._added: dict[str, object] = {}
        self._loaded: dict[str, object] = {}

    def add(self, name: str, thing: object) -> None:
        """Register an object; one of the same class (a notebook's cell that is run again) replaces the first.

        Raises:
            ParamsError: the name is taken.
        """
        known = self._added.get(name)
        same = known is not None and _origin(known) == _origin(thing)
        if name in self.names() and not same:
            raise ParamsError(f"{self.what} {name!r}: this name is already registered")
        self._added[name] = thing

    def remove(self, name: str) -> None:
        """Forget an object that was registered from Python; nothing happens where there is none."""
        self._added.pop(name, None)

    def names(self) -> tuple[str, ...]:
        """Names that were registered or declared, without loading anything."""
        return (*self._added, *_declared(self.group))

    def get(self, name: str, check: Callable[[str, object], T]) -> T:
        """The object `name`, loaded and checked on first use.

        Args:
            name: One of `names`.
            check: Turns (name, object) into what is used, or raises ParamsError.

        Raises:
            ParamsError: the entry point cannot be loaded, or `check` refuses the object.
        """
        if name in self._added:
            return check(name, self._added[name])
        if name not in self._loaded:
            self._loaded[name] = _load(self, _declared(self.group)[name])
        return check(name, self._loaded[name])


def _origin(thing: object) -> tuple[str, str]:
    kind = thing if isinstance(thing, type) else type(thing)
    return kind.__module__, kind.__qualname__


@cache
def _declared(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; a package that is found twice counts once."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=group):
        other = found.setdefault(point.name, point)
        if other.value != point.value:
            raise ParamsError(
                f"entry point {point.name!r} of {group!r}: two packages declare it ({other.value} and {point.value})"
            )
    return found


def _load(extension: ExtensionPoint, point: EntryPoint) -> object:
    try:
        return point.load()
    except Exception as error:
        package = f" of package {point.dist.name!r}" if point.dist is not None else ""
        raise ParamsError(
            f"{extension.what} {point.name!r}: its entry point {point.value!r}{package} cannot be loaded:"
            f" {type(error).__name__}: {error}"
        ) from error


EFFECTS = ExtensionPoint("drake_tc.effects", "effect")
TASKS = ExtensionPoint("drake_tc.tsid.tasks", "task kind")
LIMITS = ExtensionPoint("drake_tc.tsid.limits", "limit kind")
