"""Take offboard setpoints from whoever streams them; the last writer wins."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Protocol

from flightstack.guidance.setpoints import OffboardSetpoint
from flightstack.mavlink.addressing import Address, is_for
from flightstack.mavlink.link import Message
from flightstack.services.streams.setpoint_messages import Here, read_setpoint
from flightstack.services.streams.stream_watch import StreamWatch

_SILENCE_S = 10.0  # between two texts about refused setpoints: they come at 50 Hz


class SetpointReceiver(Protocol):
    """What the service needs of the vehicle."""

    def here(self) -> Here:
        """Tell where the vehicle is now."""
        ...

    def take_offboard(self, setpoint: OffboardSetpoint) -> None:
        """Remember the newest setpoint."""
        ...

    def refuse_offboard(self, reason: str) -> None:
        """Tell the operator why setpoints are not taken."""
        ...


class SetpointServer:
    """SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT and SET_ATTITUDE_TARGET."""

    handles = frozenset(
        {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"}
    )

    def __init__(self, own: Address, vehicle: SetpointReceiver, watch: StreamWatch) -> None:
        self._own = own
        self._vehicle = vehicle
        self._watch = watch
        self._said_s = -math.inf

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a setpoint; one that is refused neither replaces the last nor keeps the stream alive."""
        if not is_for(message, self._own):
            return
        setpoint = read_setpoint(message, self._vehicle.here())
        if not isinstance(setpoint, str):
            self._vehicle.take_offboard(setpoint)
            self._watch.heard(now_s)
        elif now_s - self._said_s >= _SILENCE_S:
            self._said_s = now_s
            self._vehicle.refuse_offboard(f"Setpoint refused: {setpoint}")

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Send nothing; note a stream that has fallen silent."""
        self._watch.check(now_s)
        return []

    def next_deadline(self) -> float | None:
        """Return None: a loss counts on the vehicle's clock too, which moves on only between polls."""
        return None
