"""Gains files: one TOML with a table for each loop, by name (``tuned``, ``paper``) or by path."""

from __future__ import annotations

from pathlib import Path

from flightstack.params.errors import ConfigError
from flightstack.params.toml_reader import Table, read_toml

BUILT_IN = Path(__file__).parent / "gains"
DEFAULT_GAINS = "tuned"
LOOP_TABLES = ("position", "altitude", "attitude_reference")
CONTROLLER_PREFIX = "attitude_"
"""What the names of the controllers' tables begin with; those of other controllers are left alone."""


def built_in_gains() -> list[str]:
    """Return the names of the gains that come with the package."""
    return sorted(path.stem for path in BUILT_IN.glob("*.toml"))


def open_gains(name_or_path: str) -> Table:
    """Open a gains file by the name of a built-in one or by path; raise ConfigError."""
    path = Path(name_or_path)
    if not path.suffix and not path.is_file():  # a directory of that name is in nobody's way
        if name_or_path not in built_in_gains():
            known = ", ".join(built_in_gains())
            raise ConfigError(name_or_path, "", f"is neither a file nor built-in gains ({known})")
        path = BUILT_IN / f"{name_or_path}.toml"
    gains = read_toml(path)
    gains.expect(*LOOP_TABLES, "description", prefix=CONTROLLER_PREFIX)
    return gains
