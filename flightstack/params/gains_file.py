"""Gains files: one TOML with a table for each loop, by name (``tuned``, ``paper``) or by path."""

from __future__ import annotations

from pathlib import Path

from flightstack.params.toml_file import Table, built_in_names, find_file, hidden_file, read_toml

BUILT_IN = Path(__file__).parent / "gains"
DEFAULT_GAINS = "tuned"
KIND = "built-in gains"
LOOP_TABLES = ("position", "altitude", "attitude_reference")
CONTROLLER_PREFIX = "attitude_"
"""What the names of the controllers' tables begin with; those of other controllers are left alone."""


def built_in_gains() -> list[str]:
    """Return the names of the gains that come with the package."""
    return built_in_names(BUILT_IN)


def hidden_gains(name_or_path: str) -> str | None:
    """Return the sentence for a file in the working directory that a built-in name hides, or None."""
    return hidden_file(name_or_path, KIND)


def open_gains(name_or_path: str) -> Table:
    """Open a gains file by the name of a built-in one or by path; raise ConfigError."""
    gains = read_toml(find_file(name_or_path, BUILT_IN, KIND))
    gains.expect(*LOOP_TABLES, "description", prefix=CONTROLLER_PREFIX)
    return gains
