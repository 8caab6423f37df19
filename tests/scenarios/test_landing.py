"""Landing in wind: found soon after touchdown, without a failsafe, and never in the air.

NIGHTLY=1 flies every vehicle, plant, controller and gains file in every wind; otherwise a few of these are flown.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import pytest

from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import load_vehicle
from tests.support.refusals import refused
from tests.support.streams import attitude, level, local_point, sticks, stream
from tests.support.tools import NIGHTLY
from tests.support.truth import World

FRICTION = 0.7
"""Of the ground: wind that pushes with a larger share of the weight moves a standing vehicle."""
USUAL_TEXTS = {"Armed", "Takeoff detected", "Landing detected", "Disarmed"}


def wind_that_pushes(
    vehicle: str, plant: str, share: float, up: float = 0.0
) -> dict[str, tuple[float, float, float]]:
    """Wind, or a force where there is no drag, of this share of the weight; it blows between two rotors' arms.

    ``up`` is an upward force as share of the weight.
    """
    craft = load_vehicle(vehicle)
    north, east = share * craft.weight_n * 0.8, share * craft.weight_n * 0.6
    drag = craft.linear_drag_n_s_m[0]
    if plant == "paper" or drag == 0.0:
        return {"force": (north, east, -up * craft.weight_n)}
    return {"wind": (north / drag, east / drag, 0.0), "force": (0.0, 0.0, -up * craft.weight_n)}


class Landing(NamedTuple):
    """What a landing was like."""

    found_s: float  # from touchdown to "landed"
    lead_m: float  # of the setpoint below the vehicle at touchdown
    deepest_m: float  # the same, largest
    slid_m: float  # from touchdown to the end
    tilt_deg: float  # half a second after it was disarmed
    world: World


def hover(altitude_m: float = 3.0, seconds: float = 4.0, **options: object) -> World:
    world = World(**options)  # type: ignore[arg-type]
    world.arm()
    world.takeoff(altitude_m)
    world.run_until("mode == 'HOLD'", 30.0)
    world.run_for(seconds)
    return world


def watch_landing(world: World, limit_s: float = 30.0) -> Landing:
    """Fly on until the vehicle disarms, and half a second more."""
    touched_s, touched_at, found_s = math.nan, world.state.position_ned_m, math.nan
    lead_m = deepest_m = 0.0
    ends_s = world.time_s + limit_s
    while world.state.armed:
        assert world.time_s < ends_s, (world.state.position_ned_m, world.state.mode, world.texts)
        world.tick()
        below_m = float(world.engine.stack.now.setpoint[2] - world.state.position_ned_m.z)
        if math.isnan(touched_s) and world.engine.simulator.on_ground:
            touched_s, touched_at, lead_m = world.time_s, world.state.position_ned_m, below_m
        if math.isnan(found_s) and world.state.landed:
            found_s = world.time_s - touched_s
        deepest_m = max(deepest_m, below_m)
    slid_m = math.dist(world.state.position_ned_m[:2], touched_at[:2])
    world.run_for(0.5)
    _, x, y, _ = world.engine.simulator.frame.state[6:10]
    tilt_deg = math.degrees(math.acos(1.0 - 2.0 * (x * x + y * y)))
    return Landing(found_s, lead_m, deepest_m, slid_m, tilt_deg, world)


GAINS = ("tuned", "paper", "paper_rate_fed", "backstepping_poles")
ALL = [
    (vehicle, plant, controller, gains, share, gust, up)
    for vehicle in ("x_quad", "paper_quad")
    for plant in ("rigid", "paper", "multibody")
    for controller in ("pid", "backstepping")
    for gains in GAINS
    for share in ((0.0, 0.25, 0.6, 0.8, 0.95) if gains == "tuned" else (0.0, 0.25, 0.6))
    for gust in ((0.0, 2.0) if (vehicle, plant) == ("x_quad", "rigid") else (0.0,))
    for up in ((0.0, 0.15, 0.3) if share < 0.5 and plant == "rigid" else (0.0,))
    # once these loops saturate the rotors, they oscillate between the limits: on one foot, they do not recover
    if (vehicle, controller, gains, share, up > 0.0) != ("paper_quad", "pid", "paper_rate_fed", 0.25, True)
]
SOME = [
    ("x_quad", "rigid", "pid", "tuned", 0.25, 0.0, 0.0),
    ("x_quad", "rigid", "backstepping", "tuned", 0.95, 2.0, 0.0),
    ("x_quad", "rigid", "pid", "paper", 0.25, 0.0, 0.0),
    ("x_quad", "rigid", "pid", "paper", 0.25, 0.0, 0.15),
    ("x_quad", "multibody", "pid", "tuned", 0.95, 0.0, 0.0),
    ("x_quad", "paper", "pid", "tuned", 0.6, 0.0, 0.0),
    ("paper_quad", "rigid", "pid", "paper", 0.6, 0.0, 0.0),
    ("paper_quad", "rigid", "backstepping", "backstepping_poles", 0.0, 0.0, 0.3),
    ("x_quad", "rigid", "pid", "tuned", 0.25, 2.0, 0.3),
]


def with_faster_rotors(folder: Path) -> str:
    """Return x_quad with a lag of 10 ms instead of 20 ms."""
    text = (files("flightstack.params") / "vehicles" / "x_quad.toml").read_text()
    path = folder / "x_quad.toml"
    path.write_text(text.replace("lag_s = 0.02", "lag_s = 0.01"))
    return str(path)


def saturates(controller: str, gains: str, share: float, gust: float, up: float) -> bool:
    """Return True if x_quad's rotors are too slow for these gains, which are for 5 ms: it oscillates on one foot."""
    in_wind = gains == "paper_rate_fed" and share > 0.0
    return controller == "pid" and up > 0.2 and (in_wind or (gains == "paper" and gust > 0.0))


