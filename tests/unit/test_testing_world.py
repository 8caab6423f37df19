"""The world: requests and refusals, time limits, clients and their links, repeatability, power."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

import flightstack.testing
from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.plan import MissionType
from flightstack.testing import (
    ConditionTimeoutError,
    Flight,
    RefusedError,
)
from gcs_cli.link import calls
from tests.support.truth import World


@pytest.fixture
def world() -> Iterator[World]:
    with World(vehicle="x_quad") as made:
        yield made


@pytest.fixture(scope="module")
def flight() -> Flight:
    """One flight of the square in gusts, for all that only reads it."""
    with World(vehicle="x_quad", wind=(3.0, 1.0), gust=1.0, seed=5) as made:
        return made.fly("square")


# ---------------------------------------------------------------------- requests


def test_takeoff_counts_from_the_ground_to_which_home_moves(world: World) -> None:
    area = world.engine.stack.area
    area.set_home(area.home._replace(altitude_m=area.home.altitude_m + 1.0), chosen=False)
    world.takeoff(3.0)
    assert world.run_until("mode == 'HOLD'").altitude_m == pytest.approx(3.0, abs=0.5)


def test_requests_change_the_state(world: World) -> None:
    world.takeoff(3.0)
    assert world.state.armed
    world.run_until("altitude_m > 2.9 and mode == 'HOLD'", timeout_s=20.0)
    world.goto(4.0, -3.0)
    state = world.run_until(lambda s: math.hypot(s.north_m - 4.0, s.east_m + 3.0) < 0.3, timeout_s=20.0)
    assert state.distance_to_home_m == pytest.approx(5.0, abs=0.5)
    world.set_mode("RETURN")
    assert world.state.mode == "RETURN"
    assert not world.run_until("landed and not armed", timeout_s=60.0).failsafe
    assert world.texts[-1] == "Disarmed"


def test_refusal_has_the_reason_of_the_vehicle(world: World) -> None:
    with pytest.raises(RefusedError, match=r"^the start of the mission refused: ") as caught:
        world.start_mission()
    assert caught.value.reason
    assert not caught.value.is_silent


def test_unknown_mode_names_the_modes(world: World) -> None:
    with pytest.raises(ValueError, match=f"no mode 'FLY'; the modes are {', '.join(Mode.__members__)}"):
        world.set_mode("FLY")


def test_parameters_are_read_and_set(world: World) -> None:
    world.param_set("MIS_TAKEOFF_ALT", 4.0)
    assert world.param_get("MIS_TAKEOFF_ALT") == 4.0
    with pytest.raises(RefusedError, match="NO_SUCH"):
        world.param_get("NO_SUCH")


def test_unknown_parameter_suggests_one_of_the_vehicle() -> None:
    with World() as world:
        for ask in (
            lambda: world.param_get("mis_takeoff_al"),
            lambda: world.param_set("MIS_TAKEOFF_AL", 4.0),
        ):
            with pytest.raises(RefusedError, match=r"no such parameter; did you mean MIS_TAKEOFF_ALT\?$"):
                ask()
        with pytest.raises(RefusedError, match=r"no such parameter$"):
            world.param_get("ZZZ")


def test_plan_comes_back_as_it_was_uploaded(world: World) -> None:
    world.upload("fenced_square")
    assert [item.command for item in world.download()] == [item.command for item in world.plan.items]
    assert world.download(MissionType.FENCE)


def test_missing_plan_is_an_error(world: World, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no_such"):
        world.upload("no_such.plan")


# ---------------------------------------------------------------------- time


def test_arming_waits_until_a_vehicle_on_its_sensors_is_ready() -> None:
    with flightstack.testing.World() as sensed:
        assert sensed.setup.state == "estimated"
        assert not sensed.engine.stack.is_ready
        sensed.arm()
        assert 0.4 < sensed.time_s < 3.0  # alignment and first fix: 1.1 s
        sensed.disarm()
        before_s = sensed.time_s
        sensed.arm()
        assert sensed.time_s == before_s


def test_request_over_a_perfect_link_takes_no_time(world: World) -> None:
    before_s = world.time_s
    world.arm()
    world.param_get("MIS_TAKEOFF_ALT")
    assert world.time_s == before_s


def test_request_over_a_slow_link_takes_the_time_of_both_ways(world: World) -> None:
    world.param_get("MIS_TAKEOFF_ALT")
    world.link.delay_s(0.2)
    before_s = world.time_s
    world.arm()
    assert 0.4 <= world.time_s - before_s <= 0.43  # and one period of the outer loop each way


def test_first_request_waits_for_the_heartbeat_of_a_slow_link(world: World) -> None:
    world.link.delay_s(0.2)
    world.arm()
    assert world.state.armed
    assert 0.6 <= world.time_s <= 0.65


def test_condition_that_stays_false_ends_with_the_state(world: World) -> None:
    before_s = world.time_s
    with pytest.raises(ConditionTimeoutError) as caught:
        world.run_until("altitude_m > 2", timeout_s=0.5)
    assert str(caught.value).startswith(
        "'altitude_m > 2' did not come true within 0.5 s of simulated time; t = "
    )
    assert 0.5 <= world.time_s - before_s <= 0.515  # one more period: the limit itself counts


def test_timers_and_watches_follow_simulated_time(world: World) -> None:
    at: list[float] = []
    ticks: list[float] = []
    world.after(0.3, lambda: at.append(world.time_s))
    world.watch(lambda: ticks.append(world.time_s))
    world.run_for(1.0)
    assert at == [pytest.approx(0.3, abs=0.011)]
    assert len(ticks) == 100


# ---------------------------------------------------------------------- clients and links


def test_clients_have_names_and_links_of_their_own(world: World) -> None:
    other = world.add_client("tablet")
    with pytest.raises(ValueError, match="tablet"):
        world.add_client("tablet")
    world.run_for(1.0)
    other.link.cut()
    before = dict(other.counts)
    world.run_for(2.0)
    assert other.counts == before
    assert world.gcs.counts["HEARTBEAT"] > before["HEARTBEAT"]


def test_clients_have_system_ids_of_their_own(world: World) -> None:
    for name, system_id in (("tablet", None), ("companion", 100), ("phone", None)):
        world.add_client(name, is_companion=name == "companion", system_id=system_id)
    assert [client.system_id for client in world.clients.values()] == [255, 254, 100, 253]
    with pytest.raises(ValueError, match="system_id must be 1 to 255, not 256"):
        world.add_client("watch", system_id=256)


def test_answer_goes_to_the_client_that_asked(world: World) -> None:
    tablet = world.add_client("tablet")
    world.request("arming", calls.ARM, tablet)
    assert tablet.received["COMMAND_ACK"].target_system == tablet.system_id == 254
    assert "COMMAND_ACK" not in world.gcs.received
    world.wait_for(tablet.parameter("MIS_TAKEOFF_ALT", 3.0), "the altitude")
    world.wait_for(tablet.upload(world.setup.load_plan("hop")), "the plan")
    assert tablet.received["MISSION_ACK"].target_system == 254
    assert world.param_get("MIS_TAKEOFF_ALT") == 3.0
    assert len(world.download()) == 2
    assert world.gcs.received["MISSION_COUNT"].target_system == 255


def test_request_over_a_cut_link_is_not_answered(world: World) -> None:
    world.run_for(0.5)
    world.link.cut()
    with pytest.raises(RefusedError, match="arming not answered") as caught:
        world.arm()
    assert caught.value.is_silent


@pytest.mark.parametrize("inner_hz", [250.0, 500.0, 1000.0])
def test_cut_link_fails_safe_after_the_same_time_at_any_rate(inner_hz: float) -> None:
    with World(vehicle="x_quad", inner_hz=inner_hz) as world:
        world.takeoff(3.0)
        world.run_until("altitude_m > 2.5", timeout_s=20.0)
        world.link.cut()
        cut_s = world.time_s
        lost_s = world.run_until(lambda state: state.failsafes, timeout_s=60.0).time_s - cut_s
        assert world.state.failsafes == ("GCS_LOST",)
        assert 8.9 <= lost_s <= 10.1  # COM_DL_LOSS_T after the last heartbeat, up to 1 s before the cut


def test_companion_does_not_count_as_data_link(world: World) -> None:
    world.add_client("companion", is_companion=True)
    world.takeoff(3.0)
    world.run_until("altitude_m > 2.5", timeout_s=20.0)
    world.link.cut()
    assert "GCS_LOST" in world.run_until(lambda state: state.failsafes, timeout_s=60.0).failsafes


def test_request_before_any_contact_is_not_answered(world: World) -> None:
    world.link.cut()
    with pytest.raises(RefusedError, match="arming not answered"):
        world.arm()


def test_fault_of_a_link_ends_after_its_time(world: World) -> None:
    world.link.loss(0.25)
    world.fault("link to_vehicle cut", for_s=0.5)
    assert world.link.to_vehicle.conditions.is_cut
    assert not world.link.from_vehicle.conditions.is_cut
    world.run_for(0.6)
    assert world.link.to_vehicle.conditions.loss == 0.25
    assert not world.link.to_vehicle.conditions.is_cut


# ---------------------------------------------------------------------- repeatability


def flown_bytes(seed: int, *, lossy: bool = True) -> bytes:
    with World(vehicle="x_quad", gust=2.0, wind=(2.0, 0.0), seed=seed, telemetry=True) as world:
        if lossy:
            world.link.loss(0.2)
            world.link.garbage(0.05)
            world.link.reordering(0.2)
        world.takeoff(2.0)
        world.run_for(3.0)
        world.fault("rotor:1:weak=0.9", for_s=0.5)
        world.run_for(1.0)
        return world.flight().log.content


def test_equal_calls_give_equal_logs() -> None:
    assert flown_bytes(3) == flown_bytes(3)


def test_another_seed_gives_another_flight() -> None:
    assert flown_bytes(3, lossy=False) != flown_bytes(4, lossy=False)


# ---------------------------------------------------------------------- power


def test_power_cycle_keeps_parameters_and_plans(world: World) -> None:
    world.param_set("MIS_TAKEOFF_ALT", 4.0)
    world.upload("square")
    items = world.download()
    before_s = world.time_s
    world.power_cycle(off_s=2.0)
    assert world.time_s >= before_s
    assert world.param_get("MIS_TAKEOFF_ALT") == 4.0
    assert world.download() == items
    assert world.fly("hop").completed


def test_world_time_goes_on_while_the_vehicle_boots_again(world: World) -> None:
    world.arm()
    world.run_for(5.0)
    flown = world.flight()
    before_s = world.time_s
    world.power_cycle(off_s=2.0)
    assert world.time_s == world.state.time_s == pytest.approx(before_s + 2.0, abs=0.011)
    world.run_for(3.0)
    assert world.time_s == pytest.approx(before_s + 5.0, abs=0.011)
    assert world.gcs.received["ATTITUDE"].time_boot_ms == pytest.approx(3000, abs=1010)
    world.arm()  # the ground station goes on to send heartbeats
    world.run_for(1.0)
    again = world.flight()
    assert [event.name for event in world.events] == ["power_cycle"]
    assert flown.signals.time_s[-1] < world.events[0].time_s < again.signals.time_s[0]
    begins_s = [again.signals.time_s[0], again.log.texts[0].time_s, again.log["vehicle_status"].time_s[0]]
    assert begins_s == pytest.approx([before_s + 5.0] * 3, abs=0.011)


def test_power_cycle_in_the_air_drops_the_vehicle(world: World) -> None:
    world.takeoff(5.0)
    world.run_until("altitude_m > 4.5", timeout_s=20.0)
    before = world.flight().log.content
    world.power_cycle(off_s=3.0)
    world.run_for(0.1)
    assert not world.state.armed
    assert world.state.altitude_m < 0.1
    assert len(before) > 1000
