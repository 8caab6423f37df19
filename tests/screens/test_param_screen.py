"""The screen Parameters: rows, details and checks, and the screen driven by keys."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from flightstack.mavlink.param_values import Parameter
from gcs_cli.errors import FAILED, CliError
from gcs_cli.transfers.param_calls import Changes
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.orders.form import Confirm
from gcs_cli.tui.palette import DARK
from gcs_cli.tui.params.model import (
    ParamList,
    differences_text,
    param_columns,
    param_details,
    param_row,
    parse_param,
)
from gcs_cli.tui.params.screen import ParamScreen
from gcs_cli.tui.widgets.entry_form import EntryForm
from gcs_cli.vehicle.param_info import ParamInfo
from tests.support.map_views import VIEW
from tests.support.pictures import check_picture
from tests.support.pilots import run_story
from tests.support.screens import shown
from tests.support.still_feed import StillFeed

INFOS = {
    "MPC_XY_CRUISE": ParamInfo(5.0, 3.0, 20.0, "m/s", "Horizontal speed in missions"),
    "COM_ARM_WO_GPS": ParamInfo(1.0, 0.0, 1.0, "", "Arm without GNSS", ((0.0, "deny"), (1.0, "allow"))),
    "RTL_RETURN_ALT": ParamInfo(30.0, 0.0, 150.0, "m", "Altitude of the return above home", (), True),
}
VALUES = {"COM_ARM_WO_GPS": (1.0, True), "MPC_XY_CRUISE": (4.0, False), "RTL_RETURN_ALT": (30.0, False)}


def params(values=VALUES) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(name, value, whole, index, len(values))
        for index, (name, (value, whole)) in enumerate(sorted(values.items()))
    )


LIST = ParamList({each.name: each for each in params()}, INFOS)


@pytest.mark.parametrize(
    ("query", "changed_only", "names"),
    [
        ("", False, ["COM_ARM_WO_GPS", "MPC_XY_CRUISE", "RTL_RETURN_ALT"]),
        ("mxc", False, ["MPC_XY_CRUISE"]),
        ("above home", False, ["RTL_RETURN_ALT"]),
        ("", True, ["MPC_XY_CRUISE"]),
        ("zzz", False, []),
    ],
)
def test_parameters_are_found_by_letters_of_the_name_or_words_of_the_help(query, changed_only, names):
    assert LIST.names(query, changed_only) == names


def test_file_takes_the_place_of_the_defaults():
    compared = LIST._replace(file={"RTL_RETURN_ALT": 25.0, "MPC_XY_CRUISE": 4.0, "OTHER": 1.0})
    assert compared.changed() == ["RTL_RETURN_ALT"]
    assert differences_text(compared, compared.file) == [
        "RTL_RETURN_ALT: 30 → 25",
        "OTHER: the vehicle has no such parameter",
    ]


@pytest.mark.parametrize("width", [60, 78, 150])
def test_row_fits_and_highlights_a_changed_value(width):
    name = "MPC_XY_CRUISE"
    columns = param_columns(width, "default")
    row = param_row(LIST.parameters[name], INFOS[name], INFOS[name], columns, DARK)
    assert len(row) <= width
    assert row.plain.split()[:4] == [name, "4", "m/s", "5"]
    assert f"bold {DARK.warning}" in {str(span.style) for span in row.spans}


def test_details_mark_the_current_value_of_an_enumeration():
    name = "COM_ARM_WO_GPS"
    text = param_details(LIST.parameters[name], INFOS[name], None, DARK)
    assert text.plain.splitlines()[-2:] == ["0: deny", "1: allow"]
    assert [str(span.style) for span in text.spans][-1] == f"bold {DARK.good}"


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [("MPC_XY_CRUISE", "7.5", 7.5), ("COM_ARM_WO_GPS", "Deny", 0.0), ("COM_ARM_WO_GPS", "1", 1.0)],
)
def test_typed_value_is_a_number_or_a_name_of_the_enumeration(name, text, value):
    assert parse_param(LIST.parameters[name], INFOS[name], text) == value


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("MPC_XY_CRUISE", "", "nothing is not a number"),
        ("MPC_XY_CRUISE", "2", "MPC_XY_CRUISE must be 3 to 20"),
        ("MPC_XY_CRUISE", "inf", "give a finite number"),
        ("COM_ARM_WO_GPS", "0.5", "COM_ARM_WO_GPS is an integer"),
    ],
)
def test_typed_value_outside_type_or_range_is_refused_before_it_is_sent(name, text, reason):
    with pytest.raises(ValueError, match=reason):
        parse_param(LIST.parameters[name], INFOS[name], text)


def drive(
    story: Callable[[Pilot[None], WatchApp, ParamScreen], Awaitable[None]],
    size=(80, 24),
    values=VALUES,
    infos=INFOS,
    *,
    downloads=True,
) -> None:
    app = WatchApp(StillFeed(VIEW))

    async def begin(pilot: Pilot[None]) -> None:
        await pilot.press("7")
        await pilot.pause()
        screen = app.screen
        assert isinstance(screen, ParamScreen)
        screen.show(VIEW, 10.0)
        await pilot.pause()
        if downloads:
            app.feed.jobs[-1][1].set_result((params(values), infos))
            await pilot.pause()
        await story(pilot, app, screen)

    run_story(app, begin, size=size)


@pytest.mark.parametrize("size", [(80, 24), (120, 35), (200, 50)], ids=str)
def test_parameter_table_and_details_at_three_sizes(size):
    async def story(pilot, app, screen):
        await pilot.press("down")
        screen.show(VIEW, 10.0)
        await pilot.pause()
        text = "\n".join(shown(app))
        assert "3 of 3 parameters" in text
        assert "1 not at the default" in text
        assert "default 5, range 3 to 20" in text
        check_picture(f"parameters-{size[0]}x{size[1]}", shown(app)[2:])

    drive(story, size)


def test_parameters_are_compared_only_when_they_change(monkeypatch: pytest.MonkeyPatch):
    compared: list[ParamList] = []

    async def story(pilot, app, _screen):
        assert "1 not at the default" in "\n".join(shown(app))
        monkeypatch.setattr(ParamList, "changed", lambda params: compared.append(params) or [])
        app.redraw()
        await pilot.pause()
        assert not compared
        assert "1 not at the default" in "\n".join(shown(app))

    drive(story)


def test_search_and_changed_only_filter_the_table():
    async def story(pilot, _app, screen):
        await pilot.press("slash", "r", "t", "l")
        assert screen.names_shown == ["RTL_RETURN_ALT"]
        await pilot.press("enter", "escape", "c")
        assert screen.names_shown == ["MPC_XY_CRUISE"]

    drive(story)


def test_search_opens_while_the_parameters_are_downloaded():
    """Else the letters typed after ``/`` were keys: a capital R returns to launch."""

    async def story(pilot, app, screen):
        screen.show(VIEW, 10.0)
        await pilot.press("slash", "r", "t", "l", "R", "T", "L")
        assert screen.query_one(Input).value == "rtlRTL"
        assert len(app.feed.jobs) == 1  # the download
        await pilot.press(*["backspace"] * 3)
        app.feed.jobs[-1][1].set_result((params(), INFOS))
        await pilot.pause()
        assert screen.names_shown == ["RTL_RETURN_ALT"]

    drive(story, downloads=False)


def test_edit_shows_the_value_that_the_vehicle_confirms():
    async def story(pilot, app, screen):
        await pilot.press("down", "enter")
        await pilot.pause()
        assert isinstance(app.screen, EntryForm)
        app.screen.query_one(Input).value = "99"
        await pilot.press("enter")
        assert isinstance(app.screen, EntryForm)  # outside the range
        app.screen.query_one(Input).value = "6"
        await pilot.press("enter")
        await pilot.pause()
        app.feed.jobs[-1][1].set_result(LIST.parameters["MPC_XY_CRUISE"]._replace(value=6.0))
        await pilot.pause()
        assert screen.selected.value == 6.0
        assert [entry.text for entry in app.feed.messages.since(0)] == ["MPC_XY_CRUISE = 6 m/s (was 4)"]

    drive(story)


def test_refused_value_stays_and_the_reason_is_kept_among_the_messages():
    async def story(pilot, app, screen):
        await pilot.press("down", "d", "y")
        await pilot.pause()
        app.feed.jobs[-1][1].set_exception(CliError("MPC_XY_CRUISE = 5 refused: armed", FAILED))
        await pilot.pause()
        assert screen.selected.value == 4.0
        assert [entry.text for entry in app.feed.messages.since(0)] == ["MPC_XY_CRUISE = 5 refused: armed"]

    drive(story)


def test_saved_parameters_load_after_a_question_with_the_differences(tmp_path: Path):
    file = tmp_path / "a.params"

    async def enter(pilot, app, key):
        await pilot.press(key)
        await pilot.pause()
        app.screen.query_one(Input).value = str(file)
        await pilot.press("enter")
        await pilot.pause()

    async def story(pilot, app, screen):
        await enter(pilot, app, "w")
        assert "MPC_XY_CRUISE\t4\t" in file.read_text()
        await enter(pilot, app, "f")
        assert shown(app)[2].endswith(" none other than in a.params")
        file.write_text(file.read_text().replace("MPC_XY_CRUISE\t4", "MPC_XY_CRUISE\t8"))
        await enter(pilot, app, "f")
        assert screen.names_shown == ["MPC_XY_CRUISE"]
        await enter(pilot, app, "o")
        assert isinstance(app.screen, Confirm)
        assert "MPC_XY_CRUISE: 4 → 8" in "\n".join(shown(app))
        await pilot.press("y")
        await pilot.pause()
        changed = LIST.parameters["MPC_XY_CRUISE"]._replace(value=8.0)
        app.feed.jobs[-1][1].set_result(Changes((changed,), ("X refused: unknown",)))
        await pilot.pause()
        said = [entry.text for entry in app.feed.messages.since(0)]
        assert said[-2:] == ["X refused: unknown", "1 of 3 parameters of a.params changed"]
        await pilot.press("escape")
        await pilot.pause()
        assert any("MPC_XY_CRUISE" in line and " 8 " in line for line in shown(app))

    drive(story)


def test_edit_is_bound_to_the_vehicle_of_the_table():
    async def story(pilot, app, screen):
        await pilot.press("down", "enter")
        await pilot.pause()
        app.feed.shown = VIEW._replace(identity=VIEW.identity._replace(system_id=7))
        screen.show(app.feed.shown, 10.0)
        app.screen.query_one(Input).value = "6"
        await pilot.press("enter")
        await pilot.pause()
        assert screen.doing == "setting MPC_XY_CRUISE"
        assert app.feed.job_targets[-1] == VIEW.identity.system_id

    drive(story)


def test_quit_asks_while_a_download_runs_and_ends_it():
    async def story(pilot, app, screen):
        await pilot.press("u")
        await pilot.pause()
        screen.show_progress(3, 1400)
        assert screen.doing_text == "downloading the parameters: 3 of 1400"
        await pilot.press("q")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        assert "Downloading the parameters has not ended." in "\n".join(shown(app))
        app.feed.jobs[-1][1].set_exception(CliError("interrupted", FAILED))
        await pilot.pause()
        assert not app.unsaved

    drive(story)


def test_row_list_draws_only_the_visible_rows_of_1400(monkeypatch):
    values = {f"P{number:04d}": (float(number), False) for number in range(1400)}
    drawn = []

    def counted_row(parameter, *style):
        drawn.append(parameter.name)
        return param_row(parameter, *style)

    monkeypatch.setattr("gcs_cli.tui.params.screen.param_row", counted_row)

    async def story(pilot, app, screen):
        drawn.clear()
        await pilot.press("end")
        await pilot.pause()
        assert screen.selected.name == "P1399"
        assert any(line.startswith(" P1399") for line in shown(app))
        assert 0 < len(set(drawn)) <= 2 * screen.rows.size.height

    drive(story, values=values, infos={})