@pytest.mark.parametrize(
    ("vehicle", "plant", "controller", "gains", "share", "gust", "up"), ALL if NIGHTLY else SOME
)
def test_landing_in_wind(
    vehicle: str,
    plant: str,
    controller: str,
    gains: str,
    share: float,
    gust: float,
    up: float,
    tmp_path: Path,
) -> None:
    """Measured: found within 1.1 s with the tuned gains, else 2.9 s, the paper's vehicle and gains 3.3 s."""
    if vehicle == "x_quad" and saturates(controller, gains, share, gust, up):
        vehicle = with_faster_rotors(tmp_path)
    fast = {} if gains == "tuned" else {"inner_hz": 1000.0}
    world = hover(
        vehicle=vehicle, plant=plant, controller=controller, gains=gains, gust=gust,
        **wind_that_pushes(vehicle, plant, share, up), **fast,
    )  # fmt: skip
    world.land()
    landing = watch_landing(world)
    print(
        f"{landing.found_s:.2f} s, {landing.deepest_m:.2f} m, {landing.slid_m:.2f} m, {landing.tilt_deg:.1f}°"
    )
    assert set(world.texts) == USUAL_TEXTS
    assert landing.found_s < (1.5 if gains == "tuned" else 3.0 if up < 0.3 else 3.5)
    # a loop without integral follows an upward force up/kp below its setpoint
    assert landing.deepest_m < max(0.7 if gains == "tuned" else 1.5, landing.lead_m + 0.3)
    if share < FRICTION * (1.0 - up):
        assert landing.slid_m < 2.5
        assert landing.tilt_deg < 0.5


def test_thrust_reduced_at_touchdown_keeps_the_tilt() -> None:
    """The tilt setpoint against the wind was 17°, rose to 37° within 40 ms of touchdown and tipped the vehicle over."""
    world = hover(
        vehicle="x_quad", gains="paper", inner_hz=1000.0, **wind_that_pushes("x_quad", "rigid", 0.25, 0.15)
    )
    world.land()
    world.run_until(lambda _: world.engine.simulator.on_ground, 30.0)
    world.run_for(0.1)
    _, x, y, _, thrust_n = world.engine.stack.now.attitude_target.tolist()
    assert thrust_n < 0.6 * load_vehicle("x_quad").weight_n
    assert math.degrees(math.acos(1.0 - 2.0 * (x * x + y * y))) < 25.0  # 23.3° seen


def test_a_mission_in_strong_wind_lands_as_in_calm_air() -> None:
    """12 m/s: once 11 s on the ground, rotors at their limits, then "attitude beyond its limits"."""
    world = World(vehicle="x_quad", wind=(12.0, 0.0, 0.0))
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    landing = watch_landing(world, 60.0)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    assert landing.found_s < 1.5  # 0.85 s seen
    assert landing.slid_m < 0.3  # 0.07 m
    assert not [text for text in world.texts if "attitude" in text.lower()]


def test_a_return_in_strong_wind_lands() -> None:
    world = hover(vehicle="x_quad", wind=(14.0, 0.0, 0.0))
    world.rtl()
    assert watch_landing(world).found_s < 1.5
    assert set(world.texts) == USUAL_TEXTS


def test_python_and_c_land_alike() -> None:
    """Contact resets the loops in the same step of both."""
    landings = []
    for loops in ("python", "c"):
        world = hover(vehicle="x_quad", wind=(14.0, 0.0, 0.0), loops=loops)
        world.land()
        landings.append(watch_landing(world))
    python, c = landings
    assert python.found_s == c.found_s
    assert c.slid_m == pytest.approx(python.slid_m, abs=1e-6)


