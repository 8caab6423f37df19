"""Names of built-in files and paths of a user's: ``x_quad`` is the built-in one, ``./x_quad`` a file."""

from __future__ import annotations

import os
from pathlib import Path

from flightstack.core.errors import ConfigError


def find_file(name_or_path: str, folder: Path, kind: str) -> Path:
    """Return the TOML file of a name or a path; raise ConfigError for a name that ``folder`` does not have.

    A path has a separator or a suffix. A plain name is that of a built-in file, whatever lies in the working
    directory. ``kind`` says what is looked for, for example "a built-in vehicle".
    """
    if not _is_name(name_or_path):
        return Path(name_or_path)
    known = built_in_names(folder)
    if name_or_path in known:
        return folder / f"{name_or_path}.toml"
    names = ", ".join(known)
    if Path(name_or_path).is_file():
        problem = f"is not {kind} ({names}); for the file of this name give ./{name_or_path}"
    else:
        problem = f"is neither a file nor {kind} ({names})"
    raise ConfigError(name_or_path, "", problem)


def built_in_names(folder: Path) -> list[str]:
    """Return the names of the built-in files in ``folder``."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def hidden_file(name_or_path: str, kind: str) -> str | None:
    """Return what to tell a user whose working directory has a file with the name of a built-in one, or None."""
    if not _is_name(name_or_path) or not Path(name_or_path).is_file():
        return None
    return f"{name_or_path} is taken as {kind}; for the file of this name give ./{name_or_path}"


def _is_name(name_or_path: str) -> bool:
    return os.sep not in name_or_path and not Path(name_or_path).suffix
