"""Which bytes of a file have not come yet: what both kinds of download count on."""

from __future__ import annotations

from collections.abc import Iterator

MAX_SIZE = 2**30
"""Bytes of the largest file that is fetched: whatever a vehicle says, memory is not without end."""


class Missing:
    """A file of known size that arrives in pieces, in any order and any number of times."""

    def __init__(self, size: int) -> None:
        self.content = bytearray(size)
        self._gaps: list[tuple[int, int]] = [(0, size)] if size else []  # begin, end; in order, apart
        self._left = size

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return len(self.content)

    @property
    def left(self) -> int:
        """Bytes that have not come."""
        return self._left

    @property
    def first(self) -> int:
        """Where the first gap begins; the size of the file if there is none."""
        return self._gaps[0][0] if self._gaps else self.size

    def fill(self, offset: int, data: bytes) -> int:
        """Take a piece; return how many of its bytes were missing. Bytes beyond the end are dropped."""
        end = min(offset + len(data), self.size)
        if offset >= end:
            return 0
        before, touched, after = self._split(offset, end)
        if not touched:
            return 0
        self.content[offset:end] = data[: end - offset]
        kept = [(touched[0][0], offset), (end, touched[-1][1])]
        filled = sum(min(stop, end) - max(start, offset) for start, stop in touched)
        self._gaps = [*before, *((start, stop) for start, stop in kept if start < stop), *after]
        self._left -= filled
        return filled

    def _split(
        self, begin: int, end: int
    ) -> tuple[list[tuple[int, int]], list[tuple[int, int]], list[tuple[int, int]]]:
        """Return the gaps before, those that have bytes in [begin, end), and those after."""
        first = next((i for i, gap in enumerate(self._gaps) if gap[1] > begin), len(self._gaps))
        last = next((i for i in range(first, len(self._gaps)) if self._gaps[i][0] >= end), len(self._gaps))
        return self._gaps[:first], self._gaps[first:last], self._gaps[last:]

    def within(self, begin: int, end: int) -> int:
        """Return how many bytes of [begin, end) are missing."""
        total = 0
        for start, stop in self._gaps:
            if start >= end:
                break
            total += max(0, min(stop, end) - max(start, begin))
        return total

    def pieces(self, size: int) -> Iterator[tuple[int, int]]:
        """Yield (offset, count) of what is missing, in order and in pieces of ``size`` at most."""
        for start, stop in self._gaps:
            for offset in range(start, stop, size):
                yield offset, min(size, stop - offset)
