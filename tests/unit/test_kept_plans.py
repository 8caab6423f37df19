"""Plans that survive a restart: the text that holds them, and the file that a process keeps."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core import atomic_file
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.mission_messages import mission_id
from flightstack.params.config import DEFAULT_HOME, TRUTH, StackConfig
from flightstack.plan import MissionItem, MissionType, load_plan
from flightstack.plan.item import UNSET_E7
from flightstack.plan.kept_plans import KeptPlans, plans_from_text, plans_to_text
from flightstack.process.assembly import Stack, build
from flightstack.process.state_directory import PlanFile
from flightstack.services.routing.peer import PeerAddress

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
PEER = PeerAddress(GROUND, "127.0.0.1", 5000)
NEAR_HOME = DEFAULT_HOME._replace(altitude_m=489.0)

numbers = st.floats(width=32)
whole = st.integers(-(2**31), 2**31 - 1)
items = st.builds(
    MissionItem, st.integers(0, 65535), st.integers(0, 255), numbers, numbers, numbers, numbers, whole, whole, numbers,
    st.booleans(),
)  # fmt: skip
plans = st.lists(items, max_size=5).map(tuple)
homes = st.none() | st.builds(GeoPoint, *3 * [st.floats(allow_nan=False, allow_infinity=False)])


@given(st.builds(KeptPlans, plans, plans, plans, st.integers(0, 1000), homes))
def test_saved_plans_are_read_with_same_ids(kept: KeptPlans) -> None:
    read = plans_from_text(plans_to_text(kept), "file")
    assert read == kept
    assert [mission_id(part) for part in read[:3]] == [mission_id(part) for part in kept[:3]]


KEPT = plans_to_text(KeptPlans(mission=(MissionItem(16, 3, math.nan, x=UNSET_E7, z=5.0),), current=0))


def changed(**values: object) -> str:
    return json.dumps({**json.loads(KEPT), **values})


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is damaged or truncated"),
        (KEPT[:-20], "is damaged or truncated"),
        ("[]", "is not a file of saved plans"),
        (changed(fileType="Plan"), "is not a file of saved plans"),
        (changed(version=2), "is of version 2, and this program reads version 1"),
        (changed(version=None), "is of version None, and"),
        (changed(plans=None), "its checksum is wrong"),
        (KEPT.replace("5.0", "6.0"), "its checksum is wrong"),
        (KEPT.replace('"current": 0', '"current": 1'), "its checksum is wrong"),
    ],
)
def test_truncated_file_is_refused(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=f"^file: .*{problem}"):
        plans_from_text(text, "file")


@given(st.text() | st.binary().map(lambda data: data.decode("latin-1")))
def test_any_text_is_read_or_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        plans_from_text(text, "file")


# ---------------------------------------------------------------------- the file of a process


def stack_with(path: Path, *params: str) -> tuple[Stack, PlanFile, str | None]:
    """Start a vehicle that keeps its plans at ``path``; return the sentence about them, too."""
    stack = build(StackConfig(params=params, state=TRUTH), lambda: None)
    file = PlanFile(path)
    return stack, file, file.restore(stack)


def give(stack: Stack, name: str) -> KeptPlans:
    plan = load_plan(MISSIONS / name)
    on_wire = (tuple(item.on_wire() for item in part) for part in (plan.items, plan.fence, plan.rally))
    kept = KeptPlans(*on_wire, current=2, home=NEAR_HOME)
    assert stack.ground.restore_plans(kept) is None
    return kept


def save(stack: Stack, file: PlanFile) -> None:
    file.watch(stack)
    file.close()
    assert file.take_error() is None


def test_all_plans_survive_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "state" / "plans.json"
    stack, file, problem = stack_with(path)
    assert problem is None
    kept = give(stack, "fenced_square.plan")
    assert kept.fence
    save(stack, file)
    again, file, problem = stack_with(path)
    assert problem is None
    assert again.ground.plans() == kept
    assert again.places.ids == stack.places.ids
    assert again.now.progress.current == 2
    assert again.area.home == NEAR_HOME
    before = path.stat().st_mtime_ns
    save(again, file)
    assert path.stat().st_mtime_ns == before, "nothing changed, nothing is written"


def test_a_vehicle_without_plans_writes_no_file(tmp_path: Path) -> None:
    stack, file, _ = stack_with(tmp_path / "plans.json")
    save(stack, file)
    assert os.listdir(tmp_path) == []


def test_a_cleared_plan_stays_cleared(tmp_path: Path) -> None:
    path = tmp_path / "plans.json"
    stack, file, _ = stack_with(path)
    give(stack, "square.plan")
    save(stack, file)
    stack, file, _ = stack_with(path)
    clear = mavlink.MAVLink_mission_clear_all_message(1, 1, MissionType.MISSION)
    stack.ground.receive(PEER, Link(255, 190).encode(clear), 0.0)
    assert list(stack.ground.poll(0.0))
    save(stack, file)
    assert stack_with(path)[0].ground.plans().mission == ()


def test_a_damaged_file_gives_no_plan_and_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / "plans.json"
    for number in ("", "-2"):
        path.write_text(KEPT[:-20])
        stack, file, problem = stack_with(path)
        aside = tmp_path / f"plans.refused{number}.json"
        assert problem == (f"plans not restored: {path}: is damaged or truncated; the file is now {aside}")
        assert stack.ground.plans() == KeptPlans()
        give(stack, "square.plan")
        save(stack, file)
        assert aside.read_text() == KEPT[:-20]
        assert path.exists()


def test_a_plan_that_limits_refuse_is_put_aside_and_the_fence_stays(tmp_path: Path) -> None:
    path = tmp_path / "plans.json"
    stack, file, _ = stack_with(path)
    kept = give(stack, "fenced_square.plan")
    save(stack, file)
    text = path.read_text()
    stack, file, problem = stack_with(path, "GF_MAX_VER_DIST=2")
    assert problem is not None
    assert problem.startswith("plans not restored: mission: ")
    assert stack.ground.plans() == kept._replace(mission=(), current=0)
    save(stack, file)
    assert (tmp_path / "plans.refused.json").read_text() == text
    assert stack_with(path)[0].ground.plans() == kept._replace(mission=(), current=0)


def test_a_home_that_is_refused_takes_all_plans_along(tmp_path: Path) -> None:
    path = tmp_path / "plans.json"
    path.write_text(
        plans_to_text(KeptPlans(load_plan(MISSIONS / "square.plan").items, home=GeoPoint(0.0, 0.0, 0.0)))
    )
    stack, _, problem = stack_with(path)
    assert problem is not None
    assert "home: home is more than 100 km from where the vehicle started" in problem
    assert stack.ground.plans() == KeptPlans()


def test_a_write_that_breaks_off_leaves_the_old_plans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "plans.json"
    stack, file, _ = stack_with(path)
    old = give(stack, "square.plan")
    save(stack, file)
    stack, file, _ = stack_with(path)
    give(stack, "hop.plan")

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic_file.os, "fsync", fail)
    file.watch(stack)
    file.close()
    assert file.take_error() == f"the plans are not saved to {path}: No space left on device"
    assert stack_with(path)[0].ground.plans() == old
    assert os.listdir(tmp_path) == ["plans.json"]
