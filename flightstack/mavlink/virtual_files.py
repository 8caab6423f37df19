"""The files that a vehicle shows over MAVLink FTP: read only, made up or on a disk, behind one protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, TypeAlias


class Entry(NamedTuple):
    """A file or directory in a directory."""

    name: str
    size: int | None
    """Bytes; None for a directory."""


class VirtualFile(Protocol):
    """An open file. Its size is fixed when it is opened."""

    @property
    def size(self) -> int:
        """Bytes in the file."""
        ...

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``; less only at the end. Raise OSError."""
        ...

    def close(self) -> None:
        """Give the file back."""
        ...


class VirtualFiles(Protocol):
    """A tree of directories and files. Paths are relative to its root: ``"a/b"``; ``""`` is the root."""

    def list(self, path: str) -> list[Entry] | None:
        """Return what is in the directory ``path``, always in the same order; None if there is none."""
        ...

    def open(self, path: str) -> VirtualFile | None:
        """Open the file at ``path``; None if there is none. Raise OSError when it cannot be read."""
        ...


Content: TypeAlias = Callable[[str], bytes | None]
"""Makes a file's bytes when it is opened, from what follows "?" in its path; None: no such file."""


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
        """Do nothing: there is nothing to give back."""


def fixed(content: bytes) -> Content:
    """Return the content of a file that never changes, and takes no arguments."""
    return lambda arguments: None if arguments else content


def clean_path(path: str) -> str | None:
    """Return ``path`` without empty parts and leading slash; None when it holds "." or ".." as a part."""
    parts = [part for part in path.split("/") if part]
    return None if any(part in (".", "..") for part in parts) else "/".join(parts)


class FileTree:
    """Joins single files and whole trees to one tree, like a table of mounts.

    ``files`` maps paths to contents, ``mounts`` directories to trees; all paths as ``clean_path`` gives them.
    """

    def __init__(self, files: Mapping[str, Content], mounts: Mapping[str, VirtualFiles]) -> None:
        self._files = dict(files)
        self._mounts = dict(mounts)

    def list(self, path: str) -> list[Entry] | None:
        """Return what is in the directory ``path``; None if there is none."""
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
        """Open the file at ``path``, which may end in "?" and arguments; None if there is none."""
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
