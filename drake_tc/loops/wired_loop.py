"""`WiredLoop`: what the calls that wire a standard loop return."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort

from drake_tc.errors import ParamsError
from drake_tc.loops.fused import fuse
from drake_tc.loops.signal_log import SignalLog, add_log


@dataclass(frozen=True, eq=False, kw_only=True)
class WiredLoop:
    """A loop in a diagram that is still under construction.

    Attributes:
        systems: Stage to its system; the user's own where one was given.
        signals: Name to port of what can be recorded, or connected to systems of the user's own.
        period: Of the control [s].
        flag_names: Of the signal `flags`, in order; empty without one.
    """

    systems: Mapping[str, Any]
    signals: dict[str, OutputPort]
    period: float
    flag_names: tuple[str, ...] = ()

    def add_log(self, builder: DiagramBuilder, *names: str) -> SignalLog:
        """Record signals every period; all of them where none is named.

        Args:
            builder: The diagram's.
            names: Of `signals`.

        Raises:
            ParamsError: a signal that this loop does not have.
        """
        for name in names:
            if name not in self.signals:
                raise ParamsError(f"no signal {name!r} in this loop; signals: {', '.join(self.signals)}")
        return add_log(builder, {name: self.signals[name] for name in names or self.signals}, self.period)

    def build(
        self, builder: DiagramBuilder, name: str, left_out: Collection[str] = (), *, fused: bool = False
    ) -> tuple[Diagram, SignalLog]:
        """The diagram, and the log of its signals.

        Args:
            builder: The diagram's.
            name: Of the diagram.
            left_out: Signals that are not logged.
            fused: Run the stages in one system (`fuse`); ports in `signals` and stages in `systems` then do not exist.
        """
        log = self.add_log(builder, *(signal for signal in self.signals if signal not in left_out))
        if fused:
            fuse(builder)
        diagram = builder.Build()
        diagram.set_name(name)
        return diagram, log
