"""Segments and symbols of an ELF file for 32-bit ARM or RISC-V."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence

_EXECUTABLE, _ARM, _RISCV = 2, 40, 243
_LOAD_SEGMENT, _SYMBOL_TABLE = 1, 2
_SYMBOL_SIZE = 16


class ElfError(ValueError):
    """The data is not an executable for 32-bit ARM or RISC-V, or is damaged."""


class Elf:
    """An executable: ``segments`` as (address, bytes) and ``symbols`` by name."""

    def __init__(self, data: bytes) -> None:
        """Read ``data``, the content of the file; raise ElfError."""
        if data[:6] != b"\x7fELF\x01\x01":
            raise ElfError("not a 32-bit little-endian ELF file")
        try:
            kind, machine = struct.unpack_from("<HH", data, 16)
            if kind != _EXECUTABLE or machine not in (_ARM, _RISCV):
                raise ElfError("not an executable for ARM or RISC-V")
            self.segments = tuple(_segments(data))
            self.symbols = dict(_symbols(data))
        except (struct.error, IndexError, ValueError) as error:
            raise ElfError(str(error)) from error


def _headers(data: bytes, place: int, sizes: int, words: int) -> Sequence[tuple[int, ...]]:
    """Return a table of headers, with its offset at ``place`` and entry size and count at ``sizes``."""
    (start,) = struct.unpack_from("<I", data, place)
    size, count = struct.unpack_from("<HH", data, sizes)
    return [struct.unpack_from(f"<{words}I", data, start + size * index) for index in range(count)]


def _segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    # program header: type, offset, virtual address, physical address, size in the file
    for kind, offset, _, address, size in _headers(data, 28, 42, 5):
        if kind == _LOAD_SEGMENT and size:
            yield address, data[offset : offset + size]


def _symbols(data: bytes) -> Iterator[tuple[str, int]]:
    # section header: name, type, flags, address, offset, size, link (here: the section of the names)
    sections = _headers(data, 32, 46, 7)
    for section in sections:
        if section[1] != _SYMBOL_TABLE:
            continue
        names = sections[section[6]][4]
        for at in range(section[4], section[4] + section[5], _SYMBOL_SIZE):
            name, value = struct.unpack_from("<II", data, at)
            end = data.index(b"\0", names + name)
            yield data[names + name : end].decode("ascii"), value
