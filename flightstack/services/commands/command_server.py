"""Receiver side of the command protocol: parse, execute and acknowledge commands. No I/O.

Every command to this vehicle is acknowledged to its peer. Handlers execute the commands, in tables by command number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable
from typing import NamedTuple

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.plan.item import is_unset
from flightstack.services.commands import guided, mission_commands, modes, system
from flightstack.services.commands.context import (
    ACCEPTED,
    UNSUPPORTED,
    Answer,
    Command,
    Handler,
    VehicleContext,
)
from flightstack.services.commands.link_commands import LINK_COMMANDS
from flightstack.services.commands.system import FailureCommands
from flightstack.services.routing.peer import Peer

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
INJECT_FAILURE = int(mavlink.MAV_CMD_INJECT_FAILURE)
HANDLERS: dict[int, Handler] = {
    **modes.HANDLERS,
    **guided.HANDLERS,
    **mission_commands.HANDLERS,
    **system.HANDLERS,
}
"""Handlers of the vehicle's commands, by command number."""

_DONE = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)


class _LastCommand(NamedTuple):
    command: Command
    heard_s: float
    answer: Message | None


class CommandServer:
    """Parses commands, refuses unsupported ones, and repeats the answer to a retransmitted command."""

    def __init__(self, own: Address, supported: Collection[int]) -> None:
        self.own = own
        self._supported = frozenset(supported)
        self._last: dict[tuple[Hashable, Address], _LastCommand] = {}
        self._outbox: list[tuple[Hashable, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> Command | None:
        """Return the command in ``message`` to execute, or None."""
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
        self._last[client] = _LastCommand(command, now_s, None)
        if len(self._last) > _MAX_CLIENTS:
            del self._last[next(iter(self._last))]
        return command

    @staticmethod
    def _is_repetition(command: Command, last: _LastCommand, now_s: float) -> bool:
        """Return True if ``command`` was executed before. A refused command is executed again."""
        return (
            command.confirmation > 0
            and now_s - last.heard_s < _REPETITION_S
            and (last.answer is None or last.answer.result in _DONE)
            and _is_same(command, last.command)
        )

    def answer(self, command: Command, result: int, progress: int = 255, result_param2: int = 0) -> None:
        """Acknowledge ``command`` with a MAV_RESULT; ``progress`` [%] while IN_PROGRESS, 255 if unknown."""
        message = ack_of(command, result, progress, result_param2)
        self._outbox.append((command.peer, message))
        last = self._last.get((command.peer, command.source))
        if last is not None and last.command is command:
            self._last[command.peer, command.source] = last._replace(answer=message)

    def poll(self, now_s: float) -> list[tuple[Hashable, Message]]:
        """Return the messages to send now, each with its peer."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next poll: −inf for at once, None for never."""
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
    """Return degrees in a global frame, the plain number in frame MISSION, metres in a local frame."""
    if is_unset(value):
        return math.nan
    if frame in _GLOBAL_FRAMES:
        return value / 1e7
    return float(value) if frame == mavlink.MAV_FRAME_MISSION else value / 1e4


def _is_same(one: Command, other: Command) -> bool:
    """Return True if command and parameters are equal; NaN equals NaN."""
    pairs = zip(one.params, other.params, strict=True)
    return one.command == other.command and all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in pairs)


def execute(vehicle: VehicleContext, command: Command) -> Answer:
    """Execute a vehicle command. ``LinkCommands`` executes the commands of a link."""
    handler = HANDLERS.get(command.command)
    return Answer(UNSUPPORTED) if handler is None else handler(vehicle, command)


class CommandService:
    """Executes COMMAND_LONG, COMMAND_INT and the deprecated SET_MODE."""

    handles = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})

    def __init__(
        self,
        own: Address,
        vehicle: VehicleContext,
        peer_at: Callable[[Hashable], Peer],
        link_answer: Callable[[Peer, Command], Answer],
        failures: FailureCommands,
    ) -> None:
        self._own = own
        self._vehicle = vehicle
        self._peer_at = peer_at
        self._link_answer = link_answer
        self._failures = failures
        self._server = CommandServer(own, [*HANDLERS, *LINK_COMMANDS, INJECT_FAILURE])

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Execute and acknowledge a command."""
        if message.get_type() == "SET_MODE":  # has no acknowledgement: the heartbeat shows the mode
            if message.target_system in (0, self._own.system):
                self._report(
                    modes.select_custom_mode(self._vehicle.requests, message.custom_mode), "Mode change"
                )
            return
        command = self._server.receive(message, peer, now_s)
        if command is None:
            return
        if command.command == INJECT_FAILURE:
            answer = self._failures.begin(command, now_s)
        elif command.command in LINK_COMMANDS:
            answer = self._link_answer(self._peer_at(peer), command)
        else:
            answer = execute(self._vehicle, command)
        if answer is not None:
            self._answer(command, answer)

    def _answer(self, command: Command, answer: Answer) -> None:
        self._server.answer(command, answer.result)
        self._report(answer, "Command refused")

    def _report(self, answer: Answer, what: str) -> None:
        if answer.result != ACCEPTED and answer.reason:
            self._vehicle.journal.say(Severity.WARNING, f"{what}: {answer.reason}")

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the acknowledgements to send now."""
        for command, answer in self._failures.poll(now_s):
            self._answer(command, answer)
        return list(self._server.poll(now_s))

    def next_deadline(self) -> float | None:
        """Return the time of the next poll."""
        deadlines = (self._server.next_deadline(), self._failures.next_deadline())
        return min((deadline for deadline in deadlines if deadline is not None), default=None)
