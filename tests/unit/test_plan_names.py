"""Plans on the command line: examples by their bare names, files by path or suffix; and what an extra installs."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from flightstack.core.errors import INSTALL_FIRMWARE, INSTALL_MULTIBODY
from gcs_cli.__main__ import main
from gcs_cli.errors import DONE, USAGE, CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.transfers.plan_files import PLAN_ARGUMENT, example_plans, plan_file

ROOT = Path(__file__).parents[2]


def test_bare_name_is_an_example_even_beside_a_file_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "square").write_text("")
    assert plan_file("square").samefile(ROOT / "missions" / "square.plan")
    assert plan_file("triangle").samefile(ROOT / "missions" / "triangle.waypoints")
    assert plan_file("./square") == Path("square")
    assert plan_file("mine.plan") == Path("mine.plan")


@pytest.mark.parametrize("name", ["./square", "square.plan", "plans/square.waypoints"])
def test_a_missing_file_names_the_example_of_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CliError, match=f"{name}: there is no such file; the example plan is named square$"):
        plan_file(name)


def test_unknown_name_lists_the_examples(capsys: Any) -> None:
    with pytest.raises(CliError, match=r"there are every_item, fenced_square, hop, square, triangle$"):
        plan_file("circle")
    assert main(["fly", "circle"]) == USAGE
    assert capsys.readouterr().err.startswith(
        "gcs: circle: there is no example plan of that name; there are every_"
    )


def test_mistyped_name_names_the_example_that_is_meant() -> None:
    with pytest.raises(CliError, match=r"^squar: there is no example .*triangle; did you mean square\?$"):
        plan_file("squar")


def test_unknown_name_of_a_file_says_how_to_use_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("squar").touch()
    with pytest.raises(CliError, match=r"triangle; to use the file give \./squar$"):
        plan_file("squar")


def test_help_names_every_example() -> None:
    assert set(example_plans()) == set(re.findall(r"\w+", str(PLAN_ARGUMENT.help).partition("example:")[2]))


def test_gcs_fly_flies_the_square_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[FlyOptions] = []

    def check(options: FlyOptions) -> None:
        asked.append(options)
        raise CliError("enough", USAGE)

    monkeypatch.setattr("gcs_cli.fly.fly_run.checked_plan", check)
    monkeypatch.setattr("gcs_cli.pil.pil_commands.checked_plan", check)
    assert main(["fly"]) == USAGE
    assert main(["pil", "hop"]) == USAGE
    assert [options.plan_path.name for options in asked] == ["square.plan", "hop.plan"]


def test_examples_are_checked_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["mission", "check", "square"]) == DONE
    assert "mission of 6 items" in capsys.readouterr().out


@pytest.mark.parametrize("command", [("mission", "check"), ("fly",)])
def test_plan_that_no_vehicle_accepts_is_a_bad_file(
    command: tuple[str, ...], tmp_path: Path, capsys: Any
) -> None:
    bad = tmp_path / "bad.plan"
    text = (ROOT / "missions" / "fenced_square.plan").read_text()
    bad.write_text(text.replace('"radius": 4.0', '"radius": 15.0'))
    assert main([*command, str(bad)]) == USAGE
    assert "mission: item 1 (NAV_WAYPOINT)" in "".join(capsys.readouterr())


def test_wheel_holds_the_examples_where_they_are_looked_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    assert included["missions"] == "gcs_cli/missions"


@pytest.mark.parametrize(
    ("extra", "command"), [("multibody", INSTALL_MULTIBODY), ("firmware", INSTALL_FIRMWARE)]
)
def test_install_command_names_the_packages_of_the_extra(extra: str, command: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [re.split(r"[<>=]", package)[0] for package in project["optional-dependencies"][extra]]
    assert command == f"pip install {' '.join(wanted)}"
