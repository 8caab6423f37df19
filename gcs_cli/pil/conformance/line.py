"""Raw exchanges with a target: frames as they are, answers with their time of arrival."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

from flightstack.firmware.pil.operations import TARGET_COMPONENT, TARGET_SYSTEM
from flightstack.firmware.pil.steps import OWN_COMPONENT, OWN_SYSTEM
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.transports.byte_link import ByteLink

_MOST_READS = 100_000
_READ_S = 0.005
"""Longest read: an emulated target, whose time passes by reads, is polled this often."""
Found = TypeVar("Found")


class Heard(NamedTuple):
    """A message and its time of arrival [s]."""

    at_s: float
    message: Message


class Line:
    """A link with its codec and its clock."""

    def __init__(self, link: ByteLink, timeout_s: float, clock_s: Callable[[], float] | None) -> None:
        """``timeout_s`` is the longest wait for an answer.

        Without ``clock_s`` the time is that spent waiting: of an emulated target, whose reads return at once.
        """
        self._link, self.timeout_s, self._clock_s = link, timeout_s, clock_s
        self._codec = Link(OWN_SYSTEM, OWN_COMPONENT)
        self._waited_s = 0.0
        self._heard: deque[Heard] = deque()
        self.heartbeats = 0
        """Heartbeats that have arrived."""
        self.own_frames = 0
        """Own frames that came back: the line, or a console on the target, echoes."""

    @property
    def now_s(self) -> float:
        """Time of the line [s]."""
        return self._waited_s if self._clock_s is None else self._clock_s()

    def pack(self, message: Message) -> bytes:
        """Return the frame of a message."""
        return self._codec.encode(message)

    def send(self, data: bytes) -> None:
        """Send bytes; raise LineError."""
        self._link.write(data)

    def hear(self, duration_s: float) -> Iterator[Heard]:
        """Yield the messages that arrive within a time; raise LineError."""
        end_s = self.now_s + duration_s
        for _ in range(_MOST_READS):
            while self._heard:  # what the caller does not take stays for the next one
                yield self._heard.popleft()
            left_s = min(end_s - self.now_s, _READ_S)
            if left_s <= 0.0:
                return
            data = self._link.read(left_s)
            if not data:
                self._waited_s += left_s
            at_s = self.now_s
            for message in self._codec.decode(data):
                if message.get_srcComponent() == OWN_COMPONENT:
                    self.own_frames += 1
                else:
                    self.heartbeats += message.get_type() == "HEARTBEAT"
                    self._heard.append(Heard(at_s, message))

    def wait(self, duration_s: float) -> list[Heard]:
        """Return the messages that arrive within a time; raise LineError."""
        return list(self.hear(duration_s))

    def ask(self, data: bytes, accept: Callable[[Message], Found | None], attempts: int = 3) -> Found | None:
        """Send ``data`` and return the first answer that ``accept`` turns into a result; None without one."""
        for _ in range(attempts):
            self.send(data)
            for _, message in self.hear(self.timeout_s):
                found = accept(message)
                if found is not None:
                    return found
        return None

    def request(self, name: str) -> Message | None:
        """Return the message of this name, requested from the target; None without an answer."""
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        return self.ask(
            self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number),
            lambda message: message if message.get_type() == name else None,
        )

    def command(self, number: int, *values: float) -> bytes:
        """Return the frame of a COMMAND_LONG to the target."""
        parameters = [*values, *[0.0] * 7][:7]
        return self.pack(
            mavlink.MAVLink_command_long_message(TARGET_SYSTEM, TARGET_COMPONENT, number, 0, *parameters)
        )

    def ping(self, time_usec: int, seq: int, attempts: int = 3) -> bool:
        """Return True if the target echoes a PING with all its bits."""
        return self.ask(self.ping_frame(time_usec, seq), is_echo(time_usec, seq), attempts) is not None

    def ping_frame(self, time_usec: int, seq: int) -> bytes:
        """Return the frame of a PING, whose zeros at the end are not sent."""
        return self.pack(mavlink.MAVLink_ping_message(time_usec, seq, 0, 0))


def is_echo(time_usec: int, seq: int) -> Callable[[Message], bool | None]:
    """Return a function that recognises the echo of a PING."""

    def accept(message: Message) -> bool | None:
        is_it = message.get_type() == "PING" and (message.time_usec, message.seq) == (time_usec, seq)
        return True if is_it else None

    return accept


def status_of(message: Any) -> dict[str, int]:
    """Return the fields of an FS_PIL_STATUS."""
    fields: dict[str, int] = message.to_dict()
    fields.pop("mavpackettype", None)
    return fields
