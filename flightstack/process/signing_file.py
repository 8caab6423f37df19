"""The signing key and the timestamp of its last use, in two files that only their owner may read."""

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
"""Drawn from at random. Other programs number their links from 0, often with the system and component id of ``gcs``."""
_TIMESTAMP_LOCK = 256
"""The octet of the lock file that is held while the timestamp is written; the one at n is that of link id n."""


def create_key(path: Path) -> bytes:
    """Make a new key, write it to ``path``, which must not exist, and return it; raise ConfigError."""
    key = secrets.token_bytes(KEY_SIZE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(key.hex() + "\n")
        except OSError:
            path.unlink(missing_ok=True)  # half a key would end every later start
            raise
    except OSError as error:
        raise _problem(path, error) from None
    return key


def load_key(path: Path) -> bytes:
    """Read a key of 32 octets, raw or in hexadecimal; raise ConfigError, also when others may read it."""
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_LONGEST_FILE)
    except OSError as error:
        raise _problem(path, error) from None
    if mode & _OTHERS:
        raise ConfigError(path, "", f"others may read this key: make it yours with `chmod 600 {path}`")
    if len(data) == KEY_SIZE:
        return data
    try:
        key = bytes.fromhex(data.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY_SIZE:
        raise ConfigError(
            path, "", f"a signing key is {KEY_SIZE} octets, or {2 * KEY_SIZE} hexadecimal digits"
        )
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
    """Return signing with the key at ``path``, for one of many processes of a ``role``; raise ConfigError.

    Each has a link id of its own while it runs, as timestamps have to rise on each stream (system, component,
    link id). The id is random, so that programs on other machines with the same key seldom have it too.
    """
    key, kept = load_key(path), _TimestampFile(path, role, is_shared=True)
    return LinkSigning(Signing(key, time.time, kept.open(), kept.keep), kept.claim_link_id())


class _TimestampFile:
    """The latest timestamp that any process of a role has used: it never goes back.

    A full disk does not end a flight: it is reported once.
    """

    def __init__(self, key_path: Path, role: str, is_shared: bool = False) -> None:
        self._path = key_path.with_name(f"{key_path.name}.{role}.timestamp")
        self._lock_path = key_path.with_name(f"{key_path.name}.{role}.lock") if is_shared else None
        self._lock: int | None = None  # it stays open: the end of the process frees what it has locked
        self._has_failed = False

    def open(self) -> int:
        """Return the timestamp kept last, and make sure that another one can be kept; raise ConfigError."""
        latest = _load_timestamp(self._path)
        try:
            if self._lock_path is not None:
                self._lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, OWNER_ONLY)
            self._write(latest)
        except OSError as error:
            raise _problem(self._path, error) from None
        return latest

    def keep(self, timestamp: int) -> None:
        """Keep ``timestamp``, unless another process has kept a later one."""
        try:
            self._write(timestamp)
        except (OSError, ConfigError) as error:
            if not self._has_failed:
                self._has_failed = True
                reason = _problem(self._path, error) if isinstance(error, OSError) else error
                complain(f"{reason}: after a crash, signed messages may be refused for a minute")

    def claim_link_id(self) -> int:
        """Return a link id that no other process of the role has claimed; any one if there is none left."""
        assert self._lock is not None
        first = secrets.randbelow(len(_LINK_IDS))
        link_ids: list[int] = [*_LINK_IDS[first:], *_LINK_IDS[:first]]
        for link_id in link_ids:
            with contextlib.suppress(OSError):  # another process has locked this octet of the file
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
        """Write the file anew. It is not forced to the disk: a power cut sets the clock forward anyway."""
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
            path, "", "is no timestamp: remove it if no frame of the last minute can have been heard"
        )
    return int(text)


def _problem(path: Path, error: OSError) -> ConfigError:
    return ConfigError(path, "", error.strerror or str(error))
