"""Vehicle side of the parameter protocol, without I/O: https://mavlink.io/en/services/parameter.html

Lists go to several clients at once, at a bounded rate. A change is sent to every peer. A refused change is answered
with PARAM_ERROR and the value in force.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.mavlink.param_values import (
    HASH_NAME,
    LARGEST_INTEGER,
    REAL32,
    digest,
    digest_message,
    integer_of,
    type_of,
    value_message,
)
from flightstack.params.store import ParamStore

DOES_NOT_EXIST: int = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
OUT_OF_RANGE: int = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
TYPE_MISMATCH = 7
"""MAV_PARAM_ERROR_TYPE_MISMATCH, which is newer than pymavlink's dialect."""

STEP_S = 0.01
PER_PEER = 20
"""List entries per peer and step: 2000 per second, 74 kB/s; 200 parameters take 0.1 s."""
PER_STEP = 20
"""List entries per step, and announced changes per step, of all peers: many clients must not delay the loops."""
MAX_ERRORS = 100
TEXTS_AT_ONCE, TEXTS_PER_S = 10, 2.0
_HASH_ENTRY = -1  # index of the digest, before the first parameter


class _TextBudget(NamedTuple):
    """Number of texts that may be sent, as of a link time."""

    left: float = float(TEXTS_AT_ONCE)
    at_s: float = -math.inf


class ParamServer:
    """Lists, reads and sets the parameters of ``store``; ``say`` gets the reason of a refusal.

    A ground station that read ArduPilot's ``param.pck`` (MAVProxy) sets integers as REAL32, which is accepted for
    whole numbers. Any other type than the parameter's is refused.
    """

    handles = frozenset({"PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"})

    def __init__(self, own: Address, store: ParamStore, say: Callable[[str], None]) -> None:
        self.own = own
        self._store = store
        self._say = say
        self._names = sorted(store.specs)
        self._index = {name: index for index, name in enumerate(self._names)}
        for spec in store.specs.values():
            if spec.is_integer and max(-spec.low, spec.high) > LARGEST_INTEGER:
                raise ValueError(f"{spec.name}: integers beyond {LARGEST_INTEGER} do not pass MAVLink")
        self._lists: dict[Hashable, int] = {}
        self._answers: dict[tuple[Hashable, str], None] = {}
        self._errors: deque[tuple[Hashable, Message]] = deque(maxlen=MAX_ERRORS)
        self._changed: dict[str, None] = {}
        self._next_step_s = -math.inf
        self._texts = _TextBudget()
        store.subscribe(lambda name, _value: self._changed.update({name: None}))

    # ------------------------------------------------------------------ receiving

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore other protocols and other targets."""
        kind = message.get_type()
        if kind not in self.handles or not is_for(message, self.own):
            return
        if kind == "PARAM_REQUEST_LIST":
            # a repeated request: the client did not accept the digest, or lost messages
            self._lists[peer] = 0 if peer in self._lists else _HASH_ENTRY
        elif kind == "PARAM_REQUEST_READ":
            self._read(message, peer)
        else:
            self._set(message, peer, now_s)

    def _read(self, message: Message, peer: Hashable) -> None:
        index = message.param_index
        if 0 <= index < len(self._names):
            self._answers[peer, self._names[index]] = None
        elif index < 0 and (message.param_id in self._index or message.param_id == HASH_NAME):
            self._answers[peer, message.param_id] = None
        else:
            self._refuse(message, peer, DOES_NOT_EXIST, index)

    def _set(self, message: Message, peer: Hashable, now_s: float) -> None:
        name = message.param_id
        if name == HASH_NAME:  # the client has all values in its cache: stop the list
            self._lists.pop(peer, None)
            return
        if name not in self._index:
            self._refuse(message, peer, DOES_NOT_EXIST)
            self._explain(f"Parameter {name} refused: there is no such parameter", now_s)
            return
        value = self._value_of(message)
        if value is None:
            self._refuse(message, peer, TYPE_MISMATCH)
            self._explain(f"Parameter {name} refused: it is {self._type_name(name)}", now_s)
        else:
            refusal = self._store.set(name, value)
            if refusal is None:
                self._changed[name] = None  # answers an unchanged value too
                return
            self._refuse(message, peer, OUT_OF_RANGE)
            self._explain(f"Parameter {name} refused: {refusal}", now_s)
        self._answers[peer, name] = None

    def _value_of(self, message: Message) -> float | None:
        """Return the value in a PARAM_SET; None if its type is not the parameter's."""
        is_integer = self._store.specs[message.param_id].is_integer
        if message.param_type == REAL32:
            value = float(message.param_value)
            return value if not is_integer or value.is_integer() else None
        if is_integer and message.param_type == type_of(is_integer):
            return float(integer_of(message.param_value))
        return None

    def _type_name(self, name: str) -> str:
        return "an integer (INT32)" if self._store.specs[name].is_integer else "a real number (REAL32)"

    def _refuse(self, message: Message, peer: Hashable, error: int, index: int = -1) -> None:
        name = message.param_id.encode("ascii", errors="replace")[:16]
        self._errors.append((peer, mavlink.MAVLink_param_error_message(*sender(message), name, index, error)))

    def _explain(self, reason: str, now_s: float) -> None:
        """Report a refusal, at a bounded rate."""
        left = min(float(TEXTS_AT_ONCE), self._texts.left + TEXTS_PER_S * max(0.0, now_s - self._texts.at_s))
        if left >= 1.0:
            self._say(reason)
            left -= 1.0
        self._texts = _TextBudget(left, now_s)

    # ------------------------------------------------------------------ sending

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None stands for every peer that was heard."""
        if not (self._changed or self._lists or self._answers or self._errors):  # the usual case
            return []
        outbox: list[tuple[Hashable | None, Message]] = [*self._errors]
        self._errors.clear()
        outbox += [(peer, self._message(name)) for peer, name in self._answers]
        self._answers.clear()
        if now_s < self._next_step_s or not (self._changed or self._lists):
            return outbox
        self._next_step_s = now_s + STEP_S
        for name in list(self._changed)[:PER_STEP]:
            del self._changed[name]
            outbox.append((None, self._message(name)))
        return outbox + self._list_entries()

    def _list_entries(self) -> list[tuple[Hashable | None, Message]]:
        """Return the next list entries of this step, and move the served peers to the end of the queue."""
        entries: list[tuple[Hashable | None, Message]] = []
        for peer in list(self._lists)[: PER_STEP // PER_PEER]:
            begin = self._lists.pop(peer)
            end = min(begin + PER_PEER, len(self._names))
            entries += [(peer, self._message(self._entry(index))) for index in range(begin, end)]
            if end < len(self._names):
                self._lists[peer] = end
        return entries

    def _entry(self, index: int) -> str:
        return HASH_NAME if index == _HASH_ENTRY else self._names[index]

    def _message(self, name: str) -> Message:
        if name == HASH_NAME:
            return digest_message(self._digest(), len(self._names))
        spec = self._store.specs[name]
        return value_message(
            name, self._store.value(name), spec.is_integer, self._index[name], len(self._names)
        )

    def _digest(self) -> int:
        specs = self._store.specs
        return digest((name, self._store.value(name), specs[name].is_integer) for name in self._names)

    def next_deadline(self) -> float | None:
        """Return the time of the next poll: −inf for at once, None for never."""
        if self._errors or self._answers:
            return -math.inf
        return self._next_step_s if self._changed or self._lists else None
