"""The process of ``sim-bridge --view``: shows snapshots from standard input until either is closed."""

from __future__ import annotations

import contextlib
import math
import os
import select
import sys
from collections import deque
from collections.abc import Iterator

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.process.console import complain
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.live_view import READY, SNAPSHOT
from sim_bridge.render.poses import MOST_TRAIL, Moment

_TRAIL_STEP_M = 0.08
_LONGEST_STEP_S = 0.1  # of rotor rotation between two pictures
_NICENESS = 10
"""Lower priority than the flight, for machines with few processors."""
_NO_MOMENT = Moment(0.0, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, (), (), None)


class LiveFlight:
    """Converts snapshots to moments, and keeps the trail. No I/O."""

    def __init__(self, rotors: int, most_points: int) -> None:
        self.moment = _NO_MOMENT._replace(rotor_speed_rad_s=(0.0,) * rotors, rotor_angle_rad=(0.0,) * rotors)
        self._trail: deque[tuple[float, float, float]] = deque(maxlen=most_points)

    def update(self, snapshot: bytes) -> Moment:
        """Return the moment of a snapshot; a snapshot that is not finite is ignored."""
        time_s, *values = SNAPSHOT.unpack(snapshot)
        rotors = len(self.moment.rotor_speed_rad_s)
        speeds = tuple(abs(speed) if math.isfinite(speed) else 0.0 for speed in values[13 : 13 + rotors])
        if not all(map(math.isfinite, values[:10])):
            return self.moment
        step_s = min(max(time_s - self.moment.time_s, 0.0), _LONGEST_STEP_S)
        angles = tuple(
            angle + speed * step_s for angle, speed in zip(self.moment.rotor_angle_rad, speeds, strict=True)
        )
        position = (values[0], values[1], values[2])
        if not self._trail or math.dist(self._trail[-1], position) >= _TRAIL_STEP_M:
            self._trail.append(position)
        self.moment = self.moment._replace(
            time_s=time_s, position_ned_m=position, attitude=(values[6], values[7], values[8], values[9]),
            speed_m_s=math.hypot(*values[3:6]), rotor_speed_rad_s=speeds, rotor_angle_rad=angles,
        )  # fmt: skip
        return self.moment

    def trail(self, _time_s: float, _most: int) -> FloatArray:
        """Return the path flown NED [m], shape (n, 3), up to the present position."""
        return np.array([*self._trail, self.moment.position_ned_m])


def newest(buffer: bytearray) -> bytes | None:
    """Remove the complete snapshots from a buffer and return the last one."""
    whole = len(buffer) // SNAPSHOT.size * SNAPSHOT.size
    if not whole:
        return None
    last = bytes(buffer[whole - SNAPSHOT.size : whole])
    del buffer[:whole]
    return last


def _snapshots(file: int) -> Iterator[bytes | None]:
    """Yield the newest snapshot, or None without a new one, until the pipe is closed."""
    buffer = bytearray()
    while True:
        while select.select([file], [], [], 0.0)[0]:
            data = os.read(file, 1 << 16)
            if not data:
                return
            buffer += data
        yield newest(buffer)


def main(vehicle: str) -> int:
    """Show a vehicle; return the exit code."""
    try:
        from sim_bridge.render.viewer import LiveWindow

        window = LiveWindow(vehicle)
    except (UsageProblemError, ConfigError, ImportError) as error:
        complain(error)
        return 2
    flight = LiveFlight(len(window.vehicle.rotors), MOST_TRAIL)
    with contextlib.suppress(OSError):  # for threads started from here on: the simulator waits for the start
        os.nice(_NICENESS)
    sys.stdout.buffer.write(READY)
    sys.stdout.flush()
    moments = (None if snapshot is None else flight.update(snapshot) for snapshot in _snapshots(0))
    window.show(moments, flight.trail)
    return 0


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(main(sys.argv[1]))