def test_an_offboard_position_below_the_ground_lands() -> None:
    world = hover(vehicle="x_quad", wind=(12.0, 0.0, 0.0))
    stream(world, local_point((0.0, 0.0, 5.0)), 0.2)
    world.set_mode("OFFBOARD")
    world.gcs.streams["point"] = lambda: local_point((0.0, 0.0, 5.0))
    landing = watch_landing(world)
    assert landing.found_s < 1.5
    assert landing.deepest_m < 0.7
    assert set(world.texts) == USUAL_TEXTS


@pytest.mark.parametrize("mode", ["ALTITUDE", "POSITION"])
def test_sticks_land_with_a_throttle_that_moves(mode: str) -> None:
    """Down, up again on the ground, and down: the vehicle lands, and no failsafe acts meanwhile."""
    world = hover(vehicle="x_quad", wind=(5.0, 0.0, 0.0), seconds=1.0)
    stream(world, sticks(), 0.2)
    world.set_mode(mode)
    stream(world, sticks(up=-1.0), 6.0 if mode == "POSITION" else 4.5)
    for _ in range(5):
        stream(world, lambda t: sticks(up=-1.0 if t % 0.4 < 0.3 else 0.5), 0.8)
    world.gcs.streams["sticks"] = lambda: sticks(up=-1.0)
    world.run_until("not armed", 10.0)
    assert set(world.texts) <= USUAL_TEXTS
    assert world.state.altitude_m < 0.02


def test_a_vehicle_that_tips_over_on_the_ground_is_disarmed_and_does_not_arm() -> None:
    """The ground may hold a vehicle against its reference, but not upside down."""
    world = World(vehicle="x_quad")
    stream(world, attitude(level(), 0.0), 0.2)
    world.set_mode("OFFBOARD")
    world.arm()
    stream(world, attitude((math.cos(0.35), 0.0, math.sin(0.35), 0.0), 0.24), 3.0)  # 40°, half the weight
    assert "Attitude is beyond its limits: disarming" in world.texts
    assert not world.state.armed
    with refused(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "tilted by more than 30 degrees"):
        world.arm()


# ---------------------------------------------------------------------- never in the air

FAST = {"MPC_TKO_SPEED": 5, "MPC_Z_VEL_MAX_UP": 8, "MPC_ACC_UP_MAX": 5}


def watch_flight(world: World, seconds: float) -> None:
    """Fly on; no contact may be found in the air."""
    navigator = world.engine.stack.parts.navigator
    for _ in range(round(seconds * world.engine.stack.rates.inner_hz)):
        world.tick()
        assert not world.state.landed
        assert world.engine.simulator.on_ground or not navigator.touches_ground, (
            world.time_s,
            world.state.velocity_ned_m_s,
        )


@pytest.mark.parametrize("seed", range(1, 9) if NIGHTLY else [1])
def test_descents_in_gusts_are_no_contact(seed: int) -> None:
    world = hover(
        40.0,
        vehicle="x_quad",
        wind=(8.0, 0.0, -3.0),
        gust=4.0,
        seed=seed,
        params={"MPC_Z_VEL_MAX_DN": 4, **FAST},
    )
    for speed in (4.0, -2.5, 0.1, 4.0, -1.0, 0.3):
        world.gcs.streams["point"] = lambda speed=speed: local_point(velocity=(0.0, 0.0, speed))
        world.run_for(0.1)
        if world.state.mode != "OFFBOARD":
            world.set_mode("OFFBOARD")
        watch_flight(world, 3.0)


@pytest.mark.parametrize(
    "thrust", [lambda _t: 0.0, lambda t: 0.45 + 0.4 * math.sin(9.0 * t), lambda t: 0.9 if t % 1.2 < 0.5 else 0.05],
    ids=["none", "swinging", "in pulses"],
)  # fmt: skip
def test_a_companion_that_throws_the_vehicle_about_is_no_contact(thrust: Callable[[float], float]) -> None:
    world = hover(50.0, vehicle="x_quad", seconds=0.5, params=FAST)
    began_s = world.time_s
    world.gcs.streams["attitude"] = lambda: attitude(level(), max(0.0, thrust(world.time_s - began_s)))
    world.run_for(0.1)
    world.set_mode("OFFBOARD")
    watch_flight(world, 2.5)


@pytest.mark.parametrize("down_m_s", [-5.0, -12.0])
def test_hovering_and_descending_in_an_updraft_is_no_contact(down_m_s: float) -> None:
    world = hover(12.0, vehicle="x_quad", params=FAST, wind=(0.0, 0.0, down_m_s))
    watch_flight(world, 2.0)
    world.land()
    watch_flight(world, 8.0)


