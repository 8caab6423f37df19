"""Client of the mission protocol, sans-IO.

``start_…`` begins an operation, ``poll`` returns the messages to send, ``receive`` processes received ones, and
``result`` is the result at the end. One operation at a time; a new ``start_…`` cancels the current one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.link import Address, Message, is_for, is_from
from flightstack.mavlink.mission_messages import DEFAULT_TIMING, ItemTimeout, Timing
from flightstack.plan.commands import MissionResult, MissionType
from flightstack.plan.item import MissionItem
from gcs_cli.clients.mission_operations import Clear, Done, Download, Failed, Operation, SetCurrent, Upload
from gcs_cli.plans.home_item import with_home_item, without_home_item
from gcs_cli.plans.itinerary import home_of_items

__all__ = ["Done", "Failed", "MissionClient"]

_ADDRESSED = frozenset(
    {
        "MISSION_ACK",
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
    }
)


class MissionClient:
    """Uploads, downloads, clears and sets the current item of one mission type on one vehicle.

    ``begins_with_home``: item 0 of the vehicle's mission is its home position (``home``, if known), as on ArduPilot.
    The items and numbers of this client are those of the plan, which has no such item.
    """

    def __init__(
        self,
        vehicle: Address,
        own: Address,
        mission_type: MissionType = MissionType.MISSION,
        timing: Timing = DEFAULT_TIMING,
        *,
        begins_with_home: bool = False,
        home: GeoPoint | None = None,
    ) -> None:
        self._begins_with_home = begins_with_home and mission_type == MissionType.MISSION
        self._home = home
        self.vehicle = vehicle
        self.own = own
        self.mission_type = mission_type
        self._timing = timing
        self._item_timeout = ItemTimeout(timing.item_timeout_s)
        self._operation: Operation | None = None
        self._outbox: list[Message] = []
        self._deadline_s: float | None = None
        self._give_up_s = math.inf
        self._sends_left = 0
        self._is_settling = False
        self._busy_s = -math.inf  # time of the last message of the protocol
        self._ended_s: float | None = None  # time of the last one since the end of the operation

    def start_upload(self, items: Sequence[MissionItem]) -> None:
        """Replace the vehicle's mission by ``items``; without items, clear it."""
        if self._begins_with_home and items:
            items = with_home_item(tuple(items), home_of_items(items, self._home))
        self._start(Upload(self.vehicle, self.mission_type, items))

    def start_download(self) -> None:
        """Download the vehicle's mission."""
        self._start(Download(self.vehicle, self.mission_type))

    def start_clear(self) -> None:
        """Remove the vehicle's mission."""
        self._start(Clear(self.vehicle, self.mission_type))

    def start_set_current(self, seq: int) -> None:
        """Set the current item to ``seq`` (0 to 65535)."""
        self._start(SetCurrent(self.vehicle, self.mission_type, seq + self._shift))

    def cancel(self) -> None:
        """Cancel the operation, and tell the vehicle."""
        if self._operation is not None and self._operation.result is None:
            self._outbox.clear()
            self._give_up(self._operation, "the operation was cancelled")

    @property
    def result(self) -> Done | Failed | None:
        """Result of the operation; None before its end."""
        result = self._operation.result if self._operation else None
        if isinstance(result, Done) and result.items and self._begins_with_home:
            return Done(without_home_item(result.items))
        if isinstance(result, Failed) and result.seq is not None:
            return result._replace(seq=max(0, result.seq - self._shift))
        return result

    @property
    def plan_id(self) -> int:
        """MAVLink's opaque id of the uploaded or downloaded plan; 0 if the vehicle sends none."""
        return self._operation.plan_id if self._operation else 0

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred items and their total (0 before the count is known)."""
        sent, count = self._operation.progress if self._operation else (0, 0)
        return max(0, sent - self._shift), max(0, count - self._shift)

    @property
    def _shift(self) -> int:
        """The vehicle's number of item 0 of the plan."""
        return int(self._begins_with_home)

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message; messages that do not belong to this operation are ignored."""
        operation = self._operation
        kind = message.get_type()
        if operation is None or not is_from(message, self.vehicle):
            return
        if kind in _ADDRESSED:
            if not is_for(message, self.own) or message.mission_type != self.mission_type:
                return
        elif kind != "MISSION_CURRENT":
            return
        if operation.result is not None and self._belongs_to_others(kind, now_s):
            return
        self._busy_s = now_s
        if self._is_settling:
            self._receive_early(kind, now_s)
            return
        self._outbox += operation.receive(message)
        if operation.result is not None:
            self._deadline_s = None
        elif operation.moved:
            operation.moved = False
            if operation.waits_for_item:
                self._item_timeout.answered(now_s)
                self._item_timeout.asked(now_s, again=False)
            self._sends_left = self._timing.retries
            self._wait(operation, now_s)
            self._give_up_s = now_s + self._timing.silence_s

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        operation = self._operation
        if operation is not None and self._deadline_s is not None and now_s >= self._deadline_s:
            is_over = now_s >= self._give_up_s if operation.waits_for_item else self._sends_left == 0
            if is_over:
                self._give_up(
                    operation, f"the vehicle (system {self.vehicle.system}) {operation.missing_answer()}"
                )
            else:
                self._is_settling = False
                self._sends_left -= 1
                self._outbox.append(operation.request)
                if operation.waits_for_item:
                    self._item_timeout.asked(now_s, again=True)
                self._wait(operation, now_s)
        if operation is not None and operation.result is not None and self._ended_s is None:
            self._ended_s = now_s
        outbox, self._outbox = self._outbox, []
        if outbox:
            self._busy_s = now_s
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next ``poll`` without an earlier message; -inf: immediately, None: never."""
        return -math.inf if self._outbox else self._deadline_s

    def _start(self, operation: Operation) -> None:
        self.cancel()
        before, self._operation, self._ended_s = self._operation, operation, None
        self._item_timeout = ItemTimeout(self._timing.item_timeout_s)
        self._deadline_s = -math.inf  # the first poll sends the request and starts the clock
        quiet_s = operation.quiet_after(before, self._timing) if before is not None else 0.0
        if quiet_s > 0.0:
            self._deadline_s = self._busy_s + quiet_s
        self._is_settling = quiet_s > 0.0
        self._sends_left = self._timing.retries + 1

    def _belongs_to_others(self, kind: str, now_s: float) -> bool:
        """Return True if the message came too late after the end of the operation to belong to it.

        Another program may use the same address, such as ``gcs mission upload`` on the link of ``gcs watch``: the
        requests of its upload are not to be answered with items of this one.
        """
        if kind == "MISSION_CURRENT":
            return True
        return self._ended_s is not None and now_s > self._ended_s + self._timing.settle_s

    def _receive_early(self, kind: str, now_s: float) -> None:
        """Process a message of the previous operation: cancel it if the vehicle still requests items."""
        if self._operation is not None and kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            self._outbox.append(self._operation.ack(MissionResult.OPERATION_CANCELLED))
            if self._deadline_s is not None:
                self._deadline_s = now_s + self._timing.silence_s + self._timing.settle_s

    def _wait(self, operation: Operation, now_s: float) -> None:
        timing = self._timing
        self._deadline_s = now_s + (
            self._item_timeout.timeout_s if operation.waits_for_item else timing.timeout_s
        )

    def _give_up(self, operation: Operation, reason: str) -> None:
        if operation.is_transfer:
            self._outbox.append(operation.ack(MissionResult.OPERATION_CANCELLED))
        operation.result = Failed(reason, MissionResult.OPERATION_CANCELLED)
        self._deadline_s = None
