"""Client of the standard modes protocol, sans-IO: asks the vehicle for its list of modes.

Protocol: https://mavlink.io/en/services/standard_modes.html
"""

from __future__ import annotations

from collections.abc import Callable

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from gcs_cli.autopilots import common_commands
from gcs_cli.clients.command_client import CommandClient, CommandTiming
from gcs_cli.vehicle.view_types import VehicleView

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
