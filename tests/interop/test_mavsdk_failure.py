"""MAVSDK's failure plugin stops a rotor in flight."""

from __future__ import annotations

import pytest
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.plugins.failure import FailureError, FailureType, FailureUnit

from tests.interop.client import story
from tests.interop.drone import Drone

ALLOWED = "SYS_FAILURE_EN"
"""The plugin reads it once, when it is made, and asks for nothing while it is 0."""
OWN_SPEED = 8.0
"""At which no other story flies: vehicles are shared by speed, and this one ends on its side."""


@story(speeds=(OWN_SPEED,))
async def test_a_rotor_that_stops_ends_the_flight(drone: Drone) -> None:
    drone.step("not allowed by default")
    with pytest.raises(FailureError) as forbidden:
        await FailureAsync(drone.system).inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 1)
    assert forbidden.value.result.name in ("DISABLED", "DENIED")
    await drone.param.set_param_int(ALLOWED, 1)
    failure = FailureAsync(drone.system)
    await drone.take_off()
    noticed = drone.later(
        "it is noticed", drone.telemetry.subscribe_status_text(),
        lambda said: "rotor does not follow" in said.text,
    )  # fmt: skip
    await failure.inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 1)
    await noticed
    await drone.until_disarmed()
    drone.step("what the simulator has not is refused")
    with pytest.raises(FailureError) as missing:
        await failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
    assert missing.value.result.name == "UNSUPPORTED"
    await failure.inject(FailureUnit.SYSTEM_MOTOR, FailureType.OK, 0)
    await drone.param.set_param_int(ALLOWED, 0)
