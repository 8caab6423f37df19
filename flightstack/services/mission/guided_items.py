"""Guided mission items, by which older clients of ArduPilot reposition the vehicle.

An item with current 2 gives a position (dronekit's ``simple_goto``), with current 3 an altitude. Each is answered with
MISSION_ACK. Newer clients use DO_REPOSITION, which has the same effect.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.mavlink.mission_messages import CHANGES_ALTITUDE, GOES_THERE, ack_message
from flightstack.plan.vocabulary import MissionResult, MissionType
from flightstack.services.commands import VehicleContext
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import ACCEPTED, DENIED, UNSUPPORTED_FRAME, Answer
from flightstack.services.commands.guided import CHANGE_MODE, reposition

_RESULTS: Mapping[int, MissionResult] = {
    ACCEPTED: MissionResult.ACCEPTED,
    DENIED: MissionResult.DENIED,
    UNSUPPORTED_FRAME: MissionResult.UNSUPPORTED_FRAME,
}
DEGREES = 1e-7
"""Unit of latitude and longitude in MISSION_ITEM_INT [deg]."""


class GuidedItems:
    """Executes guided items as DO_REPOSITION."""

    handles = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})

    def __init__(self, own: Address, vehicle: VehicleContext) -> None:
        self._own = own
        self._vehicle = vehicle
        self._outbox: list[tuple[Hashable | None, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Execute a guided item; ignore other items."""
        if message.current not in (GOES_THERE, CHANGES_ALTITUDE) or not is_for(message, self._own):
            return
        result = MissionResult.UNSUPPORTED
        if message.command == mavlink.MAV_CMD_NAV_WAYPOINT and message.mission_type == MissionType.MISSION:
            answer = self._go(message, peer)
            result = _RESULTS.get(answer.result, MissionResult.ERROR)
            if answer.reason:
                self._vehicle.journal.say(Severity.WARNING, f"Goto refused: {answer.reason}")
        ack = ack_message(sender(message), result, message.mission_type, 0)
        self._outbox.append((peer, ack))

    def _go(self, message: Message, peer: Hashable) -> Answer:
        """Execute DO_REPOSITION with the position of the item. As in ArduPilot, its heading is ignored."""
        scale = DEGREES if message.get_type() == "MISSION_ITEM_INT" else 1.0
        place = (message.x * scale, message.y * scale)
        if message.current == CHANGES_ALTITUDE:
            place = (math.nan, math.nan)
        params = (-1.0, float(CHANGE_MODE), 0.0, math.nan, *place, float(message.z))
        number = mavlink.MAV_CMD_DO_REPOSITION
        return reposition(
            self._vehicle, Command(number, params, True, message.frame, peer, sender(message), 0)
        )

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the acknowledgements."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return −inf while an acknowledgement is queued, else None."""
        return -math.inf if self._outbox else None
