"""What the loops write for a vehicle that must not fly: the same for every backend."""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import FloatArray, LoopRow, LoopStatus
from flightstack.params.vehicle import Vehicle


class IdleRow:
    """Writes rows of loops that rest."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._speed = np.array([max(0.0, rotor.min_speed_rad_s) for rotor in vehicle.rotors])
        self._columns = slice(LoopRow.ROTOR_COMMAND.start, LoopRow.ROTOR_COMMAND.start + self._speed.size)

    def write(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` (48,): rotors at idle speed when armed, else stopped; the reference at the attitude."""
        row[:] = 0.0
        row[LoopRow.STATE] = state
        row[LoopRow.REFERENCE_ATTITUDE] = state[6:10]
        if armed:
            row[self._columns] = self._speed
        row[LoopRow.ROTOR_SPEED] = rotor_speed_rad_s
        row[LoopRow.STATUS] = LoopStatus.IDLE
