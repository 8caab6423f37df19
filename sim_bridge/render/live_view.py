"""``sim-bridge --view``: a window beside the simulator, in a process of its own.

A thread writes what the plant shows sixty times per second of wall time into a pipe; the window reads the newest. The
simulator never waits for it: a full pipe loses a picture, a closed window is forgotten. Simulated time knows nothing
of it, so that the same flight gives the same log with and without a window.
"""

from __future__ import annotations

import contextlib
import os
import struct
import subprocess
import threading
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE
from flightstack.process.command_line import own_program
from sim_bridge.errors import UsageProblemError

if TYPE_CHECKING:
    from sim_bridge.simulator import Simulator

SNAPSHOT = struct.Struct(f"<d{STATE_SIZE}d{MAX_ROTORS}f")
"""Time [s], array form of ``VehicleState``, rotor speeds [rad/s]; shorter than what a pipe takes whole."""
READY = b"ready\n"
_PERIOD_S = 1.0 / 60.0
_PATIENCE_S = 5.0


class LiveView:
    """The window's process, which has said that it stands; raise UsageProblemError when it cannot."""

    def __init__(self, vehicle: str, window: Sequence[str] | None = None) -> None:
        """Open a window for a vehicle, by the name or the path of its file; ``window`` is the program that does it."""
        self._process = subprocess.Popen(
            [*(window or own_program("sim_bridge.render.live_window")), vehicle],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is the simulator's, whose end ends the window
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe = self._process.stdin.fileno()
        try:
            answer = self._process.stdout.readline()
        except BaseException:
            self._process.kill()
            raise
        if answer != READY:
            raise UsageProblemError(self._complaint())
        os.set_blocking(self._pipe, False)

    def _complaint(self) -> str:
        """Return the last line that it wrote, once it has ended."""
        said = self._process.communicate()[1].decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), "it ended at once")
        return last if last.startswith("--view") else f"--view: the window cannot be opened: {last}"

    def write(self, snapshot: bytes) -> bool:
        """Hand over a snapshot; return False when the window is closed."""
        try:
            os.write(self._pipe, snapshot)
        except BlockingIOError:  # it is behind: the next one will be newer
            return True
        except OSError:
            return False
        return True

    @contextlib.contextmanager
    def watching(self, simulator: Simulator) -> Iterator[None]:
        """Show a simulator until the block ends, and close the window then."""
        over = threading.Event()

        def feed() -> None:
            while self.write(snapshot_of(simulator)) and not over.wait(_PERIOD_S):
                pass

        thread = threading.Thread(target=feed, name="live view", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join(_PATIENCE_S)
            self.close()

    def close(self) -> None:
        """Close the window; nothing happens when it is closed."""
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def snapshot_of(simulator: Simulator) -> bytes:
    """Return the true state of now. Called from another thread: a step in between may mix two moments 2 ms apart."""
    frame = simulator.frame
    return SNAPSHOT.pack(simulator.time_us * 1e-6, *frame.state.tolist(), *frame.rotor_speed_rad_s.tolist())
