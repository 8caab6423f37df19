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


class ModeClient:
    """Requests all modes; if the list has a gap, requests it once more. The modes appear in the view."""

    def __init__(self, view: Callable[[], VehicleView], own: Address, now_s: float) -> None:
        identity = view().identity
        assert identity is not None
        self.result: bool | None = None
        """True once the view has all modes, False if the vehicle does not send them."""
        self._view = view
        self._client = CommandClient(Address(identity.system_id, identity.component_id), own, _TIMING)
        self._tries = 0
        self._due_s = now_s
        self._count = 0
        self._request(now_s)

    def _request(self, now_s: float) -> None:
        self._tries += 1
        self._client.send_command(common_commands.request_message(_MESSAGE), now_s)
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
        known, total = self.progress
        answer = self._client.result
        if self.result is not None:
            return []
        if total and known >= total:
            self.result = True
        elif answer is not None and not answer.accepted:
            self.result = False
        elif answer is not None and now_s >= self._due_s:
            if self._tries == 1 and known:
                self._request(now_s)
            else:
                self.result = False
        return self._client.poll(now_s)

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest."""
        if self.result is not None:
            return None
        due_s = self._client.next_deadline()
        return self._due_s if due_s is None else min(due_s, self._due_s)
