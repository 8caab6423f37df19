"""Exit codes of ``gcs``, the errors that carry one, and libraries that may be missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

DONE = 0
FAILED = 1
"""The vehicle refused, the mission failed, or a peer was lost."""
USAGE = 2
"""Wrong flag, bad file, busy port."""
NO_ANSWER = 3
"""No vehicle, or no answer in time."""
INTERRUPTED = 130
"""Ctrl-C or SIGTERM: the exit code of a shell for a command that SIGINT ended."""

_PACKAGES = {"rerun": "rerun-sdk"}


class CliError(Exception):
    """One sentence for the user, empty if it was printed, and the exit code that goes with it."""

    def __init__(self, sentence: str, exit_code: int = FAILED) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


class VehicleLostError(CliError):
    """The vehicle shut down or was lost during a request."""


class PortInUseError(CliError):
    """Another program listens on ``port``, named with its address."""

    def __init__(self, port: object, sentence: str) -> None:
        super().__init__(sentence, USAGE)
        self.port = port


def library(module: str, user: str = "this format", extra: str = "export") -> Any:
    """Return a module that ``user`` needs; raise CliError (usage) if it is not installed."""
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        package = _PACKAGES.get(name, name)
        raise CliError(f"{user} needs {package}: pip install 'flightstack[{extra}]'", USAGE) from None
