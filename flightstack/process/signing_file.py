"""Signing key and latest timestamp, in two files readable by their owner only."""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import stat
import time
from pathlib import Path

from flightstack.core.atomic_file import OWNER_ONLY, write_bytes_atomically
from flightstack.core.errors import ConfigError
from flightstack.mavlink.signing import KEY_SIZE, LARGEST_TIMESTAMP, LinkSigning, Signing
from flightstack.process.console import complain

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_LONGEST_FILE = 200  # a key in hexadecimal takes 64 characters
_LINK_IDS = range(16, 256)
"""Random link ids; other programs number links from 0, often with the system and component id of ``gcs``."""
_TIMESTAMP_LOCK = 256
"""Byte of the lock file that is locked while the timestamp is written; byte n is the lock of link id n."""


def create_key(path: Path) -> bytes:
    """Create a key in the new file ``path`` and return it; raise ConfigError."""
    key = secrets.token_bytes(KEY_SIZE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(key.hex() + "\n")
        except OSError:
            path.unlink(missing_ok=True)  # a partial key would fail every later start
            raise
    except OSError as error:
        raise _problem(path, error) from None
    return key


def load_key(path: Path) -> bytes:
    """Read a key of 32 bytes, raw or hexadecimal; raise ConfigError, also if other users may read the file."""
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_LONGEST_FILE)
    except OSError as error:
        raise _problem(path, error) from None
    if mode & _OTHERS:
        raise ConfigError(path, "", f"is readable by other users: run `chmod 600 {path}`")
    if len(data) == KEY_SIZE:
        return data
    try:
        key = bytes.fromhex(data.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY_SIZE:
        raise ConfigError(path, "", f"a signing key is {KEY_SIZE} bytes or {2 * KEY_SIZE} hexadecimal digits")
    return key


def replace_key(path: Path, key: bytes) -> None:
    """Write another key in place of the one there; raise OSError, and the old one stays."""
    write_bytes_atomically(path, f"{key.hex()}\n".encode(), OWNER_ONLY)


def open_signing(path: Path, role: str, allow_unsigned: bool = False) -> Signing:
    """Return signing with the key at ``path``, for the only process of its ``role``; raise ConfigError.

    The latest timestamp of a role is kept beside the key.
    """
    key, kept = load_key(path), _TimestampFile(path, role)
    return Signing(key, time.time, kept.open(), kept.keep, allow_unsigned)


def open_shared_signing(path: Path, role: str) -> LinkSigning:
    """Return signing with the key at ``path``, for one of several processes of a ``role``; raise ConfigError.

    Each process has its own link id, because timestamps must increase on each stream (system, component, link id). The
    id is random to avoid collisions with programs on other machines with the same key.
    """
    key, kept = load_key(path), _TimestampFile(path, role, is_shared=True)
    return LinkSigning(Signing(key, time.time, kept.open(), kept.keep), kept.claim_link_id())


class _TimestampFile:
    """Latest timestamp used by any process of a role; it never decreases. Write errors are reported once."""

    def __init__(self, key_path: Path, role: str, is_shared: bool = False) -> None:
        self._path = key_path.with_name(f"{key_path.name}.{role}.timestamp")
        self._lock_path = key_path.with_name(f"{key_path.name}.{role}.lock") if is_shared else None
        self._lock: int | None = None  # stays open: locks end with the process
        self._has_failed = False

    def open(self) -> int:
        """Return the saved timestamp and check that the file is writable; raise ConfigError."""
        latest = _load_timestamp(self._path)
        try:
            if self._lock_path is not None:
                self._lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, OWNER_ONLY)
            self._write(latest)
        except OSError as error:
            raise _problem(self._path, error) from None
        return latest

    def keep(self, timestamp: int) -> None:
        """Save ``timestamp`` unless another process has saved a later one."""
        try:
            self._write(timestamp)
        except (OSError, ConfigError) as error:
            if not self._has_failed:
                self._has_failed = True
                reason = _problem(self._path, error) if isinstance(error, OSError) else error
                complain(f"{reason}: after a crash, signed messages may be refused for a minute")

    def claim_link_id(self) -> int:
        """Return a link id that no other process of the role uses, or any if all are used."""
        assert self._lock is not None
        first = secrets.randbelow(len(_LINK_IDS))
        link_ids: list[int] = [*_LINK_IDS[first:], *_LINK_IDS[:first]]
        for link_id in link_ids:
            with contextlib.suppress(OSError):  # locked by another process
                fcntl.lockf(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, link_id)
                return link_id
        return link_ids[0]

    def _write(self, timestamp: int) -> None:
        if self._lock is None:
            self._replace(timestamp)
            return
        fcntl.lockf(self._lock, fcntl.LOCK_EX, 1, _TIMESTAMP_LOCK)
        try:
            self._replace(max(timestamp, _load_timestamp(self._path)))
        finally:
            fcntl.lockf(self._lock, fcntl.LOCK_UN, 1, _TIMESTAMP_LOCK)

    def _replace(self, timestamp: int) -> None:
        """Replace the file without syncing: after a power loss the clock is later anyway."""
        write_bytes_atomically(self._path, f"{timestamp}\n".encode(), OWNER_ONLY, survives_power_loss=False)


def _load_timestamp(path: Path) -> int:
    try:
        text = path.read_text(encoding="ascii").strip()
    except FileNotFoundError:
        return 0
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(path, "", f"cannot be read: {error}") from None
    if not (text.isdigit() and len(text) <= 15 and int(text) <= LARGEST_TIMESTAMP):
        raise ConfigError(
            path, "", "is not a timestamp: remove it if no frame was sent within the last minute"
        )
    return int(text)


def _problem(path: Path, error: OSError) -> ConfigError:
    return ConfigError(path, "", error.strerror or str(error))
