"""The land detector: every sign that must agree, how long, and what ends it."""

from __future__ import annotations

import pytest

from flightstack.contract import Quaternion, Vector3, VehicleState
from flightstack.guidance.land_detector import CLIMB_M, CONTACT_S, SETTLE_S, LandMemory, land_detector_step

WEIGHT_N, DT = 10.0, 0.01
FLYING = LandMemory(0.0, 0.0, 0.0)
LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)


def moving(down: float = 0.0, north: float = 0.0, east: float = 0.0, z: float = -0.02) -> VehicleState:
    return VehicleState(Vector3(0.0, 0.0, z), Vector3(north, east, down), LEVEL, Vector3(0.0, 0.0, 0.0))


def watch(
    seconds: float, state: VehicleState, thrust: float = 3.0, descending: bool = True, memory=FLYING
) -> LandMemory:
    for _ in range(round(seconds / DT)):
        memory = land_detector_step(memory, state, thrust, WEIGHT_N, descending, DT)
    return memory


def test_it_needs_all_signs_for_the_settling_time() -> None:
    assert watch(SETTLE_S - 2 * DT, moving()).landed == 0.0
    landed = watch(SETTLE_S + 2 * DT, moving())
    assert landed.landed == 1.0
    assert landed.ground_z_m == -0.02


@pytest.mark.parametrize(
    ("state", "thrust", "descending"),
    [
        (moving(down=0.55), 3.0, True),
        (moving(down=-0.55), 3.0, True),
        (moving(north=0.3, east=0.3), 3.0, True),
        (moving(), 7.6, True),
        (moving(), 3.0, False),
    ],
    ids=["sinking", "rising", "sliding", "carried by its rotors", "not told to descend"],
)
def test_one_missing_sign_is_enough_to_be_flying(
    state: VehicleState, thrust: float, descending: bool
) -> None:
    assert watch(10.0, state, thrust, descending) == (0.0, 0.0, -0.02)
    # and an instant of it begins the time anew
    almost = watch(SETTLE_S - 2 * DT, moving())
    interrupted = land_detector_step(almost, state, thrust, WEIGHT_N, descending, DT)
    assert watch(SETTLE_S - 2 * DT, moving(), memory=interrupted).landed == 0.0


@pytest.mark.parametrize("down", [0.25, -0.25])
def test_a_foot_on_the_ground_may_turn_the_vehicle_but_a_slow_sink_begins_nothing(down: float) -> None:
    """A tilted vehicle levels about the foot that touches; before contact the same speed is flight."""
    assert watch(10.0, moving(down=down)) == (0.0, 0.0, -0.02)
    touching = watch(CONTACT_S + DT, moving())
    assert watch(SETTLE_S, moving(down=down), memory=touching).landed == 1.0


def test_a_slow_descent_in_the_air_is_no_landing() -> None:
    """Sinking slowly and evenly takes the whole weight in thrust."""
    assert watch(20.0, moving(down=0.1), thrust=WEIGHT_N).landed == 0.0


def test_it_ends_with_a_rise_and_with_nothing_else() -> None:
    landed = watch(1.0, moving())
    assert watch(5.0, moving(down=3.0, north=2.0), thrust=20.0, descending=False, memory=landed) == landed
    higher = moving(z=-0.02 - CLIMB_M + 0.001)
    assert watch(1.0, higher, thrust=12.0, descending=False, memory=landed).landed == 1.0
    flying = watch(DT, moving(z=-0.02 - CLIMB_M - 0.001), thrust=12.0, descending=False, memory=landed)
    assert flying.landed == 0.0


def test_ground_is_wherever_it_landed() -> None:
    """A hill of 30 m: the next takeoff is measured from there."""
    hill = moving(z=-30.0)
    landed = watch(1.0, hill)
    assert landed == (1.0, landed.settled_s, -30.0)
    assert watch(1.0, moving(z=-30.1), memory=landed).landed == 1.0
    assert watch(1.0, moving(z=-30.2), thrust=12.0, descending=False, memory=landed).landed == 0.0
