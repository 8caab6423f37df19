"""How our programs start one another."""

from __future__ import annotations

import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


def own_program(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of this installation.

    Python looks for modules in the working directory first, where a folder of the same name would be run instead; so
    it must not, unless this installation is there.
    """
    safe = [] if Path.cwd() == _ROOT else ["-P"]
    return [sys.executable, *safe, "-m", module, *arguments]
