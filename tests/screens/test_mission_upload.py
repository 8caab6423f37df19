"""The upload of the screen Mission: questions, comparison with the vehicle's plan, and what stays edited."""

from __future__ import annotations

import pytest

from gcs_cli.errors import FAILED, CliError
from gcs_cli.plans.check import Problem
from gcs_cli.tui.mission.screen import Comparison
from gcs_cli.vehicle.view_types import Identity
from tests.support.mission_stories import FLYING, answer, drive, said
from tests.support.screens import shown


def test_upload_checks_asks_while_armed_and_reads_back():
    async def story(pilot, app, screen):
        await pilot.press("d", "u")
        await pilot.pause()
        answer(app, ([Problem("mission", 0, "item 0 is too far")], ""))
        await pilot.pause()
        assert "mission: item 0 is too far" in "\n".join(shown(app))
        await pilot.press("y")
        await pilot.pause()
        assert "The vehicle is armed" in "\n".join(shown(app))
        await pilot.press("y")
        await pilot.pause()
        answer(app, True)
        await pilot.pause()
        assert " NOT UPLOADED " not in "\n".join(shown(app))
        answer(app, Comparison("mission of 4 items equal", is_equal=True))
        await pilot.pause()
        assert said(app) == ["uploaded: mission of 4 items equal"]
        assert not screen.draft.is_changed
        assert len(screen.items) == 4

    drive(story)


@pytest.mark.parametrize(
    ("read_back", "text", "is_changed"),
    [
        (
            CliError("vehicle 1 is no longer selected", FAILED),
            "uploaded, not compared: vehicle 1 is no longer selected",
            False,
        ),
        (
            Comparison("the vehicle's plan differs: item 2", is_equal=False),
            "uploaded: the vehicle's plan differs: item 2",
            True,
        ),
    ],
    ids=["not compared", "different"],
)
def test_upload_and_comparison_are_reported_apart(read_back, text, is_changed):
    async def story(pilot, app, screen):
        await pilot.press("d", "u")
        await pilot.pause()
        answer(app, ([], ""))
        await pilot.pause()
        await pilot.press("y")
        await pilot.pause()
        answer(app, True)
        await pilot.pause()
        answer(app, read_back)
        await pilot.pause()
        assert said(app) == [text]
        assert screen.draft.is_changed == is_changed
        assert len(screen.items) == 4

    drive(story)


def test_refused_upload_keeps_the_edits():
    async def story(pilot, app, screen):
        await pilot.press("d", "u")
        await pilot.pause()
        answer(app, ([], ""))
        await pilot.pause()
        await pilot.press("y")
        await pilot.pause()
        answer(app, CliError("upload of the mission refused: item 2", FAILED))
        await pilot.pause()
        assert said(app) == ["upload of the mission refused: item 2"]
        assert screen.draft.is_changed

    drive(story)


def test_upload_to_another_vehicle_than_the_edited_one_asks():
    async def story(pilot, app, screen):
        await pilot.press("d")
        app.feed.shown = FLYING._replace(identity=Identity(7, 1, 2, 12))
        await pilot.press("u")
        await pilot.pause()
        assert "The plan of vehicle 1 was edited. Upload it to vehicle 7?" in " ".join(
            "\n".join(shown(app)).split()
        )
        await pilot.press("y")
        await pilot.pause()
        assert app.feed.job_targets[-1] == 7

    drive(story)
