"""The signing key and the timestamp of its last use, in two files that only their owner may read."""

from __future__ import annotations

import os
import secrets
import stat
import time
from pathlib import Path

from flightstack.atomic_file import OWNER_ONLY, write_bytes_atomically
from flightstack.console import complain
from flightstack.mavlink.signing import KEY_SIZE, LARGEST_TIMESTAMP, Signing
from flightstack.params.errors import ConfigError

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_LONGEST_FILE = 200  # a key in hexadecimal takes 64 characters


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
    """Return signing with the key at ``path``; raise ConfigError.

    ``role`` tells the processes apart that use one key file: each keeps its timestamp in a file of its own.
    """
    key = load_key(path)
    timestamps = path.with_name(f"{path.name}.{role}.timestamp")
    first = _load_timestamp(timestamps)
    try:
        _write_timestamp(timestamps, first)  # to fail now, and not in flight
    except OSError as error:
        raise _problem(timestamps, error) from None
    return Signing(key, time.time, first, _Reserve(timestamps), allow_unsigned)


class _Reserve:
    """Writes the timestamp file. A full disk must not end a flight: it is told once, and the flight goes on."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._has_failed = False

    def __call__(self, limit: int) -> None:
        try:
            _write_timestamp(self._path, limit)
        except OSError as error:
            if not self._has_failed:
                self._has_failed = True
                complain(f"{_problem(self._path, error)}: after a crash, wait a minute")


def _write_timestamp(path: Path, timestamp: int) -> None:
    """Replace the file. It is not forced to the disk: a power cut sets the clock forward anyway."""
    write_bytes_atomically(path, f"{timestamp}\n".encode(), OWNER_ONLY, survives_power_loss=False)


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
