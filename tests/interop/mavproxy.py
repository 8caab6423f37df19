"""MAVProxy without a screen, as a process that is told commands and whose own words are read."""

from __future__ import annotations

import re
from pathlib import Path

from tests.interop.needs import needs
from tests.interop.stack import RealVehicle
from tests.support.process import Process

needs("MAVProxy", "MAVProxy")

EXIT_CODE = 1
"""What MAVProxy ends with, however well it went."""
COMPLAINTS = (
    "fence breach",
    "no link",
    "link 1 down",
    "heartbeat lost",
    "timed out",
    "BUG!",
    "Exception",
    "ERROR in",
)
"""What it says when something is wrong with the vehicle, the link, or in itself."""


class MavProxy:
    """MAVProxy on one link, with the modules it loads by itself."""

    def __init__(self, vehicle: RealVehicle, master: str, directory: Path, *options: str) -> None:
        """Start it on ``master`` ("tcp:HOST:PORT", "udpin:HOST:PORT") and wait until it has seen the vehicle."""
        self.vehicle = vehicle
        self._lines: int | None = None  # that it had said when it was to end
        self._process = Process(
            "MAVProxy.mavproxy", "--master", master, "--state-basedir", str(directory), *options, listens=True
        )
        self.until(f"online system {1 + vehicle.instance}")

    def until(self, *texts: str) -> None:
        """Wait until it has said each of ``texts``, in this order."""
        for text in texts:
            self._process.wait_for(text)

    def tell(self, command: str, *answers: str) -> None:
        """Type a command and wait until it has said each of ``answers``."""
        self._process.tell(command)
        self.until(*answers)

    def lost(self) -> int:
        """Ask how many packets its link has lost."""
        self.tell("link", " lost, ")
        return int(re.findall(r"(\d+) lost, ", self.said)[-1])

    @property
    def said(self) -> str:
        """All it said so far."""
        return self._process.output

    def complaints(self) -> list[str]:
        """Return the lines that complain, those of its end aside: there its threads stumble over each other."""
        return [
            line for line in self._process.lines[: self._lines] if any(text in line for text in COMPLAINTS)
        ]

    def stop(self) -> None:
        """End it as Ctrl-D does."""
        self._lines = len(self._process.lines)
        assert self._process.end() == EXIT_CODE, self.said

    def kill(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
