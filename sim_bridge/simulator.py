"""The simulator without I/O: one plant, its time, and the exchange of state and actuators.

Same vehicle, options, seed and commands give the same bytes, at any speed.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.mavlink.hot_frames import GROUND_CONTACT_FLAG, HEADER_SIZE, ActuatorsFrame, PlantStateFrame
from flightstack.params.vehicle import Vehicle
from sim_bridge.compiled_plant import CompiledPlant
from sim_bridge.errors import PlantDivergedError
from sim_bridge.layout import CONTACT, DIVERGED, OUTPUT
from sim_bridge.plant import Plant, PlantOptions

SIMULATOR_COMPONENT = 200
DEFAULT_INTERVAL_US = 2000
SHORTEST_INTERVAL_US = 50
LONGEST_INTERVAL_US = 1_000_000
SLOWEST_PHYSICS_HZ = 100.0
FASTEST_PHYSICS_HZ = 100_000.0

_STATE_AT = HEADER_SIZE + 8  # after the time
_FLAGS = (0, GROUND_CONTACT_FLAG)


class Simulator:
    """Advances a plant by one exchange interval for each set of actuator commands."""

    def __init__(
        self,
        vehicle: Vehicle,
        plant: str = "rigid",
        options: PlantOptions | None = None,
        *,
        physics_hz: float = 1000.0,
        interval_us: int = DEFAULT_INTERVAL_US,
        system_id: int = 1,
    ) -> None:
        self.vehicle = vehicle
        self.plant: Plant = CompiledPlant(vehicle, plant, options or PlantOptions())
        self.time_us = 0
        self._physics_dt_us = 1e6 / physics_hz
        self._frame = PlantStateFrame(system_id, SIMULATOR_COMPONENT)
        self._frame.set_rotor_count(len(vehicle.rotors))
        self.plant.output = np.frombuffer(self._frame.frame, OUTPUT, 1, _STATE_AT)
        self._flags = 0
        self.set_interval_us(interval_us)
        self._note(self.plant.show())

    @property
    def interval_us(self) -> int:
        """Simulated time between two exchanges."""
        return self._interval_us

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle touches the ground."""
        return self._flags != 0

    def set_interval_us(self, interval_us: int) -> None:
        """Choose the exchange interval; it is split into equal steps no longer than one physics step."""
        if not SHORTEST_INTERVAL_US <= interval_us <= LONGEST_INTERVAL_US:
            raise ValueError(f"an interval of {interval_us} µs is outside the allowed 50 µs to 1 s")
        self._interval_us = interval_us
        self._steps = max(1, math.ceil(interval_us / self._physics_dt_us - 1e-9))
        self.plant.set_step(interval_us * 1e-6 / self._steps)

    def state_frame(self) -> memoryview:
        """Return the FS_PLANT_STATE frame of the present state, valid until the next call of ``apply``."""
        return self._frame.seal(self.time_us, self._flags)

    @property
    def frame(self) -> PlantStateFrame:
        """The state that ``state_frame`` sends; read only."""
        return self._frame

    def apply(self, actuators: ActuatorsFrame) -> None:
        """Advance by one interval with the commands held; raise PlantDivergedError on overflow."""
        result = self.plant.advance(actuators.rotor_speed_rad_s, actuators.flags, self._steps)
        self.time_us += self._interval_us
        if result > CONTACT:
            self._note(result)
        self._flags = _FLAGS[result]

    def _note(self, result: int) -> None:
        if result & DIVERGED:
            raise PlantDivergedError(
                f"the plant diverged at t={self.time_us * 1e-6:.3f} s: forces or rates are too large for the "
                "step; use a higher --physics-hz or smaller commands"
            )
        self._flags = _FLAGS[result]
