"""Gains files: TOML with a table per loop, by name (``tuned``, ``paper``) or path."""

from __future__ import annotations

from pathlib import Path

from flightstack.params.toml_file import Table, built_in_names, find_file, hidden_file, read_toml

BUILT_IN = Path(__file__).parent / "gains"
DEFAULT_GAINS = "tuned"
KIND = "built-in gains"
LOOP_TABLES = ("position", "altitude", "attitude_reference")
LAW_PREFIXES = ("guidance_", "position_", "attitude_", "mixer_")
"""Prefixes of the laws' tables, by role; tables of other laws are ignored."""


def built_in_gains() -> list[str]:
    """Return the names of the gains that come with the package."""
    return built_in_names(BUILT_IN)


def hidden_gains(name_or_path: str) -> str | None:
    """Return a warning if a built-in name hides a file in the working directory, or None."""
    return hidden_file(name_or_path, KIND)


def open_gains(name_or_path: str) -> Table:
    """Open a gains file by the name of a built-in one or by path; raise ConfigError."""
    gains = read_toml(find_file(name_or_path, BUILT_IN, KIND))
    gains.expect(*LOOP_TABLES, "description", prefix=LAW_PREFIXES)
    return gains
