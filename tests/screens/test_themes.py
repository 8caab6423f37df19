"""Themes of ``gcs watch``: colours of drawings, and their brightness without colours."""

from __future__ import annotations

import pytest
from textual.color import Color
from textual.pilot import Pilot

from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.palette import DARK, LIGHT
from tests.support.watch_plays import play


def test_a_theme_changes_the_colours_of_drawings() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        dark = app.palette
        app.theme = "gcs-light"
        await pilot.pause()
        assert app.palette.background != dark.background
        app.theme = "nord"
        await pilot.pause()
        assert app.palette.text.startswith("#")

    play(story)


def test_background_of_a_drawing_follows_the_theme() -> None:
    async def story(app: WatchApp, pilot: Pilot) -> None:
        backgrounds = []
        for theme in ("gcs-dark", "gcs-light"):
            app.theme = theme
            await pilot.pause()
            app.redraws = 0
            app.redraw()
            await pilot.pause()
            [segment, *_] = app.screen.query_one("#position").render_line(0)
            backgrounds.append(segment.style.bgcolor.name)
        assert backgrounds == [palette.background for palette in (DARK, LIGHT)]

    play(story)


@pytest.mark.parametrize("theme", ["gcs-dark", "gcs-light"])
def test_without_colour_warnings_and_the_horizon_differ_by_brightness(
    theme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.theme = theme
        await pilot.pause()
        colours = app.palette
        grey = {name: Color.parse(colour).monochrome.r for name, colour in colours._asdict().items()}
        contrast = {name: abs(value - grey["background"]) for name, value in grey.items()}
        assert contrast["bad"] == contrast["warning"] >= contrast["text"] > contrast["muted"]
        assert grey["sky"] - grey["ground"] > 30  # measured: 36 and more

    play(story)


@pytest.mark.parametrize("key", ["5", "7"])
def test_lines_that_are_drawn_after_changes_follow_the_theme(key: str) -> None:
    """The texts and the state of their filter; the titles of the parameters."""

    async def story(app: WatchApp, pilot: Pilot) -> None:
        app.theme = "gcs-dark"
        await pilot.press(key)
        await pilot.pause(0.5)
        app.theme = "gcs-light"
        await pilot.pause(0.5)
        widget = app.screen.query_one("#filter" if key == "5" else "#param-titles")
        [segment, *_] = widget.render_line(0)
        assert segment.style.bgcolor.name == LIGHT.background

    play(story)
