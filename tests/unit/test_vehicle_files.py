"""Vehicle files: what the built-in ones are, and one sentence for each thing that can be wrong with one."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.params.config import StackConfig
from flightstack.params.vehicle import (
    BUILT_IN,
    Vehicle,
    built_in_vehicles,
    load_vehicle,
    load_vehicle_with,
)
from flightstack.plan import load_plan
from flightstack.testing import World
from flightstack.testing.server import fly_options
from flightstack.testing.setup import Setup
from flightstack.vehicle.parameters import read_parameters
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import longest_flight_s

MISSIONS = Path(__file__).parents[2] / "missions"
PAPER = (BUILT_IN / "paper_quad.toml").read_text(encoding="utf-8")


def load_text(folder: Path, text: str | bytes) -> Vehicle:
    path = folder / "my.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_vehicle(str(path))


def changed(pattern: str, replacement: str, count: int = 0) -> str:
    text, times = re.subn(pattern, replacement, PAPER, count=count, flags=re.MULTILINE)
    assert times, pattern
    return text


def value(key: str, text: str) -> str:
    return changed(rf"^{key} = .*$", f"{key} = {text}", count=1)


def rotors(*places: tuple[float, float, str]) -> str:
    head = PAPER[: PAPER.index("[[rotor]]")]
    return head + "\n".join(
        f'[[rotor]]\nposition_frd_m = [{x}, {y}, 0]\nspin = "{spin}"' for x, y, spin in places
    )


def test_built_in_vehicles_load() -> None:
    assert built_in_vehicles() == ["paper_quad", "x_quad"]
    for name in built_in_vehicles():
        vehicle = load_vehicle(name)
        assert vehicle.name == name
        assert vehicle.description


def test_a_limit_of_the_drives_is_optional(tmp_path: Path) -> None:
    assert {rotor.max_drive_torque_n_m for rotor in load_vehicle("paper_quad").rotors} == {math.inf}
    limited = changed(r"^lag_s = .*$", "lag_s = 0.005\nmax_drive_torque_n_m = 0.2")
    vehicle = load_text(tmp_path, limited)
    assert [rotor.max_drive_torque_n_m for rotor in vehicle.rotors] == [0.2] * 4
    assert {rotor.max_drive_torque_n_m for rotor in vehicle.with_ideal_rotors().rotors} == {math.inf}


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ("lag_s = 0.005\nmax_drive_torque_n_m = 0.03", "number 1 needs 0.0331 N m against the drag alone"),
        ("lag_s = 0.0\nmax_drive_torque_n_m = 0.2", "needs a lag_s and an inertia_kg_m2 above 0"),
        ("lag_s = 0.005\nmax_drive_torque_n_m = -1", "outside the allowed range"),
    ],
)
def test_bad_drive_torque_limit_raises_config_error(tmp_path: Path, lines: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(problem)) as caught:
        load_text(tmp_path, changed(r"^lag_s = .*$", lines))
    assert "max_drive_torque_n_m" in str(caught.value)


def test_the_papers_vehicle_is_table_i() -> None:
    v = load_vehicle("paper_quad")
    assert (v.mass_kg, v.inertia_kg_m2) == (0.55, (7.2e-3, 7.2e-3, 1.1e-2))
    rotor = v.rotors[0]
    assert (rotor.thrust_coefficient_n_s2, rotor.torque_coefficient_n_m_s2) == (2.93e-5, 7.2e-7)
    assert (rotor.inertia_kg_m2, rotor.lag_s) == (6.3e-5, 0.005)
    assert [r.spin for r in v.rotors] == [1, -1, 1, -1]
    assert v.max_thrust_n == pytest.approx(2.0 * v.weight_n, rel=1e-12)
    # equation 7: front and back make pitch, left and right make roll, counter-clockwise rotors turn clockwise
    b, d, arm = 2.93e-5, 7.2e-7, 0.2
    expected = [[b] * 4, [0, -arm * b, 0, arm * b], [arm * b, 0, -arm * b, 0], [-d, d, -d, d]]
    assert np.allclose(v.effectiveness(), expected, rtol=1e-15, atol=0.0)


def test_optional_drag_acts_only_on_request() -> None:
    v = load_vehicle("paper_quad")
    assert v.linear_drag_n_s_m == (0.0, 0.0, 0.0)
    assert v.with_drag("rigid") == replace(v, linear_drag_n_s_m=(0.153, 0.153, 0.153))
    for vehicle, plant in ((v, "paper"), (load_vehicle("x_quad"), "rigid")):
        with pytest.raises(ConfigError, match="--drag: "):
            vehicle.with_drag(plant)


def test_ideal_rotors_have_no_lag_and_no_limits() -> None:
    ideal = load_vehicle("x_quad").with_ideal_rotors()
    assert ideal.ideal_rotors
    for rotor in ideal.rotors:
        assert (rotor.lag_s, rotor.min_speed_rad_s, rotor.max_speed_rad_s) == (0.0, -math.inf, math.inf)


def test_a_file_loads_by_its_path_with_defaults_and_a_largest_speed(tmp_path: Path) -> None:
    text = changed(
        r"^(description|linear_drag_n_s_m|leg_height_m|inertia_kg_m2 = 6|lag_s|min_speed_rad_s).*\n", ""
    )
    vehicle = load_text(tmp_path, re.sub(r"thrust_to_weight = .*", "max_speed_rad_s = 400", text))
    assert (vehicle.description, vehicle.linear_drag_n_s_m, vehicle.leg_height_m) == (
        "",
        (0.0, 0.0, 0.0),
        0.1,
    )
    assert (vehicle.rotors[0].max_speed_rad_s, vehicle.rotors[0].min_speed_rad_s) == (400.0, 0.0)


HEXA = [(math.cos(i * math.pi / 3), math.sin(i * math.pi / 3), ("cw", "ccw")[i % 2]) for i in range(6)]


def test_any_rotor_set_that_hovers_loads(tmp_path: Path) -> None:
    assert len(load_text(tmp_path, rotors(*HEXA)).rotors) == 6


SQUARE = [(0.2, 0.2, "ccw"), (-0.2, -0.2, "ccw"), (0.2, -0.2, "cw"), (-0.2, 0.2, "cw")]

BAD = {
    "negative mass": (value("mass_kg", "-1"), "body.mass_kg: -1 is outside the allowed range 0.001 to 1000"),
    "no mass": (changed(r"^mass_kg.*\n", ""), "body.mass_kg: is missing"),
    "mass that is no number": (value("mass_kg", '"heavy"'), "body.mass_kg: 'heavy' is not a number"),
    "mass that is true": (value("mass_kg", "true"), "body.mass_kg: True is not a number"),
    "NaN": (value("mass_kg", "nan"), "body.mass_kg: nan is outside the allowed range 0.001 to 1000"),
    "infinity": (value("mass_kg", "inf"), "body.mass_kg: inf is outside the allowed range 0.001 to 1000"),
    "400 digits": (
        value("mass_kg", "1" + "0" * 400),
        "body.mass_kg: a number that large is outside the allowed",
    ),
    "5000 digits": (value("mass_kg", "1" + "0" * 5000), "is not usable TOML"),
    "two inertias": (value("inertia_kg_m2", "[1, 2]"), "body.inertia_kg_m2: must be a list of 3 numbers"),
    "zero inertia": (
        value("inertia_kg_m2", "[0, 1, 1]"),
        "body.inertia_kg_m2: 0 is outside the allowed range 1e-08 to 10000",
    ),
    "impossible inertia": (
        value("inertia_kg_m2", "[1e-3, 1e-3, 1e-2]"),
        "body.inertia_kg_m2: no rigid body has it: each must be at most the sum of the other two",
    ),
    "misspelt mass": (
        PAPER.replace("mass_kg", "mas_kg"),
        "body.mass_kg: is missing; did you misspell it as mas_kg?",
    ),
    "mass without unit": (PAPER.replace("mass_kg", "mass"), "body.mass_kg: is missing; there are mass, "),
    "misspelt body": (PAPER.replace("[body]", "[boddy]"), "body: is missing; did you misspell it as boddy?"),
    "misspelt rotor": (
        PAPER.replace("[[rotor]]", "[[rotors]]"),
        "rotor: is missing; did you misspell it as rotors?",
    ),
    "misspelt largest speed": (
        re.sub("thrust_to_weight|max_speed_rad_s", "max_sped_rad_s", PAPER),
        "rotor_type.max_speed_rad_s: is missing: give it or thrust_to_weight; did you misspell it as max_sped_rad_s?",
    ),
    "misspelt optional key": (
        PAPER.replace("lag_s", "lagg_s"),
        "rotor_type.lagg_s: is not a known key; did you mean lag_s?",
    ),
    "unknown key": (value("leg_height_m", "0.1\nwings = 2"), "body.wings: is not a known key"),
    "unknown key at the top": ("colour = 'red'\n" + PAPER, "colour: is not a known key"),
    "misspelt rotor key": (value("lag_s", "0.1\nlagg = 2"), "rotor_type.lagg: is not a known key"),
    "unknown key of a rotor": (
        changed(r'^spin = "cw"$', 'spin = "cw"\ntilt = 3', count=1),
        "rotor[0].tilt: is not a known key",
    ),
    "unknown spin": (
        changed(r'^spin = "ccw"$', 'spin = "left"', count=1),
        "rotor[1].spin: 'left' is not one of cw, ccw",
    ),
    "rotor beyond reach": (
        changed(r"\[0.2, 0.0, 0.0\]", "[20, 0, 0]"),
        "rotor[0].position_frd_m: 20 is outside the allowed range -10 to 10",
    ),
    "three rotors": (rotors(*SQUARE[:3]), "rotor: 3 rotors given, 4 to 8 are allowed"),
    "nine rotors": (rotors(*SQUARE, *SQUARE, SQUARE[0]), "rotor: 9 rotors given, 4 to 8 are allowed"),
    "no rotors": (PAPER[: PAPER.index("[[rotor]]")], "rotor: is missing"),
    "rotor that is no table": (
        "rotor = 4\n" + PAPER[: PAPER.index("[[rotor]]")],
        "rotor: must be an array of tables",
    ),
    "rotors in a row": (
        rotors(*[(x, 0.0, spin) for x, spin in ((0.1, "cw"), (0.2, "ccw"), (-0.1, "cw"), (-0.2, "ccw"))]),
        "rotor: the rotor geometry is singular",
    ),
    "all rotors turn alike, opposite each other": (
        rotors(*[(x, y, "cw") for x, y, _ in SQUARE]),
        "rotor: the rotor geometry is singular",
    ),
    "rotors all ahead": (
        rotors(*[(x + 0.5, y, spin) for x, y, spin in SQUARE]),
        "rotor: the rotors cannot hold the vehicle in hover: number",
    ),
    "too heavy": (
        re.sub("thrust_to_weight = .*", "max_speed_rad_s = 200", PAPER),
        "rotor: the rotors cannot hold the vehicle in hover: number 1 would need 215 rad/s, its range is 30 to 200",
    ),
    "idle speed that lifts off": (
        value("min_speed_rad_s", "250"),
        "rotor: the rotors cannot hold the vehicle in hover: number 1 would need 215 rad/s, its range is 250 to 303",
    ),
    "one rotor that carries too little": (
        rotors((0.2, 0.0, "cw"), (0.0, 0.2, "ccw"), (-0.1, 0.0, "cw"), (0.0, -0.2, "ccw")).replace(
            "thrust_to_weight = 2.0", "thrust_to_weight = 1.2"
        ),
        "rotor: the rotors cannot hold the vehicle in hover: number 3 would need 248 rad/s, its range is 30 to 235",
    ),
    "idle above the largest speed": (
        value("min_speed_rad_s", "500"),
        "rotor_type.min_speed_rad_s: 500 is not below the largest speed 303",
    ),
    "weak rotors": (
        value("thrust_to_weight", "0.9"),
        "rotor_type.thrust_to_weight: 0.9 is outside the allowed range 1.05 to 20",
    ),
    "negative lag": (value("lag_s", "-0.1"), "rotor_type.lag_s: -0.1 is outside the allowed range 0 to 1"),
    "no body": (PAPER.replace("[body]", "[trunk]"), "body: is missing"),
    "body that is no table": ("body = 3\n" + PAPER.replace("[body]", "[trunk]"), "body: must be a table"),
    "no name": (changed(r"^name.*\n", ""), "name: is missing"),
    "name that is no text": (value("name", "5"), "name: 5 is not a string"),
    "not TOML": ("mass = = 3", "is not valid TOML: "),
    "not UTF-8": (b"name = '\xff'", "is not valid TOML: "),
    "endless nesting": ("a = " + "[" * 20_000, "is not usable TOML"),
}


@pytest.mark.parametrize("name", BAD)
def test_errors_name_file_key_and_range(tmp_path: Path, name: str) -> None:
    text, sentence = BAD[name]
    with pytest.raises(ConfigError) as error:
        load_text(tmp_path, text)
    shown = str(error.value)
    assert shown.startswith(f"{tmp_path / 'my.toml'}: {sentence}"), shown
    assert "\n" not in shown


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nope", "nope: is neither a file nor a built-in vehicle (paper_quad, x_quad)"),
        (
            "x_quadd",
            "x_quadd: is neither a file nor a built-in vehicle (paper_quad, x_quad); did you mean x_quad?",
        ),
        ("no/such.toml", "no/such.toml: cannot be read: No such file or directory"),
        ("/", "/: cannot be read: Is a directory"),
    ],
)
def test_files_that_are_not_there(name: str, sentence: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_vehicle(name)
    assert str(error.value) == sentence


def with_params(lines: str) -> str:
    return changed(r"^\[params\]$", f"[params]\n{lines}", count=1)


def test_vehicle_file_gives_default_parameters(tmp_path: Path) -> None:
    vehicle = load_text(tmp_path, with_params("RTL_RETURN_ALT = 20\nMPC_TILTMAX_AIR = 30.0"))
    own = dict(vehicle.default_params)
    assert (own["RTL_RETURN_ALT"], own["MPC_TILTMAX_AIR"]) == (20.0, 30.0)
    config = StackConfig(vehicle=str(tmp_path / "my.toml"), state="truth")
    with World(vehicle=config.vehicle, state="truth") as world:
        stack = world.engine.stack
        assert stack.params.value("RTL_RETURN_ALT") == 20.0
        assert stack.now.behaviour.max_tilt_deg == 30.0
        assert stack.loops.get_parameter("MPC_TILTMAX_AIR") == 30.0
        assert stack.params.set("RTL_RETURN_ALT", 40.0) is None
        stack.params.reset()
        assert stack.params.is_default("RTL_RETURN_ALT")
        assert stack.params.value("RTL_RETURN_ALT") == 20.0
    given = replace(config, params=("RTL_RETURN_ALT=25",))
    assert read_parameters(given, ()).store.value("RTL_RETURN_ALT") == 25.0


@pytest.mark.parametrize("name", built_in_vehicles())
def test_estimator_has_the_noise_of_the_vehicle_file(name: str) -> None:
    own = dict(load_vehicle(name).default_params)
    with World(vehicle=name, state="estimated") as world:
        estimation = world.engine.stack.estimation
        assert estimation is not None
        params = estimation.estimator.params
        assert params.mag_noise_gauss == own["EKF2_MAG_NOISE"] != EstimatorParams().mag_noise_gauss
        assert (
            params.gnss_velocity_noise_m_s
            == own["EKF2_GPS_V_NOISE"]
            != EstimatorParams().gnss_velocity_noise_m_s
        )


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (
            "RTL_RETURN_AL = 20",
            "params.RTL_RETURN_AL: is no parameter of guidance, commander or estimator; did you mean",
        ),
        ("MC_ROLLRATE_P = 0.1", "params.MC_ROLLRATE_P: is no parameter of guidance, commander or estimator"),
        ("RTL_RETURN_ALT = -1", "params.RTL_RETURN_ALT: -1 is outside"),
        ('RTL_RETURN_ALT = "high"', "params.RTL_RETURN_ALT: 'high' is not a number"),
        ("EKF2_DRAG_CTRL = 0.5", "params.EKF2_DRAG_CTRL: 0.5 is not a whole number"),
    ],
)
def test_bad_default_parameter_raises_config_error(tmp_path: Path, line: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(problem)):
        load_text(tmp_path, with_params(line))


def test_limit_of_a_flight_and_timeouts_follow_the_vehicle_file(tmp_path: Path) -> None:
    load_text(tmp_path, with_params("MPC_XY_CRUISE = 0.5\nCOM_OF_LOSS_T = 4.0"))
    file, plan = str(tmp_path / "my.toml"), load_plan(MISSIONS / "square.plan")
    options = [FlyOptions(MISSIONS / "square.plan", vehicle=vehicle) for vehicle in (file, "paper_quad")]
    slow, usual = (longest_flight_s(chosen, plan) for chosen in options)
    assert slow > 2.0 * usual
    assert f"COM_OF_LOSS_T={8.0!r}" in (fly_options(Setup(vehicle=file), 0, 2.0).param or ())


def test_default_parameter_is_no_number_of_the_vehicle() -> None:
    with pytest.raises(ConfigError, match=r"params.RTL_RETURN_ALT: is no number of the vehicle"):
        load_vehicle_with("x_quad", {"params.RTL_RETURN_ALT": 12.0})
