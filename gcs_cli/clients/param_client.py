"""Client of the parameter protocol, sans-IO.

``start_…`` begins an operation, ``poll`` returns the messages to send, ``receive`` processes received ones, and
``result`` is the result at the end. One operation at a time; a new ``start_…`` replaces the current one.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeAlias

from flightstack.core.float32 import as_float32
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, is_from
from flightstack.mavlink.param_values import (
    HASH_NAME,
    LARGEST_CAST_INTEGER,
    LARGEST_INTEGER,
    Parameter,
    parse_value,
    set_value,
    type_of,
)

_REASONS = {
    1: "the vehicle has no such parameter",
    2: "the value is outside the parameter's range",
    3: "the vehicle does not permit it",
    4: "the vehicle has no such component",
    5: "the parameter is read-only",
    6: "the vehicle does not support the type of the value",
    7: "the type of the value is not the parameter's",
    8: "the vehicle could not read the parameter",
}
"""Description of each MAV_PARAM_ERROR."""


class ParamTiming(NamedTuple):
    """Timeouts of the protocol [s of the clock that drives it]."""

    timeout_s: float = 0.5
    """Time after which a request is sent again."""
    quiet_s: float = 0.2
    """Time without messages after which missing parameters of a list are requested."""
    retries: int = 20
    """Repetitions without progress."""
    window: int = 20
    """Missing parameters per request."""
    read_timeout_s: float = 0.25
    """Time after which the request for one parameter is sent again."""
    reads: int = 8
    """Requests for one parameter without an answer."""
    probes: int = 5
    """Answers about another parameter, without one about the wanted one, that show that it does not exist: PX4 does not
    answer. With a loss of 20 % in each direction, an existing parameter is missed once in 1300 reads."""


class ParamDone(NamedTuple):
    """The read parameter, or all in the order of their index."""

    parameters: tuple[Parameter, ...]


class ParamFailed(NamedTuple):
    """The reason of a failure, in one sentence."""

    reason: str
    error: int | None
    """The vehicle's MAV_PARAM_ERROR; None without one."""
    silent: bool
    """True if the vehicle did not answer."""


ParamResult: TypeAlias = ParamDone | ParamFailed
DEFAULT_TIMING = ParamTiming()


class Operation(Protocol):
    """The messages of an operation; the client handles timeouts."""

    result: ParamResult | None

    @property
    def wait_s(self) -> float:
        """Timeout of the next message [s]."""
        ...

    @property
    def sends(self) -> int:
        """Requests without progress after which the operation fails."""
        ...

    @property
    def progress(self) -> tuple[int, int]:
        """Received parameters and their total (0 before the count is known)."""
        ...

    def requests(self) -> list[Message]:
        """Return the requests to send now; each call is one attempt."""
        ...

    def receive(self, message: Message) -> bool:
        """Process a PARAM_VALUE or PARAM_ERROR; return True if the operation made progress."""
        ...

    def missing_answer(self) -> ParamFailed:
        """Return the failure of an operation without an answer."""
        ...


