"""Clients of the command protocol and of the standard modes protocol, sans-IO.

Protocols: https://mavlink.io/en/services/command.html and https://mavlink.io/en/services/standard_modes.html
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from flightstack.core.float32 import as_float32
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, is_from
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import VehicleCommand
from gcs_cli.vehicle.view_types import VehicleView

_ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
_IN_PROGRESS: int = mavlink.MAV_RESULT_IN_PROGRESS
UNUSED = 2**31 - 1
"""Latitude or longitude of a COMMAND_INT that the vehicle is to ignore."""
MESSAGE_TRIES = 3
MESSAGE_PERIOD_S = 1.0
"""Number of attempts of a message without an answer, and the time between."""


class CommandTiming(NamedTuple):
    """Timeouts of the protocol [s of the clock that drives it]."""

    timeout_s: float = 1.0
    """Time after which a command is sent again."""
    retries: int = 5
    progress_timeout_s: float = 10.0
    """Time after which a command in progress counts as lost."""


class CommandResult(NamedTuple):
    """Result of a command."""

    result: int | None
    """The vehicle's MAV_RESULT; None if it did not answer."""
    reason: str
    """One sentence for the user; empty if accepted."""

    @property
    def accepted(self) -> bool:
        """True if the vehicle accepted the command."""
        return self.result == _ACCEPTED


