"""The ground station's side of the parameter protocol, without I/O.

``start_…`` begins an operation, ``poll`` returns what to send, ``receive`` takes what came, and ``result`` says how
it ended. One operation at a time; a new ``start_…`` replaces the one under way.
"""

from __future__ import annotations

from flightstack.mavlink.link import Address, Message, is_for, is_from
from gcs_cli.clients.param_operations import (
    DEFAULT_TIMING,
    ListAll,
    Operation,
    ParamDone,
    ParamFailed,
    ParamResult,
    ParamTiming,
    ReadOrSet,
)

__all__ = ["ParamClient", "ParamDone", "ParamFailed", "ParamResult", "ParamTiming"]


class ParamClient:
    """Reads and sets parameters of one vehicle."""

    def __init__(self, vehicle: Address, own: Address, timing: ParamTiming = DEFAULT_TIMING) -> None:
        self.vehicle = vehicle
        self.own = own
        self._timing = timing
        self._operation: Operation | None = None
        self._deadline_s: float | None = None
        self._sends_left = 0

    def start_list(self) -> None:
        """Fetch all parameters."""
        self._start(ListAll(self.vehicle, self._timing))

    def start_get(self, name: str) -> None:
        """Fetch one parameter."""
        self._start(ReadOrSet(self.vehicle, self._timing, name, None))

    def start_set(self, name: str, value: float) -> None:
        """Ask for the parameter's type, set it to the finite ``value``, and see it confirmed."""
        self._start(ReadOrSet(self.vehicle, self._timing, name, float(value)))

    @property
    def result(self) -> ParamResult | None:
        """How the operation ended; None while it is under way."""
        return None if self._operation is None else self._operation.result

    @property
    def progress(self) -> tuple[int, int]:
        """Parameters received, and those in all (0 before that is known)."""
        return (0, 0) if self._operation is None else self._operation.progress

    def receive(self, message: Message, now_s: float) -> None:
        """Take a message from the vehicle's link; what is not for this operation is ignored."""
        operation = self._operation
        if operation is None or self._deadline_s is None or not is_from(message, self.vehicle):
            return
        kind = message.get_type()
        if kind != "PARAM_VALUE" and not (kind == "PARAM_ERROR" and is_for(message, self.own)):
            return
        if operation.receive(message):
            self._sends_left = self._timing.retries + 1
            self._deadline_s = now_s + operation.wait_s
        if operation.result is not None:
            self._deadline_s = None

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        operation = self._operation
        if operation is None or self._deadline_s is None or now_s < self._deadline_s:
            return []
        if self._sends_left == 0:
            operation.result = operation.silence()
            self._deadline_s = None
            return []
        self._sends_left -= 1
        requests = operation.requests()
        self._deadline_s = now_s + operation.wait_s
        return requests

    def next_deadline(self) -> float | None:
        """Return when to poll next if nothing arrives before; -inf for at once, None for never."""
        return self._deadline_s

    def _start(self, operation: Operation) -> None:
        self._operation = operation
        self._deadline_s = float("-inf")
        self._sends_left = self._timing.retries + 1
