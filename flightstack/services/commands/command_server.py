"""Take commands and answer them: the receiver's side of the command protocol, without I/O.

Every command addressed to us is answered, to the peer it came from. Who executes a command calls ``answer``.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.plan.item import is_unset

_REPETITION_S = 4.0  # ground stations repeat after 0.5 s (MAVSDK) to 3 s (QGroundControl)
_MAX_CLIENTS = 64
_GLOBAL_FRAMES = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_INT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
_DONE = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)


class Command(NamedTuple):
    """A command, whichever message brought it."""

    command: int
    params: tuple[float, float, float, float, float, float, float]
    """NaN stays NaN. Of a COMMAND_INT, the fifth and sixth are degrees, metres or plain, by its frame."""
    is_int: bool
    frame: int | None
    """MAV_FRAME of a COMMAND_INT; a COMMAND_LONG has none."""
    peer: Hashable
    source: Address
    confirmation: int


class _Memory(NamedTuple):
    command: Command
    heard_s: float
    answer: Message | None


class CommandServer:
    """Turns messages into commands, answers what needs no execution, and executes no repetition twice."""

    def __init__(self, own: Address, supported: Collection[int]) -> None:
        self.own = own
        self._supported = frozenset(supported)
        self._last: dict[tuple[Hashable, Address], _Memory] = {}
        self._outbox: list[tuple[Hashable, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> Command | None:
        """Return the command to execute, or None if there is none in ``message``."""
        kind = message.get_type()
        if kind not in ("COMMAND_LONG", "COMMAND_INT") or not is_for(message, self.own):
            return None
        command = _command_of(message, peer)
        if command.command not in self._supported:
            self._outbox.append((peer, ack_of(command, mavlink.MAV_RESULT_UNSUPPORTED)))
            return None
        client = (peer, command.source)
        last = self._last.pop(client, None)
        if last is not None and self._is_repetition(command, last, now_s):
            self._last[client] = last._replace(heard_s=now_s)
            if last.answer is not None:
                self._outbox.append((peer, last.answer))
            return None
        self._last[client] = _Memory(command, now_s, None)
        if len(self._last) > _MAX_CLIENTS:
            del self._last[next(iter(self._last))]
        return command

    @staticmethod
    def _is_repetition(command: Command, last: _Memory, now_s: float) -> bool:
        """Tell whether ``command`` was executed before. A refused one is tried again: it does no harm."""
        return (
            command.confirmation > 0
            and now_s - last.heard_s < _REPETITION_S
            and (last.answer is None or last.answer.result in _DONE)
            and _is_same(command, last.command)
        )

    def answer(self, command: Command, result: int, progress: int = 255, result_param2: int = 0) -> None:
        """Answer ``command`` with a MAV_RESULT; ``progress`` in percent while IN_PROGRESS, 255 if unknown."""
        message = ack_of(command, result, progress, result_param2)
        self._outbox.append((command.peer, message))
        last = self._last.get((command.peer, command.source))
        if last is not None and last.command is command:
            self._last[command.peer, command.source] = last._replace(answer=message)

    def poll(self, now_s: float) -> list[tuple[Hashable, Message]]:
        """Return the messages to send now, each with the peer it goes to."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return when to poll next: -inf for at once, None for never."""
        return -math.inf if self._outbox else None


def ack_of(command: Command, result: int, progress: int = 255, result_param2: int = 0) -> Message:
    """Return the COMMAND_ACK of ``command``, addressed to its sender."""
    return mavlink.MAVLink_command_ack_message(
        command.command, result, progress, result_param2, *command.source
    )


def _command_of(message: Message, peer: Hashable) -> Command:
    first = (message.param1, message.param2, message.param3, message.param4)
    if message.get_type() == "COMMAND_LONG":
        params = (*first, message.param5, message.param6, message.param7)
        return Command(message.command, params, False, None, peer, sender(message), message.confirmation)
    position = (_scaled(message.x, message.frame), _scaled(message.y, message.frame))
    params = (*first, *position, message.z)
    return Command(message.command, params, True, message.frame, peer, sender(message), 0)


def _scaled(value: int, frame: int) -> float:
    """Return degrees in a global frame, plain numbers in frame MISSION, metres in the local ones."""
    if is_unset(value):
        return math.nan
    if frame in _GLOBAL_FRAMES:
        return value / 1e7
    return float(value) if frame == mavlink.MAV_FRAME_MISSION else value / 1e4


def _is_same(one: Command, other: Command) -> bool:
    """Compare commands and parameters; NaN equals NaN."""
    pairs = zip(one.params, other.params, strict=True)
    return one.command == other.command and all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in pairs)