class ReadOrSet:
    """Reads one parameter, and sets it if a value is given.

    Some vehicles do not answer about a parameter that does not exist. The requests are repeated with one for the
    first parameter of the vehicle: if that is answered, the vehicle knows no parameter of the name.
    """

    def __init__(
        self, vehicle: Address, timing: ParamTiming, name: str, wanted: float | None, *, casts: bool = False
    ) -> None:
        self.result: ParamResult | None = None
        self.wait_s = timing.read_timeout_s
        self._timing, self._casts = timing, casts
        self._vehicle, self._name, self._wanted = vehicle, name, wanted
        self._found: Parameter | None = None
        self._asked = 0
        self._probes = 0

    @property
    def progress(self) -> tuple[int, int]:
        """Received parameters and their total (0 before the count is known)."""
        return int(self.result is not None), 1

    @property
    def sends(self) -> int:
        """Requests without progress after which the operation fails."""
        return self._timing.reads if self._found is None else self._timing.retries + 1

    def requests(self) -> list[Message]:
        """Return the requests to send now."""
        self._asked += 1
        name = self._name.encode("ascii", errors="replace")[:16]
        if self._found is None:
            self.wait_s = self._timing.read_timeout_s
            requests = [mavlink.MAVLink_param_request_read_message(*self._vehicle, name, -1)]
            if self._asked > 1:
                requests.append(mavlink.MAVLink_param_request_read_message(*self._vehicle, b"", 0))
            return requests
        self.wait_s = self._timing.timeout_s
        assert self._wanted is not None  # without a value, the read parameter is the result
        kind = type_of(self._found.is_integer) if self._found.kind is None else self._found.kind
        value = set_value(self._wanted, kind, casts=self._casts)
        assert value is not None  # checked by _find
        return [mavlink.MAVLink_param_set_message(*self._vehicle, name, value, kind)]

    def receive(self, message: Message) -> bool:
        """Process a PARAM_VALUE or PARAM_ERROR; return True if the operation made progress."""
        if not self._asked:
            return False
        if message.param_id != self._name:
            self._count_probe(message)
            return self.result is not None
        if message.get_type() == "PARAM_ERROR":
            reason = _REASONS.get(message.error, f"the vehicle answered error {message.error}")
            self.result = ParamFailed(reason, message.error, False)
            return True
        parameter = parse_value(message, casts=self._casts)
        if parameter is None:
            self.result = ParamFailed(f"its type {message.param_type} is not supported", None, False)
        elif self._wanted is None or self._is_confirmed(parameter):
            self.result = ParamDone((parameter,))
        else:
            return self._find(parameter, self._wanted)
        return True

    def _count_probe(self, message: Message) -> None:
        is_probe = message.get_type() == "PARAM_VALUE" and message.param_index == 0
        if is_probe and self._found is None and self._asked > 1:
            self._probes += 1
            if self._probes >= self._timing.probes:
                reason = (
                    "the vehicle answers about others, not about this one: it seems to have no such parameter"
                )
                self.result = ParamFailed(reason, None, False)

    def _is_confirmed(self, parameter: Parameter) -> bool:
        """Return True if the parameter has the wanted value, also if it had it before."""
        return self._wanted is not None and as_float32(parameter.value) == as_float32(self._wanted)

    def _find(self, parameter: Parameter, wanted: float) -> bool:
        """Store the type. Another value may be an old message: the request is repeated."""
        is_first, self._found = self._found is None, parameter
        largest = LARGEST_CAST_INTEGER if self._casts else LARGEST_INTEGER
        if parameter.is_integer and not (wanted.is_integer() and abs(wanted) <= largest):
            self.result = ParamFailed("the parameter is an integer", None, False)
            return True
        if parameter.kind is not None and set_value(wanted, parameter.kind, casts=self._casts) is None:
            self.result = ParamFailed("the value is outside the range of the parameter's type", None, False)
            return True
        if is_first:
            self.wait_s = 0.0  # set it at once
        return is_first

    def missing_answer(self) -> ParamFailed:
        """Return the failure of an operation without an answer."""
        if self._found is not None:
            return ParamFailed(f"the vehicle keeps {self._found.value:g}", None, False)
        return ParamFailed(
            f"the vehicle (system {self._vehicle.system}) did not answer about {self._name}", None, True
        )


class ListAll:
    """Reads all parameters; lost ones are requested by index. Those of unsupported types are left out."""

    def __init__(self, vehicle: Address, timing: ParamTiming, *, casts: bool = False) -> None:
        self.result: ParamResult | None = None
        self._vehicle, self._timing, self._casts = vehicle, timing, casts
        self._count = 0
        self._got: dict[int, Parameter | None] = {}
        self._is_asked = False

    @property
    def progress(self) -> tuple[int, int]:
        """Received parameters and their total (0 before the count is known)."""
        return len(self._got), self._count

    @property
    def wait_s(self) -> float:
        """Timeout of the next message [s]."""
        return self._timing.quiet_s if self._count else self._timing.timeout_s

    @property
    def sends(self) -> int:
        """Requests without progress after which the operation fails."""
        return self._timing.retries + 1

    def requests(self) -> list[Message]:
        """Return the requests to send now."""
        self._is_asked = True
        if not self._count:
            return [mavlink.MAVLink_param_request_list_message(*self._vehicle)]
        missing = [index for index in range(self._count) if index not in self._got]
        return [
            mavlink.MAVLink_param_request_read_message(*self._vehicle, b"", index)
            for index in missing[: self._timing.window]
        ]

    def receive(self, message: Message) -> bool:
        """Process a PARAM_VALUE or PARAM_ERROR; return True if the operation made progress."""
        if message.get_type() != "PARAM_VALUE" or not self._is_asked:
            return False
        if message.param_count != self._count:  # the first message, or another vehicle
            self._count = message.param_count
            self._got.clear()
        place = message.param_index
        if message.param_id == HASH_NAME or place >= self._count:
            return False
        is_new = place not in self._got
        self._got[place] = parse_value(message, casts=self._casts)
        if len(self._got) == self._count:
            known = (self._got[index] for index in range(self._count))
            self.result = ParamDone(tuple(parameter for parameter in known if parameter is not None))
        return is_new

    def missing_answer(self) -> ParamFailed:
        """Return the failure of an operation without an answer."""
        system = f"the vehicle (system {self._vehicle.system})"
        if not self._count:
            return ParamFailed(f"{system} did not send its parameters", None, True)
        missing = self._count - len(self._got)
        return ParamFailed(
            f"{system} did not send {missing} of {self._count} parameters", None, not self._got
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
