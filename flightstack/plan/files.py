"""Read plan files, and write them atomically."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError, WriteError
from flightstack.plan.item import Plan
from flightstack.plan.qgc_plan import plan_to_json, read_plan
from flightstack.plan.waypoints import WAYPOINTS_HEADER, plan_to_waypoints, read_waypoints

MAX_FILE_BYTES = 50_000_000
PLAN_SUFFIXES = (".plan", ".json")
WAYPOINTS_SUFFIXES = (".waypoints", ".txt", ".mission")


def load_plan(path: str | Path) -> Plan:
    """Read a QGC ``.plan`` or a ``QGC WPL 110`` file, recognised by its content.

    Raise ConfigError with file, item, field, value and allowed range.
    """
    path = Path(path)
    return plan_of_text(read_text(path), path)


def read_text(path: Path) -> str:
    """Return the text of a plan file; raise ConfigError if it cannot be read, is too large or is not text."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        problem = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(path, "", f"cannot be read: {problem}") from None
    if len(data) > MAX_FILE_BYTES:
        raise ConfigError(path, "", f"is larger than the allowed {MAX_FILE_BYTES // 1_000_000} MB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(path, "", "is not a plan file: it is not text") from error


def plan_of_text(
    text: str, path: Path, formats: Sequence[str] = (*PLAN_SUFFIXES, *WAYPOINTS_SUFFIXES)
) -> Plan:
    """Parse the text of a ``.plan`` or ``QGC WPL 110`` file; raise ConfigError, which names the ``formats``."""
    if text.startswith("QGC WPL"):
        return read_waypoints(text, path)
    if path.suffix in WAYPOINTS_SUFFIXES:
        raise ConfigError(path, "line 1", f"must be {WAYPOINTS_HEADER!r}")
    if path.suffix not in PLAN_SUFFIXES and not text.lstrip().startswith("{"):
        raise ConfigError(path, "", f"is not a plan file: the formats are {', '.join(formats)}")
    return read_plan(text, path)


def save_plan(path: str | Path, plan: Plan) -> None:
    """Write ``plan`` atomically, in the format of the file's suffix.

    Raise ConfigError for an unknown suffix or a plan that the format cannot represent, WriteError for the file.
    """
    path = Path(path)
    if path.suffix in PLAN_SUFFIXES:
        text = plan_to_json(plan)
    elif path.suffix in WAYPOINTS_SUFFIXES:
        text = plan_to_waypoints(plan, path)
    else:
        allowed = ", ".join(PLAN_SUFFIXES + WAYPOINTS_SUFFIXES)
        raise ConfigError(path, "", f"the suffix {path.suffix!r} must be one of {allowed}")
    try:
        write_text_atomically(path, text)
    except (OSError, ValueError) as error:
        problem = error.strerror if isinstance(error, OSError) else error
        raise WriteError(path, "", f"cannot be written: {problem}") from error