class CommandClient:
    """Sends one command at a time to one vehicle; a new ``send`` replaces the current one."""

    def __init__(
        self,
        vehicle: Address,
        own: Address,
        timing: CommandTiming = CommandTiming(),  # noqa: B008  (immutable)
    ) -> None:
        self.vehicle = vehicle
        self.own = own
        self.result: CommandResult | None = None
        self.progress_percent: int | None = None
        """Progress of a command that the vehicle executes; None if unknown."""
        self._timing = timing
        self._command = -1
        self._request: Message | None = None
        self._deadline_s: float | None = None
        self._sends_left = 0
        self._in_progress = False

    def send(self, command: int, params: Sequence[float], now_s: float) -> None:
        """Begin a COMMAND_LONG of up to seven parameters; omitted ones are zero."""
        values = [as_float32(value) for value in (*params, *[0.0] * (7 - len(params)))]
        self._begin(command, mavlink.MAVLink_command_long_message(*self.vehicle, command, 0, *values), now_s)

    def send_int(
        self, command: int, params: Sequence[float], x: int, y: int, z: float, *, frame: int, now_s: float
    ) -> None:
        """Begin a COMMAND_INT of four parameters, and x and y as integers (1e-7 deg in a global frame)."""
        values = [as_float32(value) for value in params]
        message = mavlink.MAVLink_command_int_message(
            *self.vehicle, frame, command, 0, 0, *values, x, y, as_float32(z)
        )
        self._begin(command, message, now_s)

    def send_command(self, command: VehicleCommand, now_s: float) -> None:
        """Begin a command in the form that it names; NaN as latitude or longitude is sent as MAVLink's "unused"."""
        if command.frame is None:
            self.send(command.number, command.params, now_s)
            return
        params = (*command.params, *[0.0] * (7 - len(command.params)))
        x, y = (UNUSED if math.isnan(degrees) else round(degrees * 1e7) for degrees in params[4:6])
        self.send_int(command.number, params[:4], x, y, params[6], frame=command.frame, now_s=now_s)

    def _begin(self, command: int, request: Message, now_s: float) -> None:
        self.result = None
        self.progress_percent = None
        self._command, self._request = command, request
        self._deadline_s = now_s
        self._sends_left = self._timing.retries + 1
        self._in_progress = False

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message; messages that do not answer the command are ignored."""
        if self._deadline_s is None or message.get_type() != "COMMAND_ACK":
            return
        if not is_from(message, self.vehicle) or not is_for(message, self.own):
            return
        if message.command != self._command or self._sends_left > self._timing.retries:  # not yet sent
            return
        if message.result == _IN_PROGRESS:
            self._in_progress = True
            self.progress_percent = message.progress if message.progress <= 100 else None
            self._deadline_s = now_s + self._timing.progress_timeout_s
            return
        name = _result_name(message.result)
        reason = "" if message.result == _ACCEPTED else f"the vehicle answered {name}"
        self._end(CommandResult(message.result, reason))

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        if self._deadline_s is None or now_s < self._deadline_s:
            return []
        if self._in_progress or self._sends_left == 0:
            what = "stopped reporting on" if self._in_progress else "did not answer"
            name = _command_name(self._command)
            self._end(CommandResult(None, f"the vehicle (system {self.vehicle.system}) {what} {name}"))
            return []
        request = self._request
        if request is None:
            return []
        if request.get_type() == "COMMAND_LONG":  # distinguishes a repetition from a new command
            request = copy.copy(request)
            request.confirmation = self._timing.retries + 1 - self._sends_left
        self._sends_left -= 1
        self._deadline_s = now_s + self._timing.timeout_s
        return [request]

    def next_deadline(self) -> float | None:
        """Return the time of the next ``poll`` without an earlier message; None: never."""
        return self._deadline_s

    def cancel(self) -> None:
        """Stop waiting for the answer."""
        if self._deadline_s is not None:
            self._end(CommandResult(None, f"waiting for {_command_name(self._command)} was cancelled"))

    def _end(self, result: CommandResult) -> None:
        self.result = result
        self._deadline_s = None


class RepeatedMessage:
    """Sends a message that has no answer, up to ``MESSAGE_TRIES`` times, because it may be lost.

    It is not repeated once ``is_received`` returns True: each repetition acts on the vehicle again.
    """

    result: None = None
    """Always unknown: the caller observes the effect."""

    def __init__(self, message: Message, now_s: float, is_received: Callable[[], bool]) -> None:
        self._message = message
        self._is_received = is_received
        self._due_s: float | None = now_s
        self._tries_left = MESSAGE_TRIES

    def receive(self, message: Message, now_s: float) -> None:
        """Ignore ``message``."""

    def poll(self, now_s: float) -> list[Message]:
        """Return the message if it is due."""
        if self._due_s is None or now_s < self._due_s:
            return []
        if self._is_received():
            self._due_s = None
            return []
        self._tries_left -= 1
        self._due_s = now_s + MESSAGE_PERIOD_S if self._tries_left else None
        return [self._message]

    def next_deadline(self) -> float | None:
        """Return the time of the next repetition; None: never."""
        return self._due_s


def _result_name(result: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return entry.name if entry else f"MAV_RESULT {result}"


def _command_name(command: int) -> str:
    entry = mavlink.enums["MAV_CMD"].get(command)
    return entry.name if entry else f"command {command}"


QUIET_S = 0.7
"""Time without a further mode after which the list counts as interrupted, or as not sent."""
_TIMING = CommandTiming(timeout_s=0.5, retries=2)
_MESSAGE = int(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES)
_REQUEST = common_commands.request_message(_MESSAGE)
_RAISE_RATE = common_commands.message_interval(_MESSAGE, 20.0)
_AFTER_RAISED_RATE = 2
"""Number of requests left after that for the rate, whose answer does not matter."""


class ModeClient:
    """Requests all modes; if the list has a gap, requests it once more. The modes appear in the view."""

    def __init__(self, view: Callable[[], VehicleView], own: Address, now_s: float) -> None:
        identity = view().identity
        assert identity is not None
        self.result: bool | None = None
        """True once the view has all modes, False if the vehicle does not send them."""
        self._view = view
        self._client = CommandClient(Address(identity.system_id, identity.component_id), own, _TIMING)
        self._requests = [_REQUEST, _REQUEST]
        if view().autopilot.sends_modes_as_stream:
            self._requests.insert(0, _RAISE_RATE)
        self._due_s = now_s
        self._send_next(now_s)

    def _send_next(self, now_s: float) -> None:
        self._client.send_command(self._requests.pop(0), now_s)
        self._due_s = now_s + QUIET_S

    @property
    def progress(self) -> tuple[int, int]:
        """Received modes, and their number."""
        return len(self._view().modes), self._view().mode_total

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        self._client.receive(message, now_s)
        if message.get_msgId() == _MESSAGE:
            self._due_s = now_s + QUIET_S

    def poll(self, now_s: float) -> list[Message]:
        """Return the request to send now, if any."""
        if self.result is None:
            self._advance(now_s)
        return self._client.poll(now_s) if self.result is None else []

    def _advance(self, now_s: float) -> None:
        known, total = self.progress
        answer = self._client.result
        if total and known >= total:
            self.result = True
        elif answer is not None and len(self._requests) == _AFTER_RAISED_RATE:
            self._send_next(now_s)
        elif answer is not None and not answer.accepted:
            self.result = False
        elif answer is not None and now_s >= self._due_s:
            if known and self._requests:
                self._send_next(now_s)
            else:
                self.result = False

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest."""
        if self.result is not None:
            return None
        due_s = self._client.next_deadline()
        return self._due_s if due_s is None else min(due_s, self._due_s)
