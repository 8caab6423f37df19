"""The operations of a mission client, each as the messages it sends and the answers it takes.

Here what they share, and the short ones; upload and download are in ``mission_transfers``.
``MissionClient`` adds time: it sends ``request`` again while no answer comes. An operation sets ``moved``
when an answer brought it on, which starts the wait anew, and ``result`` when it is over.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.mission_messages import Timing, ack_message
from flightstack.plan.item import MissionItem
from flightstack.plan.vocabulary import MissionResult, result_name


class Done(NamedTuple):
    """The operation succeeded; ``items`` are those uploaded or downloaded."""

    items: tuple[MissionItem, ...] = ()


class Failed(NamedTuple):
    """The operation failed, and the vehicle keeps the mission that it had."""

    reason: str
    """One sentence."""
    result: int
    """The MAV_MISSION_RESULT: the vehicle's, or OPERATION_CANCELLED when we gave up."""
    seq: int | None = None
    """The item under way. None once all are across: then only the vehicle's STATUSTEXT names the item."""


class Operation:
    """One operation on one mission type of one vehicle."""

    waits_for_item = False
    is_transfer = True
    only_reads = False
    may_be_open = False
    """Whether the vehicle may still wait for the first item of an upload that is over for us."""

    def __init__(self, vehicle: Address, mission_type: int, request: Message) -> None:
        self.vehicle = vehicle
        self.mission_type = mission_type
        self.request: Message = request
        self.result: Done | Failed | None = None
        self.plan_id = 0
        self.moved = False

    @property
    def progress(self) -> tuple[int, int]:
        """Items transferred, and items in all (0 before the count is known)."""
        return 0, 0

    def silence(self) -> str:
        """Return what the vehicle failed to do."""
        raise NotImplementedError

    def receive(self, message: Message) -> list[Message]:
        """Take a message of this mission type from the vehicle, and return the answers to it."""
        raise NotImplementedError

    def quiet_after(self, before: Operation, timing: Timing) -> float:
        """Return how long [s] the link must be quiet between the operation ``before`` and this one.

        No message says which transfer it belongs to, so late ones must be gone. Downloads share no message
        with the others that would matter.
        """
        if SetCurrent in (type(self), type(before)) or self.only_reads != before.only_reads:
            return 0.0
        return timing.settle_s + (timing.silence_s if before.may_be_open else 0.0)

    def ack(self, result: MissionResult) -> Message:
        """Return the MISSION_ACK that ends the operation."""
        return ack_message(self.vehicle, result, self.mission_type)

    def refused(self, result: int, seq: int | None = None) -> None:
        """End the operation with the vehicle's refusal."""
        self.may_be_open = False
        self.result = Failed(f"the vehicle refused: {result_name(result)}", result, seq)


class Clear(Operation):
    """Removes the vehicle's mission."""

    is_transfer = False

    def __init__(self, vehicle: Address, mission_type: int) -> None:
        request = mavlink.MAVLink_mission_clear_all_message(*vehicle, mission_type)
        super().__init__(vehicle, mission_type, request)

    def silence(self) -> str:
        """Return what the vehicle failed to do."""
        return "did not confirm that its mission is cleared"

    def receive(self, message: Message) -> list[Message]:
        """Take the vehicle's message, and return the answers to it."""
        if message.get_type() == "MISSION_ACK" and self.result is None:
            if message.type == MissionResult.ACCEPTED:
                self.result = Done()
            else:
                self.refused(message.type)
        return []


class SetCurrent(Operation):
    """Makes an item the one that the vehicle flies next; its MISSION_CURRENT is the answer."""

    is_transfer = False

    def __init__(self, vehicle: Address, mission_type: int, seq: int) -> None:
        super().__init__(vehicle, mission_type, mavlink.MAVLink_mission_set_current_message(*vehicle, seq))
        self._seq = seq

    def silence(self) -> str:
        """Return what the vehicle failed to do."""
        return f"did not make item {self._seq} its current one"

    def receive(self, message: Message) -> list[Message]:
        """Take the vehicle's message, and return the answers to it."""
        if message.get_type() == "MISSION_CURRENT" and message.seq == self._seq:
            self.result = self.result or Done()
        return []
