"""Ask the vehicle to stream messages that it does not send by itself. Without I/O."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message

RETRY_S = 1.0
"""Before a request without an answer is sent again."""
RENEW_S = 3.0
"""A stream that brings nothing for so long is asked for again: the vehicle may have rebooted."""

LOOP_TIMING = {FS_LOOP_TIMING_ID: 2.0}
ROTORS_AND_TIMING = {**LOOP_TIMING, int(EscStatus.id): 10.0}
"""What the views show beside standard telemetry: message id -> rate [Hz]."""

_SET_INTERVAL = int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)


class Subscription:
    """Requests streams one after the other, and again when they stop. A refused one is not requested again.

    ``target`` returns system and component of the vehicle, (0, 0) while there is none.
    """

    def __init__(self, target: Callable[[], tuple[int, int]], rates_hz: Mapping[int, float]) -> None:
        self._target = target
        self._rates_hz = rates_hz
        self._vehicle = (0, 0)
        self._due_s = dict.fromkeys(rates_hz, -math.inf)
        self._asked: int | None = None
        """The message whose request has no answer yet: COMMAND_ACK does not name it."""

    def receive(self, message: Message, now_s: float) -> None:
        """Take a message from the vehicle."""
        number = message.get_msgId()
        if number in self._due_s:
            self._due_s[number] = now_s + RENEW_S
        elif number == mavlink.MAVLINK_MSG_ID_COMMAND_ACK and message.command == _SET_INTERVAL:
            if self._asked is not None:
                is_accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
                self._due_s[self._asked] = now_s + RENEW_S if is_accepted else math.inf
            self._asked = None

    def poll(self, now_s: float) -> list[Message]:
        """Return the request to send now, if any."""
        if self._target() != self._vehicle:  # another vehicle may send what the one before refused
            self._vehicle = self._target()
            self._due_s = dict.fromkeys(self._rates_hz, now_s)
            self._asked = None
        number = self._next
        if self._vehicle == (0, 0) or now_s < self._due_s[number]:
            return []
        self._asked = number
        self._due_s[number] = now_s + RETRY_S
        interval_us = 1e6 / self._rates_hz[number]
        return [
            mavlink.MAVLink_command_long_message(
                *self._vehicle, _SET_INTERVAL, 0, number, interval_us, 0.0, 0.0, 0.0, 0.0, 0.0
            )
        ]

    def next_deadline(self) -> float | None:
        """Return when ``poll`` has something to do; None while there is no vehicle, or nothing to ask for."""
        due_s = self._due_s[self._next]
        return None if self._vehicle == (0, 0) or due_s == math.inf else due_s

    @property
    def _next(self) -> int:
        """The message to ask for next: the one whose request has no answer, else the one that is due first."""
        return min(self._due_s, key=self._due_s.__getitem__) if self._asked is None else self._asked
