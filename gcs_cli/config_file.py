"""The user's settings in ``config.toml``: link, timeout, system id and signing key."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.core.errors import ConfigError

_VARIABLE = "GCS_CONFIG"
LONGEST_TIMEOUT_S = 86_400.0
SHORTEST_TIMEOUT_S = 0.1
LARGEST_SYSTEM_ID = 255


class Config(NamedTuple):
    """Settings of the file; None where not given."""

    connect: str | None = None
    timeout: float | None = None
    system: int | None = None
    signing_key: Path | None = None


def config_path() -> tuple[Path, bool]:
    """Return the path of the file, and True if the user named it in ``GCS_CONFIG``."""
    named = os.environ.get(_VARIABLE)
    if named:
        return Path(named).expanduser(), True
    base = os.environ.get("XDG_CONFIG_HOME") or "~/.config"
    return Path(base).expanduser() / "gcs" / "config.toml", False


def load_config() -> Config:
    """Read the file; raise ConfigError. Without a file, nothing is set."""
    path, is_named = config_path()
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        if is_named:
            raise ConfigError(path, "", f"cannot be read: no such file; {_VARIABLE} names it") from None
        return Config()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "is no UTF-8 text"
        raise ConfigError(path, "", f"cannot be read: {reason}") from None
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(path, "", f"is no TOML: {error}") from None
    return _checked(path, values)


def _checked(path: Path, values: dict[str, Any]) -> Config:
    for key in values:
        if key not in Config._fields:
            raise ConfigError(path, key, f"is no setting; settings are {', '.join(Config._fields)}")
    for key in ("connect", "signing_key"):
        if not isinstance(values.get(key, ""), str):
            raise ConfigError(path, key, f"{values[key]!r} is not a text in quotes")
    timeout, system = values.get("timeout"), values.get("system")
    if timeout is not None and not (
        _is_number(timeout) and SHORTEST_TIMEOUT_S <= timeout <= LONGEST_TIMEOUT_S
    ):
        raise ConfigError(
            path,
            "timeout",
            f"{timeout!r} is not a number from {SHORTEST_TIMEOUT_S:g} to {LONGEST_TIMEOUT_S:g} s",
        )
    if system is not None and not (_is_number(system) and system in range(1, LARGEST_SYSTEM_ID + 1)):
        raise ConfigError(path, "system", f"{system!r} is not a system id, 1 to {LARGEST_SYSTEM_ID}")
    key_file = values.get("signing_key")
    signing_key = None if key_file is None else path.parent / Path(key_file).expanduser()
    return Config(values.get("connect"), timeout, system, signing_key)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
