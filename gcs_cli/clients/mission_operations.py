"""The operations of a mission client: the messages that each one sends and processes.

This file has their interface and the short ones; upload and download are in ``mission_transfers``.
``MissionClient`` adds time: it repeats ``request`` until an answer comes. An operation sets ``moved`` after
progress, which restarts the timeout, and ``result`` at its end.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.mission_messages import Timing, ack_message
from flightstack.plan.item import MissionItem
from flightstack.plan.vocabulary import MissionResult, MissionType, result_name

_MEANINGS = {
    MissionResult.ERROR: "it gives no reason",
    MissionResult.UNSUPPORTED_FRAME: "the frame is not supported",
    MissionResult.UNSUPPORTED: "the command is not supported",
    MissionResult.NO_SPACE: "too many items",
    MissionResult.INVALID: "a value is not valid",
    **{
        MissionResult(MissionResult.INVALID_PARAM1 + index): f"parameter {index + 1} is not valid"
        for index in range(7)
    },
    MissionResult.INVALID_SEQUENCE: "an item came out of order",
    MissionResult.DENIED: "it does not take one now",
    MissionResult.OPERATION_CANCELLED: "it cancelled the transfer",
}


_TRY_COUNT = (MissionResult.ERROR, MissionResult.UNSUPPORTED)
"""Refusals of MISSION_CLEAR_ALL after which the upload of no items may succeed, as ArduPilot's of a geofence."""


class Done(NamedTuple):
    """The operation succeeded; ``items`` are those uploaded or downloaded."""

    items: tuple[MissionItem, ...] = ()


class Failed(NamedTuple):
    """The operation failed, and the vehicle keeps its former mission."""

    reason: str
    """One sentence for the user."""
    result: int
    """The MAV_MISSION_RESULT: the vehicle's, or OPERATION_CANCELLED after a timeout."""
    seq: int | None = None
    """The last item that the vehicle requested: if it checks each item, the refused one."""
    is_whole: bool = False
    """True if the vehicle had all items: it may have refused any of them, or the plan as a whole."""


class Operation:
    """One operation on one mission type of one vehicle."""

    waits_for_item = False
    is_transfer = True
    only_reads = False
    may_be_open = False
    """True if the vehicle may still wait for the first item of an upload that has ended here."""

    def __init__(self, vehicle: Address, mission_type: int, request: Message) -> None:
        self.vehicle = vehicle
        self.mission_type = mission_type
        self.request: Message = request
        self.result: Done | Failed | None = None
        self.plan_id = 0
        self.moved = False

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred items and their total (0 before the count is known)."""
        return 0, 0

    def missing_answer(self) -> str:
        """Return a description of the missing answer."""
        raise NotImplementedError

    def receive(self, message: Message) -> list[Message]:
        """Process a message of this mission type from the vehicle, and return the answers."""
        raise NotImplementedError

    def quiet_after(self, before: Operation, timing: Timing) -> float:
        """Return how long [s] the link must be quiet between the operation ``before`` and this one.

        Messages do not identify their transfer, so that late ones must not arrive in the next one. Downloads share
        no such message with the others.
        """
        if SetCurrent in (type(self), type(before)) or self.only_reads != before.only_reads:
            return 0.0
        return timing.settle_s + (timing.silence_s if before.may_be_open else 0.0)

    def ack(self, result: MissionResult) -> Message:
        """Return the MISSION_ACK that ends the operation."""
        return ack_message(self.vehicle, result, self.mission_type)

    def refused(self, result: int, seq: int | None = None, *, is_whole: bool = False) -> None:
        """End the operation with the vehicle's refusal."""
        self.may_be_open = False
        self.result = Failed(f"the vehicle refused: {result_text(result)}", result, seq, is_whole)


def result_text(result: int) -> str:
    """Return the meaning and the name of a MAV_MISSION_RESULT."""
    meaning = _MEANINGS.get(MissionResult(result)) if result in MissionResult.__members__.values() else None
    return result_name(result) if meaning is None else f"{meaning} ({result_name(result)})"


class Clear(Operation):
    """Removes the vehicle's mission: by MISSION_CLEAR_ALL, or if that is refused, by the upload of no items."""

    is_transfer = False

    def __init__(self, vehicle: Address, mission_type: int) -> None:
        request = mavlink.MAVLink_mission_clear_all_message(*vehicle, mission_type)
        super().__init__(vehicle, mission_type, request)
        self._has_counted = False

    def missing_answer(self) -> str:
        """Return a description of the missing answer."""
        return "did not confirm that its mission is cleared"

    def receive(self, message: Message) -> list[Message]:
        """Process a message from the vehicle, and return the answers."""
        if message.get_type() == "MISSION_ACK" and self.result is None:
            if message.type == MissionResult.ACCEPTED:
                self.result = Done()
            elif (
                message.type in _TRY_COUNT and self.mission_type != MissionType.ALL and not self._has_counted
            ):
                self._has_counted = self.moved = True
                self.request = mavlink.MAVLink_mission_count_message(*self.vehicle, 0, self.mission_type)
                return [self.request]
            else:
                self.refused(message.type)
        return []


class SetCurrent(Operation):
    """Sets the current item; MISSION_CURRENT is the answer."""

    is_transfer = False

    def __init__(self, vehicle: Address, mission_type: int, seq: int) -> None:
        super().__init__(vehicle, mission_type, mavlink.MAVLink_mission_set_current_message(*vehicle, seq))
        self._seq = seq

    def missing_answer(self) -> str:
        """Return a description of the missing answer."""
        return f"did not make item {self._seq} its current one"

    def receive(self, message: Message) -> list[Message]:
        """Process a message from the vehicle, and return the answers."""
        if message.get_type() == "MISSION_CURRENT" and message.seq == self._seq:
            self.result = self.result or Done()
        return []
