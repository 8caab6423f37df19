"""Request messages of the vehicle: streams that it does not send by default, and its present state. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Set

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Address, Message, is_for, is_from
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import Autopilot
from gcs_cli.autopilots.registry import autopilot_of
from gcs_cli.vehicle.view_types import Identity, VehicleView

RETRY_S = 1.0
"""Time after which a request without an answer is sent again."""
RENEW_S = 3.0
"""Time without messages after which a stream is requested again: the vehicle may have rebooted."""

LOOP_TIMING = {FS_LOOP_TIMING_ID: 2.0}
ROTORS_AND_TIMING = {**LOOP_TIMING, int(EscStatus.id): 10.0}
"""Messages of the views in addition to standard telemetry: message id -> rate [Hz]."""

_SET_INTERVAL = int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
_OF_GROUPS = int(mavlink.MAVLINK_MSG_ID_ATTITUDE)
"""Message that shows that the groups of streams are sent."""


class Subscription:
    """Requests streams one after the other, and again if they stop. A refused stream is not requested again.

    ``identity`` returns that of the vehicle. Besides ``rates_hz`` (message id -> rate), the streams that its
    autopilot does not send until asked are requested.
    """

    def __init__(self, identity: Callable[[], Identity | None], rates_hz: Mapping[int, float]) -> None:
        self._identity = identity
        self._wanted_hz = rates_hz
        self._vehicle = (0, 0)
        self._rates_hz: Mapping[int, float] = {}
        self._groups_hz: Mapping[int, int] = {}
        self._due_s: dict[int, float] = {}
        self._groups_due_s = math.inf
        self._pending: int | None = None
        """The message whose request has no answer yet: COMMAND_ACK does not name it."""

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        number = message.get_msgId()
        if number in self._due_s:
            self._due_s[number] = now_s + RENEW_S
        elif number == mavlink.MAVLINK_MSG_ID_COMMAND_ACK and message.command == _SET_INTERVAL:
            if self._pending is not None:
                is_accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
                self._due_s[self._pending] = now_s + RENEW_S if is_accepted else math.inf
            self._pending = None
        if number == _OF_GROUPS and self._groups_hz:
            self._groups_due_s = now_s + RENEW_S

    def poll(self, now_s: float) -> list[Message]:
        """Return the requests to send now, if any."""
        identity = self._identity()
        vehicle = (0, 0) if identity is None else identity[:2]
        if vehicle != self._vehicle:  # a new vehicle may accept requests that the former one refused
            self._begin(vehicle, autopilot_of(0 if identity is None else identity.autopilot), now_s)
        if vehicle == (0, 0):
            return []
        return [*self._group_requests(now_s), *self._message_request(now_s)]

    def _begin(self, vehicle: tuple[int, int], autopilot: Autopilot, now_s: float) -> None:
        self._vehicle = vehicle
        rates_hz = {**autopilot.stream_messages_hz, **self._wanted_hz}
        lacking = autopilot.lacks_messages
        self._rates_hz = {number: rate for number, rate in rates_hz.items() if number not in lacking}
        self._groups_hz = autopilot.stream_groups_hz
        self._due_s = dict.fromkeys(self._rates_hz, now_s)
        self._groups_due_s = now_s if self._groups_hz else math.inf
        self._pending = None

    def _group_requests(self, now_s: float) -> list[Message]:
        if now_s < self._groups_due_s:
            return []
        self._groups_due_s = now_s + RENEW_S
        start = mavlink.MAVLink_request_data_stream_message
        return [start(*self._vehicle, group, rate_hz, 1) for group, rate_hz in self._groups_hz.items()]

    def _message_request(self, now_s: float) -> list[Message]:
        number = self._next
        if number is None or now_s < self._due_s[number]:
            return []
        self._pending = number
        self._due_s[number] = now_s + RETRY_S
        interval_us = 1e6 / self._rates_hz[number]
        return [
            mavlink.MAVLink_command_long_message(
                *self._vehicle, _SET_INTERVAL, 0, number, interval_us, 0.0, 0.0, 0.0, 0.0, 0.0
            )
        ]

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll``; None without a vehicle, or without requests."""
        number = self._next
        due_s = min(math.inf if number is None else self._due_s[number], self._groups_due_s)
        return None if self._vehicle == (0, 0) or due_s == math.inf else due_s

    @property
    def _next(self) -> int | None:
        """The message to request next: the pending one, else the one that is due first."""
        if self._pending is not None or not self._due_s:
            return self._pending
        return min(self._due_s, key=self._due_s.__getitem__)


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
