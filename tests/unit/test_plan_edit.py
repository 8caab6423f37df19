"""Edits of a mission, and home as its item 0: jumps keep their targets."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.plan import Command, Frame, MissionItem
from gcs_cli.plans.edit import add, change, delete, move
from gcs_cli.plans.home_item import with_home_item, without_home_item
from tests.support.plan_items import HOME, item

COUNT = 6


def numbered(count: int = COUNT) -> tuple[MissionItem, ...]:
    """Waypoints told apart by their hold time."""
    return tuple(item(Command.NAV_WAYPOINT, 10.0 * seq, 0.0, 5.0, p1=float(seq)) for seq in range(count))


def jump(target: int) -> MissionItem:
    return MissionItem(Command.DO_JUMP, Frame.MISSION, float(target), 2.0)


def target_of(items: tuple[MissionItem, ...]) -> float:
    """The hold time of the waypoint that the only DO_JUMP leads to."""
    (found,) = [each for each in items if each.command == Command.DO_JUMP]
    return items[int(found.param1)].param1


SEQ = st.integers(0, COUNT - 1)


@given(target=SEQ, place=st.integers(0, COUNT), seq=st.integers(0, COUNT + 1))
def test_add_keeps_the_targets_of_jumps(target: int, place: int, seq: int) -> None:
    items = add(numbered(), place, jump(target + (target >= place)))
    assert target_of(add(items, seq, item(Command.NAV_WAYPOINT, p1=99.0))) == target_of(items)


@given(target=SEQ, seq=st.integers(0, COUNT), to=st.integers(0, COUNT))
def test_move_keeps_the_targets_of_jumps(target: int, seq: int, to: int) -> None:
    items = (*numbered(), jump(target))
    moved = move(items, seq, to)
    assert target_of(moved) == target
    assert sorted(map(repr, (replace(each, param1=0.0) for each in moved))) == sorted(
        map(repr, (replace(each, param1=0.0) for each in items))
    )


@given(target=SEQ, seq=SEQ)
def test_delete_keeps_the_targets_of_jumps(target: int, seq: int) -> None:
    items = delete((*numbered(), jump(target)), seq)
    if target != seq:
        assert target_of(items) == target
    assert len(items) == COUNT


def test_change_sets_position_and_fields() -> None:
    items = change(numbered(2), 1, latitude=47.5, longitude=8.25, z=12.0)
    assert (items[1].position_deg, items[1].z) == ((47.5, 8.25), 12.0)
    assert items[0] == numbered(2)[0]


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"latitude": 91.0}, "latitude 91 is outside"),
        ({"colour": 1}, "colour is not a field"),
    ],
)
def test_change_refuses_bad_values(values: dict[str, float], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        change(numbered(), 0, **values)
    with pytest.raises(ValueError, match="item 9: the numbers are 0 to 5"):
        delete(numbered(), 9)


def test_home_item_shifts_jumps_and_comes_off_again() -> None:
    items = (*numbered(3), jump(1))
    stored = with_home_item(items, HOME)
    assert (stored[0].position_deg, stored[0].z, stored[0].frame) == (HOME[:2], HOME.altitude_m, Frame.GLOBAL)
    assert stored[4].param1 == 2.0
    assert without_home_item(stored) == items
    assert math.isnan(items[0].param4)
