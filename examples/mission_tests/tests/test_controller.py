"""The attitude controller flies in this process, in simulated time: equal tests have equal figures everywhere."""

from __future__ import annotations

import pytest

WEATHER = {"vehicle": "x_quad", "state": "truth", "wind": (5.0, 0.0), "gust": 2.0}


def test_square_in_calm_air(sitl):
    flight = sitl.fly("square", vehicle="x_quad", controller="lqr", state="truth")
    assert flight.completed
    assert flight.max_error_m < 0.1
    assert flight.always("abs(roll_deg) < 35 and abs(pitch_deg) < 35").margin > 10


@pytest.mark.parametrize("seed", [3, 4])
def test_gusts_disturb_it_no_more_than_pid(sitl, seed):
    own = sitl.fly("square", controller="lqr", seed=seed, **WEATHER)
    pid = sitl.fly("square", controller="pid", seed=seed, **WEATHER)
    assert own.completed
    assert own.rms_error_m < 1.1 * pid.rms_error_m
    own.always("error_m < 1.0")


def test_weak_rotor_is_held(sitl):
    world = sitl(vehicle="x_quad", controller="lqr", state="truth")
    world.takeoff(5.0)
    world.run_until("altitude_m > 4.8", timeout_s=10)
    world.fault("rotor 2 efficiency 0.8", for_s=3.0)
    world.run_for(10.0)
    flight = world.flight()
    flight.always("abs(roll_deg) < 20 and abs(pitch_deg) < 20")
    flight.eventually("error_m < 0.1 within 10 s of fault")