def test_a_throttle_at_its_lowest_in_the_air_is_no_contact() -> None:
    world = hover(20.0, vehicle="x_quad", gust=2.0, params=FAST)
    stream(world, sticks(), 0.2)
    world.set_mode("POSITION")
    for up in (-1.0, 1.0, -1.0, 0.0, -0.2):
        world.gcs.streams["sticks"] = lambda up=up: sticks(up=up)
        watch_flight(world, 2.5)


def test_rotors_that_carry_the_vehicle_without_a_command_are_no_landing() -> None:
    """All rotors keep the speed of hovering: the thrust setpoint falls to 0, and the vehicle does not sink."""
    craft = load_vehicle("x_quad")
    lift = sum(rotor.thrust_coefficient_n_s2 for rotor in craft.rotors)
    world = hover(4.0, 1.0, vehicle="x_quad", params={"FD_ACT_EN": 0})
    for rotor in range(1, 5):
        world.fault(f"rotor {rotor} stuck {math.sqrt(craft.weight_n / lift)}")
    world.land()
    for _ in range(1000):
        world.tick()
        assert not world.state.landed
    assert world.state.altitude_m > 3.0
    assert world.engine.stack.now.attitude_target[4] < 0.2 * craft.weight_n


# ---------------------------------------------------------------------- upward forces

PAPER, POLES, NO_INTEGRAL = ("x_quad", "paper"), ("paper_quad", "backstepping_poles"), ("x_quad", "tuned")
FLOATS = [
    (vehicle, gains, mode, share)
    for vehicle, gains in (
        PAPER,
        ("paper_quad", "paper"),
        POLES,
        ("x_quad", "backstepping_poles"),
        NO_INTEGRAL,
    )
    for mode in (Mode.HOLD, Mode.POSITION, Mode.OFFBOARD)
    for share in (0.1, 0.2, 0.3)
]
SOME_FLOATS = [(*PAPER, Mode.HOLD, 0.3), (*POLES, Mode.POSITION, 0.2), (*NO_INTEGRAL, Mode.OFFBOARD, 0.3)]


def enter(world: World, mode: Mode) -> None:
    """Stay in place in this mode, with the setpoint that the vehicle has."""
    if mode is Mode.HOLD:
        return
    north, east, down = world.engine.stack.now.setpoint[:3].tolist()
    maker = sticks if mode is Mode.POSITION else lambda: local_point((north, east, down))
    stream(world, maker(), 0.2)
    world.set_mode(mode)
    world.gcs.streams["hold"] = maker


@pytest.mark.parametrize(("vehicle", "gains", "mode", "share"), FLOATS if NIGHTLY else SOME_FLOATS)
def test_hover_with_an_upward_force_is_no_contact(vehicle: str, gains: str, mode: Mode, share: float) -> None:
    """A lighter battery, a dropped payload, stronger propellers."""
    world = hover(
        2.0, vehicle=vehicle, gains=gains, seconds=0.5,
        controller="backstepping" if gains == "backstepping_poles" else "pid",
        force=(0.0, 0.0, -share * load_vehicle(vehicle).weight_n),
        params={"POS_Z_I": 0} if gains == "tuned" else {},
        **({} if gains == "tuned" else {"inner_hz": 1000.0 if NIGHTLY else 500.0}),
    )  # fmt: skip
    enter(world, mode)
    watch_flight(world, 40.0 if NIGHTLY else 6.0)


@pytest.mark.parametrize(
    ("altitude_m", "north_m_s", "mode"),
    [(0.7, 8.0, Mode.HOLD)]
    + NIGHTLY * [(0.7, 8.0, Mode.POSITION), (10.0, 6.0, Mode.HOLD), (10.0, 6.0, Mode.OFFBOARD)],
)
def test_hover_in_updraft_and_gusts_is_no_contact(altitude_m: float, north_m_s: float, mode: Mode) -> None:
    world = hover(altitude_m, vehicle="x_quad", wind=(north_m_s, 0.0, -6.0), gust=6.0, seconds=0.0)
    enter(world, mode)
    watch_flight(world, 40.0 if NIGHTLY else 8.0)


# ---------------------------------------------------------------------- wind that is too strong


@pytest.mark.parametrize(
    "options",
    [{"vehicle": "x_quad", "wind": (60.0, 0.0, 0.0)}, {"vehicle": "paper_quad", "force": (6.5, 0.0, 0.0)}],
    ids=["wind", "force"],
)
def test_a_wind_that_cannot_be_held_is_noticed_and_ends_the_flight(options: dict[str, object]) -> None:
    """Said after 4 s, disarmed on the ground after 10 s; once it flew on for 25 minutes."""
    world = World(**options)  # type: ignore[arg-type]
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 20.0)
    world.run_for(0.1)
    assert "Position is far from its setpoint: landing" in world.texts
    assert "Disarmed" in world.texts
    assert world.state.altitude_m < 0.1
