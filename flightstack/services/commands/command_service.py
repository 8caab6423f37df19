"""The command service: executes received commands by the vehicle's handlers or those of the link."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.services.commands import HANDLERS, VehicleContext, execute
from flightstack.services.commands.command_server import Command, CommandServer
from flightstack.services.commands.context import ACCEPTED, UNSUPPORTED, Answer
from flightstack.services.commands.failure_commands import FailureCommands
from flightstack.services.commands.link_commands import LINK_COMMANDS
from flightstack.services.commands.modes import select_custom_mode
from flightstack.services.routing.peer import Peer

INJECT_FAILURE = int(mavlink.MAV_CMD_INJECT_FAILURE)


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
                self._report(select_custom_mode(self._vehicle.requests, message.custom_mode), "Mode change")
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
        if answer.result not in (ACCEPTED, UNSUPPORTED) and answer.reason:
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
