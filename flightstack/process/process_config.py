"""What concerns the process and not the flight: its configuration, how it ends, and what it says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flightstack.process import console
from flightstack.transports.vehicle_ports import PortsConfig

EXIT_OK, EXIT_LOST, EXIT_USAGE, EXIT_TIMEOUT = range(4)


@dataclass(frozen=True)
class ProcessConfig:
    """What concerns the process and not the flight."""

    simulator_host: str
    simulator_port: int
    simulator_timeout_s: float
    ports: PortsConfig
    log: Path | None
    wait_for_start: bool
    exit_on_ground_loss_s: float | None
    signing_key: Path | None = None
    """File of the key that signs MAVLink; None: nothing is signed."""
    allow_unsigned: bool = False
    overwrite_log: bool = False
    state: Path | None = None
    """Directory of what the vehicle keeps; None: it keeps nothing but, maybe, parameters."""


class Ended(Exception):  # noqa: N818  # not an error: the way out of the loops
    """The process ends, with this exit code and sentence."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


class RebootRequestedError(Exception):
    """A ground station wants the vehicle to start anew."""


def complain(sentence: object) -> None:
    """Say a sentence on stderr, where it is seen at once; a closed stderr does not end the flight."""
    console.complain(f"flightstack: {sentence}")
