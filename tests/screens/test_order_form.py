"""The form for the values of an order."""

from __future__ import annotations

import pytest
from textual.pilot import Pilot

from flightstack.mavlink.dialect import mavlink
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.orders.orders import Field, FieldError
from gcs_cli.vehicle.view_types import Identity
from tests.support.pilots import type_ahead
from tests.support.screens import shown
from tests.support.watch_plays import GROUNDED, asked, play
from tests.support.watch_states import BARE


def test_a_form_asks_for_values_and_names_what_is_wrong() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("T")
        await pilot.pause()
        await pilot.press("backspace", *"high", "enter")
        await pilot.pause()
        assert "altitude: high is not a number" in "\n".join(shown(app))
        await pilot.press(*["backspace"] * 4, *"12", "enter")
        await pilot.pause()

    feed = play(story, GROUNDED)
    assert [action.facts for action in feed.actions] == [{"altitude_m": 12.0}]


def in_form(app: WatchApp) -> list[str]:
    return [line.split("│")[1].strip() for line in shown(app) if line.count("│") >= 2]


def test_help_of_an_order_is_shown_whole_in_its_form() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("S")
        await pilot.pause()
        assert "without a value, the default" in " ".join(in_form(app))

    play(story, GROUNDED)


@pytest.mark.parametrize(
    ("autopilot", "title"),
    [
        (mavlink.MAV_AUTOPILOT_PX4, "altitude [m above home] (empty: the vehicle's own)"),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "altitude [m above home]"),
    ],
)
def test_takeoff_altitude_is_optional_if_the_vehicle_has_one(autopilot: int, title: str) -> None:
    view = GROUNDED._replace(identity=Identity(1, 1, 2, autopilot))

    async def story(app: WatchApp, pilot: Pilot) -> None:
        await type_ahead(pilot, "T")
        assert title in in_form(app)
        await type_ahead(pilot, "backspace", "enter")
        is_needed = autopilot != mavlink.MAV_AUTOPILOT_PX4
        assert ("altitude: give a value" in "\n".join(shown(app))) == is_needed

    play(story, view)


def test_escape_leaves_a_form_without_an_order() -> None:
    async def story(_app: WatchApp, pilot: Pilot) -> None:
        await pilot.press("G")
        await pilot.pause()
        await pilot.press("4", "escape")
        await pilot.pause()

    assert asked(play(story)) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [("", "altitude: give a value"), ("x", "altitude: x is not a number"), ("99", "altitude: give 1 to 9")],
)
def test_a_field_names_an_invalid_value(text: str, said: str) -> None:
    with pytest.raises(FieldError, match=said):
        Field("altitude", smallest=1.0, largest=9.0).parse(text, BARE)
