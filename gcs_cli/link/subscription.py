"""Request messages that the vehicle does not stream by default. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message

RETRY_S = 1.0
"""Time after which a request without an answer is sent again."""
RENEW_S = 3.0
"""Time without messages after which a stream is requested again: the vehicle may have rebooted."""

LOOP_TIMING = {FS_LOOP_TIMING_ID: 2.0}
ROTORS_AND_TIMING = {**LOOP_TIMING, int(EscStatus.id): 10.0}
"""Messages of the views in addition to standard telemetry: message id -> rate [Hz]."""

_SET_INTERVAL = int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)


class Subscription:
    """Requests streams one after the other, and again if they stop. A refused stream is not requested again.

    ``target`` returns system and component of the vehicle, (0, 0) without one.
    """

    def __init__(self, target: Callable[[], tuple[int, int]], rates_hz: Mapping[int, float]) -> None:
        self._target = target
        self._rates_hz = rates_hz
        self._vehicle = (0, 0)
        self._due_s = dict.fromkeys(rates_hz, -math.inf)
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

    def poll(self, now_s: float) -> list[Message]:
        """Return the request to send now, if any."""
        if self._target() != self._vehicle:  # a new vehicle may accept requests that the former one refused
            self._vehicle = self._target()
            self._due_s = dict.fromkeys(self._rates_hz, now_s)
            self._pending = None
        number = self._next
        if self._vehicle == (0, 0) or now_s < self._due_s[number]:
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
        due_s = self._due_s[self._next]
        return None if self._vehicle == (0, 0) or due_s == math.inf else due_s

    @property
    def _next(self) -> int:
        """The message to request next: the pending one, else the one that is due first."""
        return min(self._due_s, key=self._due_s.__getitem__) if self._pending is None else self._pending
