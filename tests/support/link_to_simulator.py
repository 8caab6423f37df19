"""The stack's link to a simulator, and what a simulator sends."""

from __future__ import annotations

from flightstack.core.geodesy import GeoPoint
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import PlantStateFrame

PAPER = load_vehicle("paper_quad")
HOME = GeoPoint(47.397742, 8.545594, 488.0)
STATE = [1.0, -2.0, -3.5, 0.1, 0.2, -0.3, 0.8, 0.6, 0.0, 0.0, 0.01, 0.02, 0.03]


def link(lockstep: bool = True, vehicle=PAPER) -> SimulatorEndpoint:
    return SimulatorEndpoint(vehicle, HOME, lockstep, system_id=3)


def booted() -> SimulatorEndpoint:
    """A link whose clock runs since a state of time 0."""
    stack = link()
    assert receive(stack, plant_state(0, [0.0] * 6 + STATE[6:]))
    return stack


def plant_state(time_us: int, state=STATE, speed: float = 200.0) -> bytes:
    frame = PlantStateFrame(1, 51)
    frame.state[:] = state
    frame.rotor_speed_rad_s[:] = speed
    frame.set_rotor_count(4)
    return bytes(frame.seal(time_us, 0))


def receive(stack: SimulatorEndpoint, data: bytes) -> bool:
    return stack.receive(memoryview(data))
