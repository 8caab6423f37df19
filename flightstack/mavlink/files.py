"""Files in transfer: read-only files that a vehicle offers over MAVLink FTP, and files received in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol, TypeAlias


class Entry(NamedTuple):
    """A file or directory in a directory."""

    name: str
    size: int | None
    """Bytes; None for a directory."""


class VirtualFile(Protocol):
    """An open file; its size is fixed at opening."""

    @property
    def size(self) -> int:
        """Bytes in the file."""
        ...

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``; less only at the end. Raise OSError."""
        ...

    def close(self) -> None:
        """Close the file."""
        ...


class VirtualFiles(Protocol):
    """A tree of directories and files. Paths are relative to its root: ``"a/b"``; ``""`` is the root."""

    def list(self, path: str) -> list[Entry] | None:
        """Return the entries of the directory ``path`` in a stable order; None if it does not exist."""
        ...

    def open(self, path: str) -> VirtualFile | None:
        """Open the file at ``path``; return None if it does not exist. Raise OSError."""
        ...


Content: TypeAlias = Callable[[str], bytes | None]
"""Returns the bytes of a file at opening, given the arguments after "?" in its path; None for no such file."""


class BytesFile:
    """A file in memory."""

    def __init__(self, content: bytes) -> None:
        self._content = content

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return len(self._content)

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``."""
        return self._content[offset : offset + count]

    def close(self) -> None:
        """Do nothing."""


def fixed(content: bytes) -> Content:
    """Return the ``Content`` of a constant file without arguments."""
    return lambda arguments: None if arguments else content


def clean_path(path: str) -> str | None:
    """Return ``path`` without empty parts and leading slash; None if a part is "." or ".."."""
    parts = [part for part in path.split("/") if part]
    return None if any(part in (".", "..") for part in parts) else "/".join(parts)


class FileTree:
    """Combines single files and mounted trees into one tree.

    ``files`` maps paths to contents, ``mounts`` maps directories to trees; paths have the form of ``clean_path``.
    """

    def __init__(self, files: Mapping[str, Content], mounts: Mapping[str, VirtualFiles]) -> None:
        self._files = dict(files)
        self._mounts = dict(mounts)

    def list(self, path: str) -> list[Entry] | None:
        """Return the entries of the directory ``path``; None if it does not exist."""
        cleaned = clean_path(path)
        if cleaned is None:
            return None
        tree = self._mounted(cleaned)
        if tree is not None:
            return tree[0].list(tree[1])
        prefix = f"{cleaned}/" if cleaned else ""
        below = [name[len(prefix) :] for name in (*self._mounts, *self._files) if name.startswith(prefix)]
        if not below and cleaned:
            return None
        directories = sorted({name.split("/")[0] for name in below if self._is_directory(prefix, name)})
        contents = {name: self._files[prefix + name]("") for name in sorted(below) if "/" not in name
                    and prefix + name in self._files}  # fmt: skip
        return [Entry(name, None) for name in directories] + [
            Entry(name, len(content)) for name, content in contents.items() if content is not None
        ]

    def open(self, path: str) -> VirtualFile | None:
        """Open the file at ``path``, which may end in "?" and arguments; return None if it does not exist."""
        name, _, arguments = path.partition("?")
        cleaned = clean_path(name)
        if cleaned is None:
            return None
        tree = self._mounted(cleaned)
        if tree is not None:
            return None if arguments else tree[0].open(tree[1])
        make = self._files.get(cleaned)
        content = None if make is None else make(arguments)
        return None if content is None else BytesFile(content)

    def _is_directory(self, prefix: str, name: str) -> bool:
        return "/" in name or prefix + name in self._mounts

    def _mounted(self, path: str) -> tuple[VirtualFiles, str] | None:
        for mount, tree in self._mounts.items():
            if path == mount:
                return tree, ""
            if path.startswith(f"{mount}/"):
                return tree, path[len(mount) + 1 :]
        return None


MAX_SIZE = 2**30
"""Largest file that is downloaded; bounds memory whatever size the vehicle reports."""


class PartialFile:
    """A file of known size received in pieces, in any order and with repetitions."""

    def __init__(self, size: int) -> None:
        self.content = bytearray(size)
        self._gaps: list[tuple[int, int]] = [(0, size)] if size else []  # [begin, end), sorted and disjoint
        self._left = size

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return len(self.content)

    @property
    def left(self) -> int:
        """Missing bytes."""
        return self._left

    @property
    def first(self) -> int:
        """Offset of the first gap; the size of a complete file."""
        return self._gaps[0][0] if self._gaps else self.size

    def fill(self, offset: int, data: bytes) -> int:
        """Store a piece; return how many of its bytes were missing. Bytes beyond the end are dropped."""
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
        """Return the gaps before, overlapping, and after [begin, end)."""
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
        """Yield (offset, count) of the missing bytes in order, in pieces of at most ``size``."""
        for start, stop in self._gaps:
            for offset in range(start, stop, size):
                yield offset, min(size, stop - offset)
