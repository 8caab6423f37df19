"""The operations of a mission client: the messages that each one sends and processes.

``MissionClient`` adds time: it repeats ``request`` until an answer comes. An operation sets ``moved`` after
progress, which restarts the timeout, and ``result`` at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.mission_messages import Timing, ack_message, item_from_message, message_from_item
from flightstack.plan.commands import MissionResult, MissionType, result_name
from flightstack.plan.item import MissionItem

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


class Upload(Operation):
    """Sends the count, then each item that the vehicle requests, in any order and any number of times."""

    def __init__(self, vehicle: Address, mission_type: int, items: Sequence[MissionItem]) -> None:
        announced = min(len(items), 0xFFFF)  # the largest count of the field; a vehicle refuses so many
        count = mavlink.MAVLink_mission_count_message(*vehicle, announced, mission_type)
        super().__init__(vehicle, mission_type, count)
        self._items = tuple(items)
        self._count_message = count
        self._is_serving = False
        self._last_sent_seq = -1
        self._is_out_of_order = False
        self.may_be_open = True

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred items and their total."""
        return self._last_sent_seq + 1, len(self._items)

    def missing_answer(self) -> str:
        """Return a description of the missing answer."""
        done, count = self.progress
        if not self._is_serving:
            return "did not answer the announcement of the upload"
        missing = (
            f"did not ask for item {done} (last {count - 1})"
            if done < count
            else "did not confirm the upload"
        )
        return missing + (" after an item out of order" if self._is_out_of_order else "")

    def receive(self, message: Message) -> list[Message]:
        """Process a message from the vehicle, and return the answers."""
        kind = message.get_type()
        if kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            return self._on_request(message.seq)
        if kind == "MISSION_ACK" and self.result is None:
            self._on_ack(message.type, message.opaque_id)
        return []

    def _on_request(self, seq: int) -> list[Message]:
        # After success too: if the acceptance was a late copy, the upload still completes.
        if isinstance(self.result, Failed):
            return [self.ack(MissionResult.OPERATION_CANCELLED)]
        if not self._is_serving and (seq != 0 or not self._items):
            # A request of a previous upload: an item now would mix two missions.
            return [self._count_message]
        if seq >= len(self._items):
            if self.result is None:
                reason = f"the vehicle asked for item {seq} (last {len(self._items) - 1})"
                self.result = Failed(reason, MissionResult.INVALID_SEQUENCE, seq)
            return [self.ack(MissionResult.INVALID_SEQUENCE)]
        self._is_serving = True
        self._last_sent_seq = max(self._last_sent_seq, seq)
        self.may_be_open = self._last_sent_seq < 1
        # MISSION_ITEM_INT also for the deprecated MISSION_REQUEST, as specified. The item is also
        # repeated without an answer: a vehicle answers a repeated last item with the lost MISSION_ACK.
        self.request = message_from_item(
            self._items[seq], seq, self.vehicle, self.mission_type, is_current=seq == 0
        )
        self.moved = True
        return [self.request]

    def _on_ack(self, result: int, plan_id: int) -> None:
        is_whole = self._last_sent_seq == len(self._items) - 1
        if result == MissionResult.INVALID_SEQUENCE and self._is_serving:
            # ArduPilot answers a copy of an item so, and continues; a vehicle that has ended the upload falls silent
            self._is_out_of_order = True
        elif result != MissionResult.ACCEPTED:
            seq = self._last_sent_seq if self._is_serving else None
            self.refused(result, seq, is_whole=is_whole and seq is not None)
        elif is_whole:
            self.plan_id = plan_id
            self.result = Done(self._items)
        elif self._is_serving:
            # The end of a previous upload: begin again.
            self._is_serving, self._last_sent_seq = False, -1
            self.request = self._count_message


class Download(Operation):
    """Requests the count, then each item in turn."""

    only_reads = True

    def __init__(self, vehicle: Address, mission_type: int) -> None:
        request = mavlink.MAVLink_mission_request_list_message(*vehicle, mission_type)
        super().__init__(vehicle, mission_type, request)
        self._items: list[MissionItem] = []
        self._count = 0
        self._asked_early = False

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred items and their total."""
        return len(self._items), self._count

    def missing_answer(self) -> str:
        """Return a description of the missing answer."""
        if not self.waits_for_item:
            return "did not answer the request for its mission"
        return f"did not send item {len(self._items)} (last {self._count - 1})"

    def receive(self, message: Message) -> list[Message]:
        """Process a message from the vehicle, and return the answers."""
        kind = message.get_type()
        if self.result is not None:
            return []
        if kind == "MISSION_COUNT" and self._is_new_count(message):
            self._items, self._count = [], message.count
            self.plan_id = message.opaque_id
            self.waits_for_item = True
            return self._ask_next_item()
        if kind in ("MISSION_ITEM", "MISSION_ITEM_INT") and self.waits_for_item:
            return self._on_item(message)
        if kind == "MISSION_ACK" and message.type != MissionResult.ACCEPTED:
            self.refused(message.type, len(self._items) if self.waits_for_item else None)
        return []

    def _is_new_count(self, message: Message) -> bool:
        """Return False for a late copy of the count; the count of another plan restarts the download."""
        known = (self._count, self.plan_id)
        return not self.waits_for_item or (message.count, message.opaque_id) != known

    def _on_item(self, message: Message) -> list[Message]:
        if message.seq == len(self._items):
            self._items.append(item_from_message(message))
            return self._ask_next_item()
        if message.seq > len(self._items) and not self._asked_early:
            self._asked_early = True  # only once, else duplicates would multiply
            return [self.request]
        return []  # a copy of a received item

    def _ask_next_item(self) -> list[Message]:
        seq = len(self._items)
        self.moved = True
        self._asked_early = False
        if seq == self._count:
            self.result = Done(tuple(self._items))
            return [self.ack(MissionResult.ACCEPTED)]
        self.request = mavlink.MAVLink_mission_request_int_message(*self.vehicle, seq, self.mission_type)
        return [self.request]
