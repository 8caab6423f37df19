"""Scenario files: what is read, and the sentence for each error."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from flightstack.core.errors import ConfigError
from flightstack.testing.events import EVENTS, check_event
from flightstack.testing.scenario import Scenario, is_scenario, load_scenario, repeat_command
from flightstack.testing.toml_record import json_schema, key_rows

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(path for path in (ROOT / "missions").glob("*.toml"))
SCHEMA = json.loads((ROOT / "docs/reference/scenario.schema.json").read_text(encoding="utf-8"))


def written(folder: Path, text: str) -> Path:
    path = folder / "a.toml"
    path.write_text(text, encoding="utf-8")
    return path


ERRORS = {
    "spid = 3": "spid: is not a known key; known are description, plan",
    "seed = 'a'": "seed: 'a' is not a whole number",
    "repeat = 0": "repeat: 0 is outside the allowed range 1 to 1000000",
    "plant = 'soft'": "plant: 'soft' is not one of rigid, multibody, paper",
    "drag = 1": "drag: 1 is neither true nor false",
    "wind = 3": "wind: must be a table",
    "wind = {mean_m_s = [1]}": "wind.mean_m_s: must be a list of 2 or 3 values, not of 1",
    "wind = {mean_m_s = [1, 2]}": "wind: wind cannot act: the vehicle paper_quad has no drag; set drag to true",
    "wind = {gust_m_s = 60}": "wind.gust_m_s: 60 is outside the allowed range 0 to 50",
    "vehicle = 'none'": "none: is neither a file nor a built-in vehicle (paper_quad, x_quad)",
    "gains = 'none'": "none: is neither a file nor built-in gains (",
    "controller = 'none'": "controller: none: there is no such attitude controller; installed are backstepping",
    "loops = 'rust'": "loops: rust is not one of python, c, host",
    "inner_hz = 333.3": "inner_hz: 333.3 does not make a whole number of microseconds per tick",
    "outer_hz = 90": "outer_hz: 90 does not divide the inner rate 500",
    "home = '1,2'": "home: 1,2 must be LATITUDE,LONGITUDE,ALTITUDE in degrees and metres",
    "params = {NONE = 1}": "params: NONE: the vehicle has no such parameter",
    "params = {COM_DL_LOSS_T = 1e5}": "params: COM_DL_LOSS_T=100000.0: 100000 is outside 5 to 300 s",
    "plan = 'none.plan'": "none.plan: cannot be read: No such file or directory",
    "event = [{at_s = 1}]": "event[0]: needs one effect of fault, link, command, param, upload, power, and has none",
    "event = [{fault = 'rotor:1:off'}]": "event[0]: needs one trigger of at_s, at_item, when, after, and has none",
    "event = [{at_s = 1, when = 'armed', link = 'cut'}]": "has at_s and when",
    "event = [{at_s = 1, fault = 'rotor:9:off'}]": "event[0].fault: ",
    "event = [{at_s = 1, fault = 'wind:step=1,2,0'}]": (
        "event[0].fault: wind:step=1,2,0: wind cannot act: the vehicle paper_quad has no drag; set drag to true"
    ),
    "state = 'truth'\nevent = [{at_s = 1, fault = 'sensor:gnss:off'}]": "event[0].fault: sensor:gnss:off: cannot act",
    "event = [{at_s = 1, link = 'slow'}]": "event[0].link: slow is no change of a link",
    "event = [{at_s = 1, link = 'loss 2'}]": "event[0].link: loss 2: loss must be 0 to 1",
    "event = [{at_s = 1, command = 'jump'}]": "event[0].command: jump is none of arm, disarm, kill, takeoff [ALT_M]",
    "event = [{at_s = 1, command = 'goto 5'}]": "event[0].command: goto 5 is none of arm",
    "event = [{at_s = 1, command = 'mode FAST'}]": "event[0].command: mode FAST: has no mode 'FAST'; modes are HOLD",
    "event = [{at_s = 1, param = 'X'}]": "event[0].param: X must be NAME=VALUE with a number",
    "event = [{at_s = 1, upload = 'none.plan'}]": "event[0].upload: cannot be read",
    "event = [{at_s = 1, link = 'cut', client = 'me'}]": "event[0].client: 'me' is not one of gcs",
    "event = [{at_s = 1, command = 'arm', for_s = 1}]": "event[0].for_s: is for fault, link and power",
    "event = [{at_s = 1, link = 'cut', refused = ''}]": "event[0].refused: is for command, fault, param and upload",
    "event = [{when = 'hight > 1', link = 'cut'}]": "event[0].when: hight > 1: has an unknown name hight",
    "event = [{after = 'takeoff', link = 'cut'}]": "event[0].after: takeoff is no event that is known in flight:",
    "expect = {outcome = 'GCS_LOSST'}": "expect.outcome: 'GCS_LOSST' is not one of any, completed",
    "expect = {always = ['mode == \"FAST\"']}": "expect.always[0]: mode == \"FAST\": has no mode 'FAST'",
    "expect = {eventually = ['armed within 2 s of lift']}": "expect.eventually[0]: lift is no event: takeoff, landing",
    "expect = {at_end = ['landed after takeoff']}": "expect.at_end[0]: landed after takeoff: is not valid",
    "expect = {no_text_above = 'loud'}": "expect.no_text_above: 'loud' is not one of emergency, alert",
    "expect = {duration_s = [1]}": "expect.duration_s: must be a list of 2 values, not of 1",
}


@pytest.mark.parametrize("line", ERRORS, ids=lambda line: line[:40])
def test_an_error_names_file_key_and_what_is_allowed(line: str, tmp_path: Path) -> None:
    path = written(tmp_path, f"duration_s = 5\n{line}\n")
    with pytest.raises(ConfigError) as raised:
        load_scenario(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert ERRORS[line] in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_scenario_without_a_plan_needs_an_end(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="plan: is missing; without a plan give duration_s or limit_s"):
        load_scenario(written(tmp_path, "[expect]\n"))


def test_a_file_with_broken_syntax_is_a_scenario_whose_error_is_shown(tmp_path: Path) -> None:
    path = written(tmp_path, "plan = square\n[expect]\n")
    assert is_scenario(path)
    with pytest.raises(ConfigError, match="is not valid TOML"):
        load_scenario(path)


@pytest.mark.parametrize("name", ["x_quad.toml", "none.toml", "../square.plan"])
def test_other_files_are_no_scenarios(name: str) -> None:
    assert not is_scenario(ROOT / "flightstack/params/vehicles" / name)


def test_seeds_follow_the_first_one(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, "plan = 'hop'\nseed = 7\nrepeat = 3\n"))
    assert scenario.seeds == (7, 8, 9)
    assert scenario.setup(8).seed == 8


def test_the_repeat_command_is_quoted_and_names_the_seed(tmp_path: Path) -> None:
    folder = tmp_path / "my files"
    folder.mkdir()
    scenario = load_scenario(written(folder, "plan = 'hop'\n"))
    assert repeat_command(scenario, 1) == f"gcs test '{folder}/a.toml'"
    assert repeat_command(scenario, 4) == f"gcs test '{folder}/a.toml' --seed 4 --repeat 1"


def test_the_files_of_a_scenario_are_those_it_depends_on(tmp_path: Path) -> None:
    vehicle = tmp_path / "v.toml"
    vehicle.write_text((ROOT / "flightstack/params/vehicles/x_quad.toml").read_text())
    (tmp_path / "next.plan").write_text((ROOT / "missions/hop.plan").read_text())
    text = "plan = 'square.plan'\nvehicle = 'v.toml'\nevent = [{at_s = 1, upload = 'next.plan'}]\n"
    scenario = load_scenario(written(tmp_path, text))
    names = [path.name for path in scenario.files()]
    assert names == ["a.toml", "next.plan", "v.toml", "square.plan"]
    assert [path.name for path in scenario.installed_files()] == ["square.plan"]
    assert all(path.exists() for path in scenario.files())


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.form)
def test_each_event_form_accepts_an_example(event: object) -> None:
    form: str = event.form  # type: ignore[attr-defined]
    example = (
        form.replace("CHANGE", "cut")
        .replace("NAME", "GCS_LOST")
        .replace("_MODE", "_LAND")
        .replace("_N", "_3")
    )
    check_event(example)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_schema_accepts_the_scenarios_of_the_project(path: Path) -> None:
    load_scenario(path)
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), SCHEMA)


@pytest.mark.parametrize(
    "values",
    [
        {"spid": 1}, {"repeat": 0}, {"plant": "soft"}, {"drag": 1}, {"wind": {"mean_m_s": [1]}},
        {"expect": {"outcome": "GCS_LOSST"}}, {"event": [{"power": "off"}]}, {"params": {"X": "a"}},
    ],
    ids=str,
)  # fmt: skip
def test_the_schema_refuses_what_the_loader_refuses(values: dict[str, object]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(values, SCHEMA)


def test_the_schema_is_valid_and_has_each_key() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json_schema(Scenario, "flightstack scenario") == SCHEMA
    assert list(SCHEMA["properties"]) == [name for name, *_ in key_rows(Scenario)]
