"""A robot on LCM: status and command messages of Drake's type `lcmt_drake_signal`, and a stop message.

    STATUS   robot -> controller   all readings, in the order of the controller's input ports; "position[0]", ...
    COMMAND  controller -> robot   "command[0]", ..., "command[n-1]", "mode[0]"
    STOP     anyone -> controller  any message stops the controller

The channels begin with `DRAKE_TC_`. A program in another language needs only `lcmt_drake_signal.lcm` of Drake.
"""

import struct
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from drake import lcmt_drake_signal
from pydrake.lcm import DrakeLcm

from drake_tc.errors import ParamsError
from drake_tc.hardware.link import Message
from drake_tc.types import FloatArray

URL = "udpm://239.255.76.67:7667?ttl=0"
"""Multicast within this machine."""
PROVIDERS = ("udpm://", "tcpq://", "memq://")
"""What LCM can use as a bus."""
STATUS, COMMAND, STOP = "DRAKE_TC_STATUS", "DRAKE_TC_COMMAND", "DRAKE_TC_STOP"


class SignalCodec:
    """Named vectors as one `lcmt_drake_signal`, and back.

    The names of the elements are encoded once: a message costs some microseconds, where the generated class takes some
    ten for each element.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        """Encode the names.

        Args:
            sizes: Port to its size, in the order of the message.
        """
        self._sizes = dict(sizes)
        self._count = sum(sizes.values())
        names = [f"{port}[{index}]".encode() + b"\0" for port, size in sizes.items() for index in range(size)]
        fingerprint: bytes = lcmt_drake_signal().encode()[:8]
        self._head = fingerprint + struct.pack(">i", self._count)
        self._names = b"".join(struct.pack(">I", len(name)) + name for name in names)
        self._length = len(self._head) + 8 * self._count + len(self._names) + 8

    def encode(self, values: Message, time_us: int) -> bytes:
        """The message.

        Args:
            values: Port to its value.
            time_us: Its timestamp [us].
        """
        numbers = np.concatenate([values[port] for port in self._sizes]).astype(">f8")
        return b"".join((self._head, numbers.tobytes(), self._names, struct.pack(">q", time_us)))

    def decode(self, data: bytes) -> dict[str, FloatArray] | None:
        """Port to its value; None where the message is of another type, or has other names or sizes."""
        at = len(self._head)
        end = at + 8 * self._count
        if len(data) != self._length or data[:at] != self._head or data[end:-8] != self._names:
            return None
        numbers = np.frombuffer(data, ">f8", self._count, at).astype(np.float64)
        found, first = {}, 0
        for port, size in self._sizes.items():
            found[port] = numbers[first : first + size]
            first += size
        return found


class _Mailbox:
    """The newest message of a channel."""

    def __init__(self, lcm: Any, channel: str) -> None:
        self.data: bytes | None = None
        lcm.Subscribe(channel=channel, handler=self._keep)

    def _keep(self, data: bytes) -> None:
        self.data = data

    def take(self) -> bytes | None:
        """The newest message, once."""
        data, self.data = self.data, None
        return data


class LcmLink:
    """The controller's end: reads STATUS and STOP, writes COMMAND.

    Attributes:
        refused: Number of messages that were not what the controller reads.

    Example:
        >>> LcmLink({"position": 6, "imu": 6}, joints=6, url="memq://").read() is None
        True
    """

    def __init__(self, inputs: Mapping[str, int], joints: int, url: str = URL) -> None:
        """Open the bus.

        Args:
            inputs: Port to its size, of what the robot sends: `ControllerStepper.inputs`.
            joints: n.
            url: Of LCM.

        Raises:
            ParamsError: a URL of another kind.
        """
        self._lcm = opened(url)
        self._status, self._stop = _Mailbox(self._lcm, STATUS), _Mailbox(self._lcm, STOP)
        self._readings, self._command = SignalCodec(inputs), SignalCodec({"command": joints, "mode": 1})
        self.refused = 0

    def read(self) -> Message | None:
        """The newest status message since the last call."""
        self._lcm.HandleSubscriptions(0)
        data = self._status.take()
        if data is None:
            return None
        found = self._readings.decode(data)
        self.refused += found is None
        return found

    def write(self, command: Message) -> None:
        """Publish a command message."""
        self._lcm.Publish(COMMAND, self._command.encode(command, time.time_ns() // 1000))

    def stop_requested(self) -> bool:
        """Whether a stop message has come in."""
        return self._stop.data is not None

    def close(self) -> None:
        """The bus is closed with the last reference to it."""


class LcmRobot:
    """The robot's end: writes STATUS, reads COMMAND. For the simulated robot, and for a driver in Python.

    Example:
        >>> LcmRobot({"position": 6}, joints=6, url="memq://").receive() is None
        True
    """

    def __init__(self, outputs: Mapping[str, int], joints: int, url: str = URL) -> None:
        """Open the bus.

        Args:
            outputs: Port to its size, of what the controller reads, in its order.
            joints: n.
            url: Of LCM.

        Raises:
            ParamsError: a URL of another kind.
        """
        self._lcm = opened(url)
        self._mailbox = _Mailbox(self._lcm, COMMAND)
        self._readings, self._command = SignalCodec(outputs), SignalCodec({"command": joints, "mode": 1})

    def send(self, readings: Message) -> None:
        """Publish a status message."""
        self._lcm.Publish(STATUS, self._readings.encode(readings, time.time_ns() // 1000))

    def receive(self) -> Message | None:
        """The newest command message since the last call; None where none has come in."""
        self._lcm.HandleSubscriptions(0)
        data = self._mailbox.take()
        return None if data is None else self._command.decode(data)


def send_stop(url: str = URL) -> None:
    """Publish the stop message.

    Args:
        url: Of LCM.

    Raises:
        ParamsError: a URL of another kind.
    """
    lcm = opened(url)
    for _ in range(3):  # a datagram can be lost
        lcm.Publish(STOP, lcmt_drake_signal().encode())
        time.sleep(1e-3)


def opened(url: str) -> Any:
    """An LCM bus.

    Raises:
        ParamsError: a URL of another kind.
    """
    if not url.startswith(PROVIDERS):  # LCM prints a line and goes on without a bus
        raise ParamsError(f"LCM: expected a URL that begins with {', '.join(PROVIDERS)}, like {URL}, got {url!r}")
    return DrakeLcm(url)
