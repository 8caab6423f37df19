"""The failure detectors of a flight with their state. No I/O, no clock."""

from __future__ import annotations

import numpy as np

from flightstack.commander.detector_kernels import (
    BEYOND_ATTITUDE,
    BEYOND_POSITION,
    DETECTORS,
    MOVING,
    NOT_FINITE,
    ROTOR_FAULT,
    ROTOR_SPEEDS,
    UNMEASURED,
    UNMEASURED_AFTER_S,
    detect,
    detector_limits,
    follow_rotors,
    rotor_lags,
)
from flightstack.commander.failsafe import Failsafe
from flightstack.core.compiled import direct
from flightstack.core.contract import SETPOINT_SIZE, FloatArray, LoopRow, RecordArray
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

FAULTS = (
    (NOT_FINITE, Failsafe.NOT_FINITE),
    (BEYOND_ATTITUDE, Failsafe.ATTITUDE),
    (BEYOND_POSITION, Failsafe.POSITION_ERROR),
    (ROTOR_FAULT, Failsafe.ROTOR),
)


class FaultDetector:
    """Evaluates each row of the loops, and state and setpoint once per outer tick."""

    def __init__(
        self, vehicle: Vehicle, behaviour: Behaviour, outer_hz: float, divisor: int, state: FloatArray
    ) -> None:
        """Monitor ``state`` (13,), which is written in place; ``divisor`` is inner ticks per outer tick."""
        self._vehicle = vehicle
        self._state = state
        self._dt_s = 1.0 / outer_hz
        self._detectors: RecordArray = np.zeros(1, DETECTORS)
        self._rotors: RecordArray = np.zeros(1, ROTOR_SPEEDS)
        self._no_error_setpoint = np.zeros(SETPOINT_SIZE)
        self._lags = rotor_lags(vehicle, self._dt_s / divisor)
        self._unmeasured: set[int] = set()
        self.found = 0
        """Bits of ``detectors.detect`` from the last update."""
        self.set_behaviour(behaviour)
        row = np.zeros(LoopRow.SIZE)
        self._follow = direct(follow_rotors, row, self._rotors, self._lags)
        self._detect = direct(
            detect,
            state,
            self._no_error_setpoint,
            row,
            self._rotors,
            self._detectors,
            self._limits,
            False,
            self._dt_s,
        )

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Set new limits, from the next update on."""
        self._limits = detector_limits(behaviour, self._vehicle)

    def begin(self) -> None:
        """Reset all detectors at the start of a flight."""
        self._detectors[:] = np.zeros(1, DETECTORS)
        self._rotors[:] = np.zeros(1, ROTOR_SPEEDS)
        self._unmeasured.clear()
        self.found = 0

    def follow_rotors(self, row: FloatArray) -> None:
        """Take the newest row of the inner loop, shape (48,), once per inner tick."""
        self._follow(row, self._rotors, self._lags)

    def update(
        self, setpoint: FloatArray, row: FloatArray, position_is_controlled: bool, on_ground: bool
    ) -> int:
        """Advance by one outer tick; return the bits of ``detectors.detect``.

        ``setpoint`` (11,) and ``row`` (48,) are the newest of the outer and the inner loop. Position errors count only
        while the position is controlled: not on the ground, nor under attitude setpoints.
        """
        if not position_is_controlled:
            self._no_error_setpoint[:3] = self._state[:3]
            setpoint = self._no_error_setpoint
        self.found = self._detect(
            self._state, setpoint, row, self._rotors, self._detectors, self._limits, on_ground, self._dt_s
        )
        return self.found

    @property
    def moves(self) -> bool:
        """True if the velocities and rates in the state are so large that the state must change."""
        return self.found & MOVING != 0

    @property
    def is_quiet(self) -> bool:
        """True if no fault was found."""
        return not self.found & ~(MOVING | UNMEASURED)

    def take_unmeasured(self) -> list[int]:
        """Return the rotors, from 1, whose speed is no longer measured; each one once per flight."""
        if not self.found & UNMEASURED:
            return []
        missing_s = self._rotors["missing"][0, : len(self._vehicle.rotors)]
        fresh = {int(i) + 1 for i in np.flatnonzero(missing_s >= UNMEASURED_AFTER_S)} - self._unmeasured
        self._unmeasured |= fresh
        return sorted(fresh)

    def failsafes(self) -> set[Failsafe]:
        """Return the failsafes of the faults found."""
        return {failsafe for bit, failsafe in FAULTS if self.found & bit}
