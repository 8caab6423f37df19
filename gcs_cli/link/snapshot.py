"""The present state of the vehicle: requests each message that has not arrived yet once. Sans-IO.

A message that is streamed once a second, such as SYS_STATUS, would arrive too late for ``gcs status``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message
from gcs_cli.autopilots import common_commands
from gcs_cli.vehicle.view_types import VehicleView

_REQUEST = int(mavlink.MAV_CMD_REQUEST_MESSAGE)
_ACCEPTED = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
_KNOWN: Mapping[int, Callable[[VehicleView], bool]] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: lambda view: view.attitude is not None,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: lambda view: view.position_ned_m is not None,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: lambda view: view.geo is not None,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: lambda view: view.landed_state != 0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: lambda view: view.mission.current is not None,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: lambda view: view.healthy is not None,  # and battery
    EscStatus.id: lambda view: bool(view.rotor_rpm),
    FS_LOOP_TIMING_ID: lambda view: view.timing is not None,
}
"""Messages of the state, and whether the view has their values."""


class Snapshot:
    """Requests the messages of ``_KNOWN`` whose values ``view`` lacks, all at once."""

    def __init__(self, view: Callable[[], VehicleView]) -> None:
        self._view = view
        self._requested = False
        self._refused = 0

    @property
    def _missing(self) -> list[int]:
        view = self._view()
        lacking = view.autopilot.lacks_messages
        return [number for number, is_known in _KNOWN.items() if number not in lacking and not is_known(view)]

    @property
    def complete(self) -> bool:
        """True if all values are known, but those that the vehicle refused to send."""
        return len(self._missing) <= self._refused

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_ACK and message.command == _REQUEST:
            self._refused += message.result not in _ACCEPTED

    def poll(self, now_s: float) -> list[Message]:
        """Return the requests, once."""
        identity = self._view().identity
        if self._requested or identity is None:
            return []
        self._requested = True
        commands = [common_commands.request_message(number) for number in self._missing]
        return [
            mavlink.MAVLink_command_long_message(*identity[:2], _REQUEST, 0, *command.params, *[0.0] * 5)
            for command in commands
        ]

    def next_deadline(self) -> float | None:
        """Return None: the requests are sent once."""
        return None
