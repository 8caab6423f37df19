"""Client of the parameter protocol, sans-IO.

``start_…`` begins an operation, ``poll`` returns the messages to send, ``receive`` processes received ones, and
``result`` is the result at the end. One operation at a time; a new ``start_…`` replaces the current one.
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
    """Reads and sets parameters of one vehicle; ``casts`` as in ``parse_value``."""

    def __init__(
        self,
        vehicle: Address,
        own: Address,
        timing: ParamTiming = DEFAULT_TIMING,
        *,
        casts: bool = False,
    ) -> None:
        self._casts = casts
        self.vehicle = vehicle
        self.own = own
        self._timing = timing
        self._operation: Operation | None = None
        self._deadline_s: float | None = None
        self._sends_left = 0

    def start_list(self) -> None:
        """Read all parameters."""
        self._start(ListAll(self.vehicle, self._timing, casts=self._casts))

    def start_get(self, name: str) -> None:
        """Read one parameter."""
        self._start(ReadOrSet(self.vehicle, self._timing, name, None, casts=self._casts))

    def start_set(self, name: str, value: float) -> None:
        """Read the parameter's type, set it to the finite ``value``, and wait for the confirmation."""
        self._start(ReadOrSet(self.vehicle, self._timing, name, float(value), casts=self._casts))

    @property
    def result(self) -> ParamResult | None:
        """Result of the operation; None before its end."""
        return None if self._operation is None else self._operation.result

    @property
    def progress(self) -> tuple[int, int]:
        """Received parameters and their total (0 before the count is known)."""
        return (0, 0) if self._operation is None else self._operation.progress

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message; messages that do not belong to this operation are ignored."""
        operation = self._operation
        if operation is None or self._deadline_s is None or not is_from(message, self.vehicle):
            return
        kind = message.get_type()
        if kind != "PARAM_VALUE" and not (kind == "PARAM_ERROR" and is_for(message, self.own)):
            return
        if operation.receive(message):
            self._sends_left = operation.sends
            self._deadline_s = now_s + operation.wait_s
        if operation.result is not None:
            self._deadline_s = None

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        operation = self._operation
        if operation is None or self._deadline_s is None or now_s < self._deadline_s:
            return []
        if self._sends_left == 0:
            operation.result = operation.missing_answer()
            self._deadline_s = None
            return []
        self._sends_left -= 1
        requests = operation.requests()
        self._deadline_s = now_s + operation.wait_s
        return requests

    def next_deadline(self) -> float | None:
        """Return the time of the next ``poll`` without an earlier message; -inf: immediately, None: never."""
        return self._deadline_s

    def _start(self, operation: Operation) -> None:
        self._operation = operation
        self._deadline_s = float("-inf")
        self._sends_left = operation.sends
