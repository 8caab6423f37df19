"""The ring of the F28377S port alone: counts of 16 bits that wrap, on a host whose int has 32."""

from __future__ import annotations

import ctypes
import random
from collections import deque
from typing import Any

import pytest

from tests.firmware.f28377s_support import built

WORDS = 65_536
UNTOUCHED = 0xABCD
START = 65_530


class RingFields(ctypes.Structure):
    """``fs_ring`` of fs_ring.h."""

    _fields_ = (
        ("written", ctypes.c_uint16),
        ("read", ctypes.c_uint16),
        ("size", ctypes.c_uint16),
        ("octets", ctypes.POINTER(ctypes.c_uint16)),
    )


class Ring:
    """A ring whose counts begin just below their wrap; behind its octets lie others that nobody may change."""

    def __init__(self, size: int) -> None:
        """Begin with an empty ring of so many octets."""
        self.c: Any = ctypes.CDLL(str(built()))
        for name in ("fs_ring_held", "fs_ring_room", "fs_ring_put", "fs_ring_take"):
            getattr(self.c, name).restype = ctypes.c_uint16
        self.octets = (ctypes.c_uint16 * WORDS)(*[UNTOUCHED] * WORDS)
        self.fields = RingFields()
        self.c.fs_ring_init(ctypes.byref(self.fields), self.octets, ctypes.c_uint16(size))
        assert (self.fields.written, self.fields.read, self.fields.size) == (0, 0, size)
        self.fields.written = self.fields.read = START

    def held(self) -> int:
        """Return how many octets it holds."""
        return int(self.c.fs_ring_held(ctypes.byref(self.fields)))

    def room(self) -> int:
        """Return how many more it has room for."""
        return int(self.c.fs_ring_room(ctypes.byref(self.fields)))

    def put(self, octet: int) -> int:
        """Put one octet; return 1, or 0 when the ring is full."""
        return int(self.c.fs_ring_put(ctypes.byref(self.fields), ctypes.c_uint16(octet)))

    def take(self) -> int | None:
        """Take the oldest octet; None when the ring is empty, which has to leave the place for it alone."""
        octet = ctypes.c_uint16(UNTOUCHED)
        if self.c.fs_ring_take(ctypes.byref(self.fields), ctypes.byref(octet)):
            return octet.value
        assert octet.value == UNTOUCHED
        return None


@pytest.mark.parametrize("size", [1, 2, 8, 512, 32_768])
def test_a_ring_is_filled_and_emptied_through_the_wrap_of_its_counts(size: int) -> None:
    """Full to its last place with the wrap between the two counts, and empty with both behind it."""
    ring = Ring(size)
    assert (ring.held(), ring.room(), ring.take()) == (0, size, None)
    for rounds in range(1, 9):
        octets = [(n * 7 + rounds) % 256 for n in range(size)]
        assert [ring.put(octet) for octet in octets] == [1] * size
        assert (ring.held(), ring.room(), ring.put(0x55)) == (size, 0, 0)
        assert ring.fields.written == (START + rounds * size) % WORDS
        assert [ring.take() for _ in octets] == octets
        assert (ring.held(), ring.room(), ring.take()) == (0, size, None)
        assert ring.fields.read == ring.fields.written
    assert set(ring.octets[size:]) == {UNTOUCHED}


@pytest.mark.parametrize("size", [4, 16])
def test_a_ring_is_a_queue_at_every_distance_from_the_wrap(size: int) -> None:
    """Beside a queue of Python's: 2000 random puts, with rubbish in the high bits, and takes, each judged."""
    rng = random.Random(size)
    for _ in range(10):
        ring, queue = Ring(size), deque[int]()
        for _ in range(200):
            if rng.random() < 0.55:
                octet = rng.randrange(65_536)
                assert ring.put(octet) == (len(queue) < size)
                if len(queue) < size:
                    queue.append(octet & 0xFF)
            else:
                assert ring.take() == (queue.popleft() if queue else None)
            assert (ring.held(), ring.room()) == (len(queue), size - len(queue))
        assert ring.fields.written < START  # it wrapped
