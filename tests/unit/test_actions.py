"""Actions on our vehicle in one process: an action is done when the vehicle reports its effect."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from gcs_cli.actions import in_flight, in_mission, on_vehicle
from gcs_cli.actions.action import Action
from gcs_cli.actions.conditions import ConditionError, parse_condition
from gcs_cli.actions.run import ActionRun, Outcome, Result
from gcs_cli.clients.command_client import ModeClient
from gcs_cli.commands import actions
from gcs_cli.vehicle.view_types import VehicleView
from tests.support.folded_vehicle import HOLD_MODE, Vehicle, heartbeat
from tests.support.truth import World

LIMIT_S = 200.0
TERMINATION_MODE = 10 << 16


@pytest.fixture
def world() -> Iterator[World]:
    with World(telemetry=True) as made:
        made.run_for(2.0)
        yield made


@pytest.fixture
def flying(world: World) -> World:
    assert perform(world, in_flight.takeoff(5.0))[:2] == (Outcome.DONE, "at 5 m")
    return world


def perform(world: World, action: Action, *, waits: bool = True) -> Result:
    session = world.sender.session
    run = ActionRun(action, lambda: session.view, world.time_s, session.own, waits=waits)
    session.use(run)
    end_s = world.time_s + LIMIT_S
    while run.result is None and world.time_s < end_s:
        world.step()
    session.use(None)
    assert run.result is not None
    return run.result


def seen(world: World) -> VehicleView:
    return world.sender.session.view


def test_arm_and_disarm_end_when_the_vehicle_reports_it(world: World) -> None:
    assert perform(world, on_vehicle.arm())[:2] == (Outcome.DONE, "armed")
    assert seen(world).armed
    assert perform(world, on_vehicle.disarm())[:2] == (Outcome.DONE, "disarmed")
    assert not seen(world).armed


def test_takeoff_ends_at_the_altitude(flying: World) -> None:
    assert flying.state.altitude_m == pytest.approx(5.0, abs=0.6)


def test_takeoff_counts_from_the_ground_to_which_home_moves(world: World) -> None:
    """As the vehicle arms; before, home may be metres off, because the estimated altitude drifts."""
    area = world.engine.stack.area
    area.set_home(area.home._replace(altitude_m=area.home.altitude_m + 2.0), chosen=False)
    world.run_for(2.1)  # HOME_POSITION is sent every 2 s
    assert perform(world, in_flight.takeoff(5.0))[:2] == (Outcome.DONE, "at 5 m")
    assert seen(world).relative_altitude_m == pytest.approx(5.0, abs=0.6)
    assert world.state.altitude_m == pytest.approx(5.0, abs=0.6)


def test_takeoff_without_an_altitude_goes_to_the_vehicles_own(world: World) -> None:
    assert perform(world, in_flight.takeoff())[:2] == (Outcome.DONE, "took off")
    assert seen(world).mode == "HOLD"
    assert world.state.altitude_m == pytest.approx(world.param_get("MIS_TAKEOFF_ALT"), abs=0.6)


@pytest.mark.parametrize("action", [in_flight.land(), in_flight.return_to_launch()], ids=["land", "rtl"])
def test_landings_end_when_the_vehicle_has_disarmed(flying: World, action: Action) -> None:
    assert perform(flying, action).outcome is Outcome.DONE
    assert not flying.state.armed
    assert flying.state.altitude_m < 0.2


def test_goto_ends_at_the_position_and_hold_stops_on_the_way(flying: World) -> None:
    home = seen(flying).home
    assert home is not None
    north_deg = home.latitude_deg + 20.0 / 111_195.0
    assert perform(flying, in_flight.goto(north_deg, home.longitude_deg, 6.0)).outcome is Outcome.DONE
    assert flying.state.north_m == pytest.approx(20.0, abs=1.1)
    assert flying.state.altitude_m == pytest.approx(6.0, abs=0.6)
    back = in_flight.goto(home.latitude_deg, home.longitude_deg)
    assert perform(flying, back, waits=False).outcome is Outcome.ACKNOWLEDGED
    flying.run_for(3.0)
    assert perform(flying, in_flight.hold())[:2] == (Outcome.DONE, "holding the position")
    assert 2.0 < flying.state.north_m < 19.0


def test_yaw_ends_at_the_heading(flying: World) -> None:
    assert perform(flying, in_flight.yaw(270.0))[:2] == (Outcome.DONE, "pointing to 270 degrees")


def test_speed_ends_with_the_acknowledgement(flying: World) -> None:
    assert perform(flying, in_flight.speed(2.0))[:2] == (
        Outcome.ACKNOWLEDGED,
        "accepted: speed 2 m/s; the vehicle does not report its speed setting",
    )
    assert perform(flying, in_flight.speed(None)).ok


def test_mode_ends_when_the_heartbeat_has_it(flying: World) -> None:
    assert perform(flying, on_vehicle.select_mode("land"))[:2] == (Outcome.DONE, "mode land")
    result = perform(flying, on_vehicle.select_mode("acro"))
    assert result[:2] == (Outcome.REFUSED, "mode acro refused: this vehicle has no such mode")


def test_set_home_ends_when_the_vehicle_reports_the_place(world: World) -> None:
    home = seen(world).home
    assert home is not None
    place = (home.latitude_deg + 1e-4, home.longitude_deg, home.altitude_m)
    assert perform(world, on_vehicle.set_home(place)).outcome is Outcome.DONE
    moved = seen(world).home
    assert moved is not None
    assert moved.latitude_deg == pytest.approx(place[0], abs=1e-6)


def test_mission_start_ends_when_the_mission_runs(world: World) -> None:
    result = perform(world, in_flight.start_mission())
    assert result[:2] == (Outcome.REFUSED, "mission start refused: no mission is loaded")
    world.upload("hop")
    assert perform(world, in_flight.start_mission())[:2] == (Outcome.DONE, "mission started")
    assert (seen(world).mode, seen(world).armed) == ("MISSION", True)


def test_a_refused_start_names_the_item_where_the_mission_continues(world: World) -> None:
    world.upload("hop")
    assert perform(world, in_mission.jump(1)).outcome is Outcome.DONE
    result = perform(world, in_flight.start_mission())
    assert result[:2] == (
        Outcome.REFUSED,
        "mission start refused: the vehicle is on the ground and the mission continues with a landing or a return; "
        "the mission is at item 1 (last 1): `gcs mission jump 0`, then start, flies it from its first item",
    )
    assert perform(world, in_mission.jump(0)).outcome is Outcome.DONE
    assert perform(world, in_flight.start_mission()).outcome is Outcome.DONE


@pytest.mark.parametrize(
    "action", [on_vehicle.terminate(), on_vehicle.disarm(force=True)], ids=lambda a: a.name
)
def test_rotors_are_stopped_also_without_a_heartbeat(action: Action) -> None:
    """The vehicle may still receive: a busy ground station, or a link that fails in one direction."""
    vehicle = Vehicle()
    vehicle.send(heartbeat(base=129))
    run = ActionRun(action, lambda: vehicle.view, 1.0, Address(255, 190))
    for now_s in range(20, 60):
        if run.result is None:
            sent = run.poll(float(now_s))
            assert now_s > 20 or [message.get_type() for message in sent] == ["COMMAND_LONG"]
    assert run.result is not None
    assert run.result.outcome is Outcome.SILENT
    run = ActionRun(in_flight.takeoff(5.0), lambda: vehicle.view, 1.0, Address(255, 190))
    assert run.poll(20.0) == []
    assert run.result is not None
    assert run.result.sentence == "takeoff: the vehicle was lost"


def test_termination_ends_when_the_vehicle_reports_it(flying: World) -> None:
    assert perform(flying, on_vehicle.terminate())[:2] == (Outcome.DONE, "flight terminated")
    assert seen(flying).mode == "TERMINATION"


def test_a_terminated_vehicle_may_be_terminated_again(flying: World) -> None:
    assert perform(flying, on_vehicle.terminate()).outcome is Outcome.DONE
    assert perform(flying, on_vehicle.terminate())[:2] == (Outcome.DONE, "flight terminated")


@pytest.mark.parametrize(
    ("state", "mode", "expected"),
    [
        (8, TERMINATION_MODE, Outcome.DONE),
        (8, HOLD_MODE, Outcome.REFUSED),  # the kill switch
        (4, HOLD_MODE, Outcome.REFUSED),
    ],
)
def test_px4_may_refuse_a_second_termination(state: int, mode: int, expected: Outcome) -> None:
    """It refuses each change out of that mode, also the one into itself."""
    vehicle = Vehicle()
    vehicle.send(heartbeat(base=129, mode=mode, state=state))
    run = ActionRun(on_vehicle.terminate(), lambda: vehicle.view, 1.0, Address(255, 190))
    assert [message.get_type() for message in run.poll(1.0)] == ["COMMAND_LONG"]
    refused = mavlink.MAVLink_command_ack_message(
        mavlink.MAV_CMD_DO_FLIGHTTERMINATION, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, 0, 0, 255, 190
    )
    for answer in Link(1, 1).decode(vehicle.link.encode(refused)):
        run.receive(answer, 1.1)
    run.poll(1.1)
    run.poll(2.0)
    assert run.result is not None
    assert run.result.outcome is expected


def test_an_injected_failure_needs_permission(world: World) -> None:
    assert perform(world, on_vehicle.inject_failure("gps", "off")).outcome is Outcome.REFUSED


def test_an_accepted_failure_ends_without_a_claim_about_its_effect() -> None:
    with World(telemetry=True, params={"SYS_FAILURE_EN": 1}) as world:
        world.run_for(2.0)
        assert perform(world, on_vehicle.inject_failure("motor", "off", 2))[:2] == (
            Outcome.ACKNOWLEDGED,
            "accepted: failure of motor 2: off; the vehicle does not report its effect",
        )
        refused = perform(world, on_vehicle.inject_failure("gps", "off"))
        assert refused[:2] == (
            Outcome.REFUSED,
            "failure injection refused: the simulator does not support this failure, or sends no such sensor",
        )


def test_ready_follows_the_pre_arm_check(world: World) -> None:
    ready = parse_condition("ready")
    world.run_until(lambda _state: ready.holds(seen(world)), timeout_s=30.0)
    assert perform(world, on_vehicle.arm()).ok


def test_the_vehicle_lists_its_modes(world: World) -> None:
    session = world.sender.session
    client = ModeClient(lambda: session.view, session.own, world.time_s)
    session.use(client)
    while client.result is None:
        world.step()
    assert client.result
    assert list(on_vehicle.mode_choices(session.view)) == [
        "HOLD", "TAKEOFF", "MISSION", "RTL", "LAND", "POSITION", "ALTITUDE", "OFFBOARD"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("armed", "disarmed"),
        ("landed", "on the ground"),
        ("altitude<1", "m"),
        ("mode=hold", "mode HOLD"),
        ("item>=3", "0"),
    ],
)
def test_conditions_name_the_present_value(world: World, text: str, value: str) -> None:
    assert value in parse_condition(text).value(seen(world))


@pytest.mark.parametrize(
    "text", ["flying", "altitude", "altitude>high", "position=1", "color=red", "mode>HOLD"]
)
def test_conditions_that_are_not_understood_are_refused(text: str) -> None:
    with pytest.raises(ConditionError, match=text):
        parse_condition(text)


def test_position_conditions_have_a_radius(world: World) -> None:
    geo = seen(world).geo
    assert geo is not None
    near = f"position={geo.latitude_deg + 5e-5:.7f},{geo.longitude_deg:.7f}"  # 5.6 m away
    assert not parse_condition(near).holds(seen(world))
    assert parse_condition(f"{near},10").holds(seen(world))


def test_a_generic_vehicle_takes_off_holds_and_lands_by_standard_commands() -> None:
    """The vehicle names no modes, and its altitudes are above home."""
    with World(params={"FS_AUTOPILOT": 1}, telemetry=True) as world:
        world.run_for(2.0)
        assert seen(world).autopilot.name == "generic"
        assert perform(world, in_flight.takeoff(4.0))[:2] == (Outcome.DONE, "at 4 m")
        assert world.state.altitude_m == pytest.approx(4.0, abs=0.6)
        home = seen(world).home
        assert home is not None
        north_deg = home.latitude_deg + 10.0 / 111_195.0
        assert perform(world, in_flight.goto(north_deg, home.longitude_deg)).ok
        assert perform(world, in_flight.hold()).ok
        assert perform(world, in_flight.yaw(180.0)).ok
        assert perform(world, in_flight.land())[:2] == (Outcome.DONE, "landed and disarmed")


@pytest.mark.parametrize(
    ("command", "words"),
    [("speed", ["-2"]), ("goto", ["-33.5", "-70.1", "--alt", "5"]), ("set-home", ["-33.5", "-70.1", "-4"])],
)
def test_negative_numbers_need_no_separator(command: str, words: list[str]) -> None:
    group = get_command(actions.app)
    assert isinstance(group, TyperGroup)
    parameters = group.commands[command].make_context(command, list(words)).params
    numbers = [value for value in parameters.values() if isinstance(value, float)]
    numbers += parameters.get("place") or []
    assert set(numbers) >= {float(word) for word in words if word != "--alt"}
