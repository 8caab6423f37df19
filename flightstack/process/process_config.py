"""Configuration, exit codes and messages of the process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flightstack.process import console
from flightstack.transports.vehicle_ports import PortsConfig

EXIT_OK, EXIT_LOST, EXIT_USAGE, EXIT_TIMEOUT = range(4)


@dataclass(frozen=True)
class ProcessConfig:
    """Configuration of the process; that of the flight is ``StackConfig``."""

    simulator_host: str
    simulator_port: int
    simulator_timeout_s: float
    ports: PortsConfig
    log: Path | None
    wait_for_start: bool
    exit_on_ground_loss_s: float | None
    signing_key: Path | None = None
    """Key file of MAVLink signing; None for no signing."""
    allow_unsigned: bool = False
    overwrite_log: bool = False
    state: Path | None = None
    """State directory; None to save no plans."""


class Ended(Exception):  # noqa: N818  # not an error: leaves the main loop
    """Ends the process with an exit code and a message."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


class RebootRequestedError(Exception):
    """A ground station has requested a reboot."""


def complain(sentence: object) -> None:
    """Print a message to stderr; a closed stderr does not end the flight."""
    console.complain(f"flightstack: {sentence}")
