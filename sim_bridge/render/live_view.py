"""``sim-bridge --view``: a window beside the simulator, in a process of its own.

A thread writes the state of the plant into a pipe sixty times per second of wall time; the window reads the newest one.
The simulator never waits for it: a full pipe drops a snapshot, a closed window ends the thread. The window does not
affect simulated time: the same flight gives the same log with and without it.
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
from flightstack.process.supervised import own_program
from sim_bridge.errors import UsageProblemError

if TYPE_CHECKING:
    from sim_bridge.simulator import Simulator

SNAPSHOT = struct.Struct(f"<d{STATE_SIZE}d{MAX_ROTORS}f")
"""Time [s], array form of ``VehicleState``, rotor speeds [rad/s]; short enough for an atomic write to a pipe."""
READY = b"ready\n"
_PERIOD_S = 1.0 / 60.0
_TIMEOUT_S = 5.0


class LiveView:
    """The process of an open window. Raises UsageProblemError if the window cannot be opened."""

    def __init__(self, vehicle: str, window: Sequence[str] | None = None) -> None:
        """Open a window for a vehicle, a name or the path of its file; ``window`` is the program to run."""
        self._process = subprocess.Popen(
            [*(window or own_program("sim_bridge.render.live_window")), vehicle],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C goes to the simulator, whose end closes the window
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
            raise UsageProblemError(self._error_text())
        os.set_blocking(self._pipe, False)

    def _error_text(self) -> str:
        """Wait for the end of the process; return its last line on stderr."""
        lines = self._process.communicate()[1].decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "it ended at once")
        return last if last.startswith("--view") else f"--view: the window cannot be opened: {last}"

    def write(self, snapshot: bytes) -> bool:
        """Send a snapshot; return False if the window is closed."""
        try:
            os.write(self._pipe, snapshot)
        except BlockingIOError:  # the window is slow: drop this snapshot
            return True
        except OSError:
            return False
        return True

    @contextlib.contextmanager
    def watching(self, simulator: Simulator) -> Iterator[None]:
        """Show a simulator until the block ends, then close the window."""
        ended = threading.Event()

        def feed() -> None:
            while self.write(snapshot_of(simulator)) and not ended.wait(_PERIOD_S):
                pass

        thread = threading.Thread(target=feed, name="live view", daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join(_TIMEOUT_S)
            self.close()

    def close(self) -> None:
        """Close the window; do nothing if it is closed."""
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        try:
            self._process.wait(_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def snapshot_of(simulator: Simulator) -> bytes:
    """Return the present true state. A concurrent step may mix two states 2 ms apart."""
    frame = simulator.frame
    return SNAPSHOT.pack(simulator.time_us * 1e-6, *frame.state.tolist(), *frame.rotor_speed_rad_s.tolist())
