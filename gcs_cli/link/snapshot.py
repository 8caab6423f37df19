"""The present state of the vehicle: requests each message that has not arrived yet once. Sans-IO.

A message that is streamed once a second, such as SYS_STATUS, would arrive too late for ``gcs status``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Address, Message, is_for, is_from
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
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED: lambda view: view.mission.reached is not None,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: lambda view: view.healthy is not None,  # and battery
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: lambda view: view.gnss is not None,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: lambda view: view.estimator is not None,
    EscStatus.id: lambda view: bool(view.rotor_rpm),
    FS_LOOP_TIMING_ID: lambda view: view.timing is not None,
}
"""Messages of the state, and whether the view has their values."""


class Snapshot:
    """Requests the messages of ``_KNOWN`` whose values ``view`` lacks, all at once."""

    def __init__(
        self, view: Callable[[], VehicleView], own: Address, *, omitted: Set[int] = frozenset()
    ) -> None:
        """``own`` is this side; messages in ``omitted`` are not requested."""
        self._view = view
        self._own = own
        self._omitted = omitted
        self._requested = False
        self._refused = 0

    @property
    def _missing(self) -> list[int]:
        view = self._view()
        lacking = view.autopilot.lacks_messages | self._omitted
        return [number for number, is_known in _KNOWN.items() if number not in lacking and not is_known(view)]

    @property
    def complete(self) -> bool:
        """True if all values are known, but those that the vehicle refused to send.

        A refusal names no message: all requests of this side at that time must be those of the snapshot.
        """
        return len(self._missing) <= self._refused

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        identity = self._view().identity
        is_answer = message.get_type() == "COMMAND_ACK" and message.command == _REQUEST
        if is_answer and identity is not None and is_from(message, Address(*identity[:2])):
            self._refused += is_for(message, self._own) and message.result not in _ACCEPTED

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
