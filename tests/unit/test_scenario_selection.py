"""Which flights ``gcs test`` flies: files of folders, names, seeds; and which of them changed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from gcs_cli.errors import CliError
from gcs_cli.scenarios.selection import Selector, find_scenarios, select
from gcs_cli.scenarios.watch import Stamps
from tests.support.commands import gcs

TEXT = "plan = 'hop'\nrepeat = 2\n[expect]\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("b.toml", "a.toml", "wind/gust.toml", "rain/gust.toml", ".venv/c.toml", "build/d.toml"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(TEXT)
    (tmp_path / "other.toml").write_text("[tool]\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_folders_are_searched_in_order_without_hidden_ones(folder: Path) -> None:
    assert list(map(str, find_scenarios([Path()]))) == [
        "a.toml",
        "b.toml",
        "rain/gust.toml",
        "wind/gust.toml",
    ]


def test_a_file_given_twice_is_flown_once(folder: Path) -> None:
    assert find_scenarios([Path("a.toml"), Path(), folder / "a.toml"])[0] == Path("a.toml")
    assert len(find_scenarios([Path("a.toml"), Path()])) == 4


def test_a_missing_path_is_an_error(folder: Path) -> None:
    with pytest.raises(ConfigError, match="none: there is no such file or folder"):
        find_scenarios([Path("none")])


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("a", "a.toml"),
        ("wind/gust", "wind/gust.toml"),
        ("wind/guts.toml", "wind/gust.toml"),
        ("low_battery", ".*missions/low_battery.toml"),
        ("low_batery", ".*missions/low_battery.toml"),
    ],
)
def test_a_missing_path_names_the_file_that_is_meant(folder: Path, name: str, near: str) -> None:
    with pytest.raises(
        ConfigError, match=f"{name}: there is no such file or folder; did you mean {near}\\?$"
    ):
        find_scenarios([Path(name)])
    assert gcs("campaign", name).stderr == f"gcs: {name}: there is no such file or folder\n"


def test_a_missing_campaign_names_a_campaign(folder: Path) -> None:
    (folder / "sweep.toml").write_text(TEXT + "[campaign]\nflights = 3\n[vary]\n")
    for name in ("sweep", "swep.toml"):
        assert "folder; did you mean sweep.toml?" in gcs("campaign", name).stderr
    assert gcs("test", "sweep").stderr == "gcs: sweep: there is no such file or folder\n"


def test_a_campaign_among_the_scenarios_is_named(folder: Path) -> None:
    (folder / "sweep.toml").write_text(TEXT + "[campaign]\nflights = 3\n[vary]\n")
    with pytest.raises(ConfigError, match=r"sweep\.toml: is a campaign: fly it with gcs campaign$"):
        select([Path("sweep.toml")])
    assert "a.toml: is a scenario: fly it with gcs test; a campaign has" in gcs("campaign", "a.toml").stderr


def test_a_folder_without_scenarios_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CliError, match="a scenario is a TOML file with a table") as raised:
        find_scenarios([tmp_path])
    assert raised.value.exit_code == 2


def test_equal_names_are_shown_with_their_folder(folder: Path) -> None:
    cases = select(find_scenarios([Path()]))
    assert [(case.label, case.seed) for case in cases[:3]] == [("a", 1), ("a", 2), ("b", 1)]
    assert {case.label for case in cases[4:]} == {"rain/gust", "wind/gust"}
    assert {case.name for case in cases[4:]} == {
        f"{label}-seed{seed}" for label in ("rain/gust", "wind/gust") for seed in (1, 2)
    }


def write(*names: str) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(TEXT)


def test_names_of_files_with_similar_paths_differ(folder: Path) -> None:
    write("rain-gust.toml", "x/rain-gust.toml")
    cases = select(find_scenarios([Path(), folder / "x"]))
    assert len({case.name for case in cases}) == len(cases) == 12


def test_names_stay_below_the_folder_of_kept_files(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder / "wind")
    cases = select([Path("../rain/gust.toml"), folder / "wind" / "gust.toml"])
    assert [case.label for case in cases] == ["rain/gust"] * 2 + ["wind/gust"] * 2
    assert cases[0].command.startswith("gcs test ../rain/gust.toml ")


def test_key_of_a_case_does_not_depend_on_other_files(folder: Path) -> None:
    (alone,) = select([Path("wind/gust.toml")], repeat=1)
    _, beside = select([Path("rain/gust.toml"), Path("wind/gust.toml")], repeat=1)
    assert alone.label != beside.label
    assert alone.key == beside.key


def test_seed_and_repeat_replace_those_of_the_file(folder: Path) -> None:
    cases = select([Path("a.toml")], seed=5, repeat=3)
    assert [case.seed for case in cases] == [5, 6, 7]
    assert cases[0].command == "gcs test a.toml --seed 5 --repeat 1"
    (only,) = select([Path("a.toml")], repeat=1)
    assert only.command == "gcs test a.toml --seed 1 --repeat 1"


@pytest.mark.parametrize(
    ("expression", "names"),
    [
        ("square", {"square_in_wind", "square"}),
        ("square and not wind", {"square"}),
        ("WIND or hop", {"square_in_wind", "hop", "wind-gust.2"}),
        ("not (wind or hop)", {"square"}),
        ("'in_w'", {"square_in_wind"}),
        ("wind-gust", {"wind-gust.2"}),
        ("not wind-gust and not HOP", {"square", "square_in_wind"}),
        ("gust.2 or (hop)", {"wind-gust.2", "hop"}),
        ('"gust.2"', {"wind-gust.2"}),
        ("2", {"wind-gust.2"}),
        ("", {"square", "square_in_wind", "hop", "wind-gust.2"}),
    ],
)
def test_an_expression_selects_by_parts_of_names(expression: str, names: set[str]) -> None:
    every = ("square", "square_in_wind", "hop", "wind-gust.2")
    assert {name for name in every if Selector(expression)(name)} == names


@pytest.mark.parametrize("expression", ["a and", "f(x)", "a + b", "a; b", "()", "a b", "not", "(a"])
def test_an_expression_with_an_error_is_refused(expression: str) -> None:
    with pytest.raises(CliError, match="must be parts of names, joined by and, or, not and brackets"):
        Selector(expression)


def test_an_expression_that_matches_nothing_is_an_error(folder: Path) -> None:
    with pytest.raises(CliError, match="-k storm: matches none of a, b"):
        select(find_scenarios([Path()]), "storm")


def test_a_change_of_one_file_selects_its_scenarios(folder: Path) -> None:
    stamps = Stamps()
    files = find_scenarios([Path()])
    assert len(stamps.changed(select(files))) == 8
    assert not stamps.poll(files)
    os.utime("b.toml", ns=(1, 1))
    assert stamps.poll(files)
    assert not stamps.poll(files)
    assert {case.label for case in stamps.changed(select(files))} == {"b"}
    assert stamps.changed(select(files)) == []


def test_a_new_scenario_is_a_change(folder: Path) -> None:
    stamps = Stamps()
    stamps.changed(select(find_scenarios([Path()])))
    Path("new.toml").write_text(TEXT)
    files = find_scenarios([Path()])
    assert stamps.poll(files)
    assert {case.label for case in stamps.changed(select(files))} == {"new"}
