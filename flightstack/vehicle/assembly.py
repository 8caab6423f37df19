"""Composition of the parts of a vehicle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.commander.ground_monitor import GroundMonitor
from flightstack.commander.inputs import StateSource
from flightstack.control.backend import ControlBackend
from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.geodesy import GeoPoint
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.guidance.safe_places import SafePlaces, plan_limits
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.flight_monitor import FlightMonitor
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.mode_control import ModeControl, Readiness, Takeoff
from flightstack.vehicle.plans import FlightArea, Mission
from flightstack.vehicle.requests import FlightRequests


class VehicleParts(NamedTuple):
    """Parts of a vehicle without links, clock and simulator."""

    vehicle: Vehicle
    now: FlightState
    journal: Journal
    places: SafePlaces
    mission: Mission
    area: FlightArea
    takeoff: Takeoff
    readiness: Readiness
    modes: ModeControl
    requests: FlightRequests
    failsafes: FailsafeMonitor
    navigator: Navigator
    backend: ControlBackend
    autopilot: Autopilot

    def warm_up(self, *, with_streams: bool) -> None:
        """Compile the kernels of loops and commander, or load them from the cache.

        ``with_streams``: that of modes that follow a stream too, which is else loaded in flight.
        """
        now = self.now
        self.backend.warm_up(now.state, now.setpoint, now.rotor_speed)
        self.failsafes.warm_up()
        if with_streams:
            self.navigator.warm_up_streams()

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Set the parameters of guidance and commander, effective in the next outer tick."""
        limits, self.now.behaviour = plan_limits(self.now.behaviour), behaviour
        self.navigator.set_params(guidance_params(behaviour, self.vehicle.weight_n))
        self.failsafes.set_behaviour(behaviour)
        self.area.set_bounds()
        if plan_limits(behaviour) != limits:
            self.modes.check_mission_in_flight()


def assemble(
    vehicle: Vehicle,
    backend: ControlBackend,
    behaviour: Behaviour,
    home: GeoPoint,
    divisor: int,
    outer_hz: float,
    recorder: FlightRecorder,
    state: FloatArray,
    rotor_speed_rad_s: FloatArray,
    source: StateSource,
) -> VehicleParts:
    """Assemble a vehicle on the ground at ``home``; its outer loop runs every ``divisor`` ticks.

    ``source`` writes ``state`` (13,) and ``rotor_speed_rad_s`` (8,) in place.
    """
    navigator = Navigator(guidance_params(behaviour, vehicle.weight_n), outer_hz)
    idle = np.zeros(LoopRow.SIZE)
    now = FlightState(behaviour, state, rotor_speed_rad_s, navigator.setpoint, backend.attitude_target, idle)
    journal = Journal(now, recorder)
    places = SafePlaces(home)
    failsafes = FailsafeMonitor(vehicle, behaviour, outer_hz, divisor, state, source)
    ground = GroundMonitor()
    mission = Mission(now, places, navigator, journal)
    area = FlightArea(now, places, failsafes.fence, mission, navigator, journal)
    readiness = Readiness(now, failsafes, ground, mission)
    takeoff = Takeoff(now, places, area, readiness)
    modes = ModeControl(
        now, journal, readiness, failsafes, ground, mission, area, takeoff, navigator, backend
    )
    requests = FlightRequests(now, journal, modes, readiness, failsafes, mission, navigator)
    monitor = FlightMonitor(
        now, journal, modes, failsafes, ground, mission, area, takeoff, navigator, vehicle.weight_n
    )
    autopilot = Autopilot(now, monitor, failsafes, navigator, backend, recorder, divisor)
    return VehicleParts(
        vehicle, now, journal, places, mission, area, takeoff, readiness, modes, requests, failsafes, navigator,
        backend, autopilot,
    )  # fmt: skip
