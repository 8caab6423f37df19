"""Two programs with MAVSDK on one vehicle: one flies, the other watches, asks and is not disturbed."""

from __future__ import annotations

import pytest

from tests.interop.client import API, GROUND, TCP
from tests.interop.conftest import Fleet
from tests.interop.drone import Drone

SPEED = 10.0


async def fly(drone: Drone) -> None:
    """Take off, wait for the order to go home that the other client gives, and see it done."""
    ordered = drone.later_mode("RETURN_TO_LAUNCH")
    await drone.take_off()
    await ordered
    await drone.until_disarmed()


async def watch_and_return(drone: Drone) -> None:
    """See the vehicle fly, read and write parameters meanwhile, and call it home."""
    await drone.until("in the air", drone.telemetry.subscribe_in_air(), bool)
    listed = await drone.param.get_all_params()
    assert len(listed.float_params) > 30
    await drone.until("high", drone.telemetry.subscribe_position(), lambda at: at.relative_altitude_m > 1.5)
    await drone.until_mode("HOLD")
    await drone.action.return_to_launch()
    await drone.until_disarmed()


for function in (fly, watch_and_return):
    function.story = function  # type: ignore[attr-defined]  # run by the test below


@pytest.mark.parametrize(("pilot", "observer"), [(API, TCP), (GROUND, API)])
def test_one_flies_and_the_other_calls_the_vehicle_home(fleet: Fleet, pilot: str, observer: str) -> None:
    first, second = fleet.client(SPEED, pilot), fleet.client(SPEED, observer)
    second.begin(watch_and_return)
    try:
        first.run(fly)
        second.finish()
    except AssertionError:
        fleet.discard()
        raise
