"""`LatestReadings`: the newest readings of a robot, and what stands in for them where nothing new has come in."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from drake_tc.hardware.link import Message
from drake_tc.types import FloatArray

Arrival = Literal["new", "malformed", "late", "missing"]
"""New readings; some of them missing or of another size; none, the last ones stand in; none for longer than that."""
POSITIONS = ("position", "motor_position")
"""Ports with the positions of the joints; the first that there is counts."""


class LatestReadings:
    """What the controller is told in a tick.

    Where nothing new has come in, the last readings stand in for at most `max_age`, positions going on at their last
    speed, which is the mean of the last two ways between readings. After that, and where a port is not there or not of
    its size, the readings are NaN.

    Attributes:
        values: Port to its value.
        age: Of the last readings [s]; infinite before any.
        position: Name of the port with the joints' positions; None where there is none.
    """

    def __init__(self, sizes: Mapping[str, int], period: float, max_age: float) -> None:
        """Before any readings.

        Args:
            sizes: Port to its size.
            period: Of the ticks [s].
            max_age: How long readings count [s].
        """
        self._nothing = {name: np.full(size, np.nan) for name, size in sizes.items()}
        self._period, self._max_age = period, max_age
        self.position = next((name for name in POSITIONS if name in sizes), None)
        self.values, self.age = dict(self._nothing), np.inf
        self._speed = np.zeros(sizes.get(self.position or "", 0))
        self._way, self._newest, self._ticks = self._speed.copy(), np.full_like(self._speed, np.nan), 0

    @property
    def late(self) -> bool:
        """Whether the last readings stand in."""
        return 0.0 < self.age <= self._max_age

    @property
    def sound(self) -> bool:
        """Whether all are known, and not too old."""
        return self.age <= self._max_age and all(np.isfinite(value).all() for value in self.values.values())

    def update(self, found: Message | None) -> Arrival:
        """The readings of the next tick.

        Args:
            found: What has come in; None: nothing.
        """
        name = self.position
        if found is not None:
            new, whole = self._checked(found)
            if name is not None:
                known = np.isfinite(new[name]) & np.isfinite(self._newest)
                way = (np.where(known, new[name], 0.0) - np.where(known, self._newest, 0.0)) / (self._ticks + 1)
                self._speed, self._way = 0.5 * (way + self._way), way
                self._newest, self._ticks = new[name], 0
            self.age, self.values = 0.0, new
            return "new" if whole else "malformed"
        self.age += self._period
        self._ticks += 1
        if not self.late:
            self.values = dict(self._nothing)
            return "missing"
        if name is not None:
            self.values = self.values | {name: self.values[name] + self._speed}
        return "late"

    def between(self, before: Mapping[str, FloatArray], skipped: int, count: int) -> list[dict[str, FloatArray]]:
        """Readings for `count` ticks between those before and those now, positions on a straight line.

        Args:
            before: The readings of the tick before.
            skipped: How many ticks passed in between.
            count: How many of them are made up.
        """
        name, now = self.position, self.values
        if name is None:
            return [now] * count
        self._speed, self._way = self._speed / (skipped + 1), self._way / (skipped + 1)
        shares = np.arange(1, count + 1) / (count + 1)
        return [now | {name: (1.0 - share) * before[name] + share * now[name]} for share in shares]

    def _checked(self, found: Message) -> tuple[dict[str, FloatArray], bool]:
        """Copies of the readings by port, NaN where one is not there or not of its size; whether all are there."""
        readings, whole = {}, True
        for name, nothing in self._nothing.items():
            try:
                value = np.array(found[name], dtype=np.float64)
                fits = value.shape == nothing.shape
            except Exception:  # whatever a driver of the user's own has returned
                value, fits = nothing, False
            readings[name] = value if fits else nothing
            whole = whole and fits
        return readings, whole
