"""`PortMethods`: `get_command_output_port()` and the like, for every port of a system by its name."""

from collections.abc import Callable
from typing import Any

_KINDS = ("input", "output")


class PortMethods:
    """Base beside Drake's LeafSystem: a method `get_<port>_input_port()` or `get_<port>_output_port()` for every port.

    `system.get_command_output_port()` is `system.GetOutputPort("command")`; `dir(system)` lists the methods.

    Example:
        >>> guard = CommandGuard(6, 1e-3)
        >>> guard.get_command_output_port().size()
        6
    """

    def __getattr__(self, name: str) -> Callable[[], Any]:
        """The method of a port.

        Raises:
            AttributeError: no such attribute; names the ports where the name is that of a port's method.
        """
        own: Any = self
        for kind in _KINDS if name.startswith("get_") else ():  # Drake asks for another name in every step
            if name.endswith(f"_{kind}_port"):
                port, names = name.removeprefix("get_").removesuffix(f"_{kind}_port"), _port_names(own, kind)
                if port in names:
                    find: Any = getattr(own, f"Get{kind.title()}Port")
                    return lambda: find(port)
                raise AttributeError(
                    f"{type(self).__name__} has no {kind} port {port!r}; its ports: {', '.join(names)}"
                )
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        methods = [f"get_{port}_{kind}_port" for kind in _KINDS for port in _port_names(self, kind)]
        return [*super().__dir__(), *methods]


def _port_names(system: Any, kind: str) -> list[str]:
    count, find = getattr(system, f"num_{kind}_ports"), getattr(system, f"get_{kind}_port")
    return [find(index).get_name() for index in range(count())]
