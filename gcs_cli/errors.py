"""Exit codes of ``gcs``, and the error that carries one."""

from __future__ import annotations

DONE = 0
FAILED = 1
"""The vehicle refused, the mission failed, or a peer was lost."""
USAGE = 2
"""Wrong flag, bad file, busy port."""
NO_ANSWER = 3
"""No vehicle, or no answer in time."""
INTERRUPTED = 130
"""``gcs test`` after Ctrl-C: the exit code of a shell for a command that SIGINT ended."""


class CliError(Exception):
    """One sentence for the user, and the exit code that goes with it."""

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
