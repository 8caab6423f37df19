"""The screen Mission: rows, drafts and item forms, and the screen driven by keys."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Command, Frame, Plan
from gcs_cli.actions.in_mission import jump
from gcs_cli.errors import FAILED, CliError
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.mission.draft import MissionDraft
from gcs_cli.tui.mission.item_form import item_entries, item_of_texts
from gcs_cli.tui.mission.rows import (
    Progress,
    meaning,
    mission_columns,
    mission_progress,
    mission_row,
    summary,
    to_go,
)
from gcs_cli.tui.orders.form import Confirm
from gcs_cli.tui.palette import DARK
from gcs_cli.tui.widgets.entry_form import EntryForm
from gcs_cli.vehicle.view_types import Identity
from tests.support.map_views import item
from tests.support.mission_stories import FLYING, ITEMS, TABLE, answer, drive, said
from tests.support.pictures import check_picture
from tests.support.pilots import run_story
from tests.support.screens import shown
from tests.support.still_feed import StillFeed


def test_distance_to_go_is_from_the_vehicle_in_flight_and_from_the_start_before():
    progress = mission_progress(TABLE, FLYING)
    assert progress[:2] == (1, 0)
    assert to_go(TABLE, 0, progress) is None
    metres, seconds = to_go(TABLE, 3, progress)
    assert metres == pytest.approx(50.0, abs=0.01)  # measured: 1e-3, the rounding of the coordinates
    assert seconds == pytest.approx(5.0 + 15.0, abs=0.01)
    assert to_go(TABLE, 3, Progress()) == (TABLE.stops[3].distance_m, TABLE.stops[3].time_s)
    assert summary(TABLE, progress) == "item 1 of 5 items, 86 m and 0:38 to go"


def test_all_items_of_a_complete_mission_are_reached():
    view = FLYING._replace(mission=FLYING.mission._replace(state=mavlink.MISSION_STATE_COMPLETE))
    progress = mission_progress(TABLE, view)
    columns = mission_columns(118, in_flight=False)
    assert [mission_row(TABLE, seq, progress, columns, DARK).plain[0] for seq in range(5)] == ["✓"] * 5


@pytest.mark.parametrize("width", [78, 118, 198])
def test_row_of_an_item_fits_and_marks_progress(width):
    columns = mission_columns(width, in_flight=True)
    rows = [mission_row(TABLE, seq, mission_progress(TABLE, FLYING), columns, DARK).plain for seq in range(5)]
    assert [row[0] for row in rows] == ["✓", "▶", " ", " ", " "]
    assert max(map(len, rows)) <= width
    assert rows[3].split()[:2] == ["3", "WAYPOINT"]
    assert "30.0 m" in rows[3]
    assert "090°" in rows[3]


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ((Command.NAV_WAYPOINT, 3.0), "3 s"),
        ((Command.DO_CHANGE_SPEED, 1.0, 4.0), "4 m/s"),
        ((Command.DO_JUMP, 2.0, -1.0), "→ 2 ×∞"),
        ((Command.NAV_LAND,), ""),
    ],
)
def test_parameters_are_said_in_words(fields, text):
    command, *params = fields
    assert meaning(item(command, **{f"param{n}": value for n, value in enumerate(params, 1)})) == text


def test_draft_follows_the_vehicle_until_it_is_edited():
    first, second = Plan(ITEMS), Plan(ITEMS[:2])
    draft = MissionDraft().followed(first, 1)
    assert (draft.plan, draft.is_changed) == (first, False)
    edited = draft.edited(ITEMS[:3])
    assert edited.is_changed
    assert edited.followed(second, 2).plan.items == ITEMS[:3]
    assert edited.followed(second, 2).system_id == 1
    assert edited.undone().plan == first
    assert not edited.undone().is_changed
    uploaded = edited.uploaded(1)
    assert not uploaded.is_changed
    assert uploaded.followed(first, 1).plan.items == ITEMS[:3]  # the vehicle's new plan is not read yet
    assert uploaded.followed(second, 1).plan is second


def test_item_form_returns_the_item_it_shows():
    for each in ITEMS:
        texts = [entry.value for entry in item_entries(each)]
        assert item_of_texts(each, texts) == each


def test_item_form_changes_command_place_and_frame():
    texts = ["waypoint", "47.5", "8.5", "500", "sea", "1", "", "", "90"]
    changed = item_of_texts(ITEMS[-1], texts)
    assert (changed.command, changed.frame) == (Command.NAV_WAYPOINT, Frame.GLOBAL_INT)
    assert changed.position_deg == (47.5, 8.5)
    assert (changed.z, changed.param1, changed.param4) == (500.0, 1.0, 90.0)
    assert math.isnan(changed.param2)


@pytest.mark.parametrize(
    ("index", "text", "reason"),
    [
        (0, "FLY", "FLY is not a command"),
        (1, "91", "latitude 91 is outside -90 to 90"),
        (1, "", "NAV_WAYPOINT needs latitude and longitude"),
        (3, "high", "altitude: high is not a number"),
        (4, "moon", "altitude above moon"),
        (5, "inf", "parameter 1: give a finite number"),
    ],
)
def test_item_form_names_the_field_that_is_not_valid(index, text, reason):
    texts = [entry.value for entry in item_entries(ITEMS[1])]
    texts[index] = text
    with pytest.raises(ValueError, match=reason):
        item_of_texts(ITEMS[1], texts)


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
def test_mission_of_the_vehicle_at_three_sizes(size):
    async def story(pilot, app, screen):
        await pilot.press("down", "down", "down")
        await pilot.pause()
        assert "item 1 of 5 items, 86 m and 0:38 to go" in "\n".join(shown(app))
        check_picture(f"mission-{size[0]}x{size[1]}", shown(app)[2:])

    drive(story, size)


def test_mission_is_not_absent_while_it_downloads():
    async def story(pilot, app, screen):
        text = "\n".join(shown(app))
        assert "downloading the mission" in text
        assert "no mission" not in text
        answer(app, CliError("no answer", FAILED))
        screen.show(FLYING, 10.0)
        await pilot.pause()
        text = "\n".join(shown(app))
        assert "mission unknown" in text
        assert "no mission" not in text
        app.plans.reload()
        for _ in range(3):
            screen.show(FLYING, 10.0)
            if app.plans.loading:
                answer(app, ())
        screen.show(FLYING, 10.0)
        await pilot.pause()
        assert "no mission" in "\n".join(shown(app))

    app = WatchApp(StillFeed(FLYING))

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("3")
        await pilot.pause()
        await story(pilot, app, app.screen)

    run_story(app, begin)


def test_edits_mark_the_plan_and_undo_restores_it():
    async def story(pilot, app, screen):
        await pilot.press("down", "J")
        assert [each.command for each in screen.items[:3]] == [22, 178, 16]
        assert screen.rows.cursor == 2
        await pilot.press("d")
        await pilot.pause()
        assert len(screen.items) == 4
        assert " NOT UPLOADED " in "\n".join(shown(app))
        await pilot.press("z", "z")
        await pilot.pause()
        assert screen.items == ITEMS
        assert " NOT UPLOADED " not in "\n".join(shown(app))

    drive(story)


def test_form_changes_and_adds_items():
    async def story(pilot, app, screen):
        await pilot.press("down", "enter")
        await pilot.pause()
        assert isinstance(app.screen, EntryForm)
        list(app.screen.query(Input))[3].value = "12"
        await pilot.press("enter")
        await pilot.pause()
        assert screen.items[1].z == 12.0
        await pilot.press("a", "enter")
        await pilot.pause()
        assert screen.items[2].position_deg == ITEMS[1].position_deg
        assert screen.items[2].z == 12.0
        assert screen.rows.cursor == 2

    drive(story)


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
def test_quit_asks_before_edits_are_lost(key):
    async def story(pilot, app, screen):
        await pilot.press("d", key)
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press("n")
        await pilot.pause()
        assert app.screen is screen
        await pilot.press("g")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)  # a download would drop them too

    drive(story)


@pytest.mark.parametrize("suffix", [".plan", ".waypoints", ".kml"])
def test_saved_plan_is_loaded_from_its_file(tmp_path: Path, suffix):
    file = tmp_path / f"a{suffix}"

    async def story(pilot, app, screen):
        for key in ("w", "o"):
            await pilot.press(key)
            await pilot.pause()
            app.screen.query_one(Input).value = str(file)
            await pilot.press("enter")
            await pilot.pause()
        assert [text.split()[2] for text in said(app)] == ["saved", "loaded"]
        places = [each.position_deg for each in screen.items]
        assert [place for place in places if place] == [
            each.position_deg for each in ITEMS if each.position_deg
        ]

    drive(story)


def test_jump_needs_the_mission_of_the_vehicle():
    async def story(pilot, app, screen):
        await pilot.press("j", "y")
        await pilot.pause()
        assert [action.name for action in app.feed.actions] == [jump(0).name]
        await pilot.press("d", "j")
        await pilot.pause()
        assert len(app.feed.actions) == 1

    drive(story)


def test_start_on_the_ground_asks_although_armed():
    async def story(pilot, app, screen):
        await pilot.press("s")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press("y")
        await pilot.pause()
        assert [action.name for action in app.feed.actions] == ["mission start"]

    drive(story, view=FLYING._replace(landed_state=1))


def test_start_in_the_air_resumes_at_once():
    async def story(pilot, app, screen):
        await pilot.press("s")
        await pilot.pause()
        assert [action.name for action in app.feed.actions] == ["mission resume"]

    drive(story)


@pytest.mark.parametrize("key", ["s", "j", "p"])
def test_mission_orders_to_all_vehicles_ask(key):
    async def story(pilot, app, screen):
        app.feed.others.append(FLYING._replace(identity=Identity(7, 1, 2, 12)))
        app.feed.commands_all = True
        await pilot.press(key)
        await pilot.pause()
        assert "all 2 vehicles (1, 7)?" in "\n".join(shown(app))
        await pilot.press("y")
        await pilot.pause()
        assert app.feed.acted_on == [1, 7]

    drive(story)
