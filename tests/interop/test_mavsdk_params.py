"""MAVSDK reads and sets parameters."""

from __future__ import annotations

import pytest
from mavsdk.plugins.param import ParamError

from tests.interop.client import TCP, story
from tests.interop.drone import Drone

GAIN, WHOLE = "MIS_TAKEOFF_ALT", "COM_DL_LOSS_T"


@story(speeds=(1,), by_night=(TCP,))
async def test_numbers_are_set_and_read_back(drone: Drone) -> None:
    before = await drone.param.get_param_float(GAIN)
    await drone.param.set_param_float(GAIN, 3.25)
    assert await drone.param.get_param_float(GAIN) == 3.25
    await drone.param.set_param_float(GAIN, before)
    assert await drone.param.get_param_float(GAIN) == before


@story(speeds=(1,), by_night=(TCP,))
async def test_integers_keep_their_type(drone: Drone) -> None:
    before = await drone.param.get_param_int(WHOLE)
    await drone.param.set_param_int(WHOLE, 299)
    assert await drone.param.get_param_int(WHOLE) == 299
    await drone.param.set_param_int(WHOLE, before)
    assert await drone.param.get_param_int(WHOLE) == before


@story(speeds=(1,))
async def test_what_is_refused_is_named(drone: Drone) -> None:
    drone.step("a name that is not known")
    with pytest.raises(ParamError) as unknown:
        await drone.param.get_param_float("NO_SUCH")
    assert unknown.value.result.name == "DOES_NOT_EXIST"
    drone.step("a value out of range")
    before = await drone.param.get_param_float(GAIN)
    with pytest.raises(ParamError) as outside:
        await drone.param.set_param_float(GAIN, -3.0)
    assert outside.value.result.name == "VALUE_OUT_OF_RANGE"
    assert await drone.param.get_param_float(GAIN) == before
    drone.step("a number for an integer")
    with pytest.raises(ParamError) as mistyped:
        await drone.param.set_param_float(WHOLE, 20.5)
    assert mistyped.value.result.name in ("WRONG_TYPE", "TYPE_MISMATCH")


@story(speeds=(1,), by_night=(TCP,))
async def test_all_parameters_are_listed(drone: Drone) -> None:
    everything = await drone.param.get_all_params()
    numbers = {each.name: each.value for each in everything.float_params}
    integers = {each.name: each.value for each in everything.int_params}
    assert numbers[GAIN] == await drone.param.get_param_float(GAIN)
    assert integers[WHOLE] == await drone.param.get_param_int(WHOLE)
    assert not numbers.keys() & integers.keys()
    assert len(numbers) + len(integers) > 50, (len(numbers), len(integers))
