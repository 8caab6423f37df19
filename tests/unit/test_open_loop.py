"""The command ``sim-bridge open-loop``, in process: JSON, table and errors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from sim_bridge.command import run_command as main
from sim_bridge.open_loop import split_time


def fly(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    code = main(["open-loop", *arguments, "--json"])
    out = capsys.readouterr().out
    assert code == 0
    return json.loads(out)


def test_json_has_the_documented_keys(capsys: pytest.CaptureFixture[str]) -> None:
    state = fly(capsys, "--rotors", "200,210,200,210", "--seconds", "0.5", "--no-ground")
    keys = "time_s pos_ned_m vel_ned_m_s quaternion euler_rad rates_frd_rad_s rotor_speed_rad_s"
    assert list(state) == keys.split()
    assert [len(value) for value in list(state.values())[1:]] == [3, 3, 4, 3, 3, 4]


@pytest.mark.parametrize("plant", ["rigid", "paper", "multibody"])
def test_zero_duration_returns_the_initial_state(capsys: pytest.CaptureFixture[str], plant: str) -> None:
    state = fly(
        capsys, "--plant", plant, "--rotors", "-5,6,7,8", "--seconds", "0", "--no-lag", "--pos", "1,2,-3",
        "--vel", "-4,5,6", "--euler-deg", "10,-20,30", "--rates", "0.1,0.2,0.3",
    )  # fmt: skip
    assert state["pos_ned_m"] == [1.0, 2.0, -3.0]
    assert state["vel_ned_m_s"] == [-4.0, 5.0, 6.0]
    assert state["euler_rad"] == pytest.approx([math.radians(a) for a in (10, -20, 30)], abs=1e-15)
    assert state["rates_frd_rad_s"] == [0.1, 0.2, 0.3]
    assert state["rotor_speed_rad_s"] == [-5.0, 6.0, 7.0, 8.0]


def test_no_lag_option_starts_rotors_at_speed(capsys: pytest.CaptureFixture[str]) -> None:
    common = ("--vehicle", "x_quad", "--rotors", "600,600,600,600", "--seconds", "0.02")
    lagging = fly(capsys, *common)["rotor_speed_rad_s"]
    assert lagging == pytest.approx([600.0 * (1.0 - math.exp(-1.0))] * 4, rel=1e-12)
    assert fly(capsys, *common, "--no-lag")["rotor_speed_rad_s"] == [600.0] * 4


def test_ground_holds_unless_disabled(capsys: pytest.CaptureFixture[str]) -> None:
    common = ("--rotors", "0,0,0,0", "--seconds", "1")
    assert fly(capsys, *common)["pos_ned_m"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert fly(capsys, *common, "--no-ground")["pos_ned_m"] == pytest.approx([0.0, 0.0, 4.905], abs=1e-12)


def test_time_need_not_be_a_multiple_of_the_step(capsys: pytest.CaptureFixture[str]) -> None:
    state = fly(capsys, "--rotors", "0,0,0,0", "--seconds", "1.00037", "--dt", "0.01", "--no-ground")
    assert state["pos_ned_m"][2] == pytest.approx(0.5 * 9.81 * 1.00037**2, abs=1e-12)


@pytest.mark.parametrize(
    ("seconds", "dt_s", "expected"),
    [
        (0.3, 0.1, (3, 0.3 / 3, 0.0)),
        (0.0, 0.1, (0, 0.1, 0.0)),
        (0.05, 0.1, (0, 0.1, 0.05)),
        (1e5, 1e-3, (10**8, 1e-3, 0.0)),
    ],
)
def test_split_time(seconds: float, dt_s: float, expected: tuple[int, float, float]) -> None:
    assert split_time(seconds, dt_s) == expected


def test_acceleration_agrees_with_a_hand_calculation(capsys: pytest.CaptureFixture[str]) -> None:
    """Paper vehicle: m 0.55, b 2.93e-5, d 7.2e-7, l 0.2, J_r 6.3e-5, I 7.2e-3, 7.2e-3, 1.1e-2."""
    air = ("--no-ground", "--no-lag", "--seconds")
    hover = ",".join([repr(math.sqrt(0.55 * 9.81 / (4 * 2.93e-5)))] * 4)
    assert fly(capsys, *air, "10", "--rotors", hover)["pos_ned_m"] == pytest.approx([0, 0, 0], abs=1e-12)
    yawing = fly(capsys, *air, "1", "--rotors", "200,210,200,210")["rates_frd_rad_s"]
    assert yawing == pytest.approx([0.0, 0.0, 2 * 7.2e-7 * (210**2 - 200**2) / 1.1e-2], abs=1e-12)
    # over a short time: roll by a4 q Ωr and U2, constant pitch
    turning = fly(capsys, *air, "1e-4", "--rotors", "0,300,0,310", "--rates", "0,1,0")["rates_frd_rad_s"]
    roll = (6.3e-5 * (300 + 310) * 1.0 + 0.2 * 2.93e-5 * (310**2 - 300**2)) / 7.2e-3
    assert turning[0] == pytest.approx(1e-4 * roll, rel=1e-4)  # measured: 3.1e-5


def test_gusty_torque_is_the_same_for_the_same_seed(capsys: pytest.CaptureFixture[str]) -> None:
    common = ("--rotors", "0,0,0,0", "--seconds", "3", "--no-ground", "--torque-gust", "0.01", "--seed")
    first, again, other = (fly(capsys, *common, seed)["rates_frd_rad_s"] for seed in ("1", "1", "2"))
    assert first == again != other
    assert min(abs(rate) for rate in first) > 1e-3


def test_start_below_the_ground_is_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    common = ["open-loop", "--rotors", "0,0,0,0", "--seconds", "0", "--euler-deg", "90,0,0"]
    for more, said in (([], "0.1 m below the ground"), (["--pos", "0,0,-0.11"], ""), (["--no-ground"], "")):
        assert main([*common, *more]) == 0
        shown = capsys.readouterr()
        assert said in shown.err
        assert bool(shown.err) == bool(said)
        assert shown.out


def test_ground_contact_with_long_steps_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    """Springs that are stable at long steps are soft; in the air long steps are allowed."""
    common = ["--rotors", "0,0,0,0", "--dt", "0.1", "--pos", "0,0,-100", "--json", "--seconds"]
    fallen = fly(capsys, *common, "4")["pos_ned_m"]
    assert fallen[2] == pytest.approx(-100.0 + 0.5 * 9.81 * 16.0, abs=1e-9)
    assert main(["open-loop", *common, "5"]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "--dt: with steps of 0.1 s the vehicle sinks 1 m into the ground" in shown.err


def test_disturbances_act(capsys: pytest.CaptureFixture[str]) -> None:
    state = fly(
        capsys,
        "--rotors",
        "0,0,0,0",
        "--seconds",
        "1",
        "--no-ground",
        "--force",
        "0.55,0,0",
        "--torque",
        "0,0,0.011",
    )
    assert state["vel_ned_m_s"][0] == pytest.approx(1.0, abs=1e-12)
    assert state["rates_frd_rad_s"][2] == pytest.approx(1.0, abs=1e-12)


def test_table_shows_the_same_figures(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["open-loop", "--rotors", "0,0,0,0", "--seconds", "1", "--no-ground"]) == 0
    table = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines()}
    assert table["pos_ned_m"] == ["0", "0", "4.905"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rotors", "1,2,3", "--seconds", "1"], "has 3 numbers, 4 are needed"),
        (["--rotors", "1,2,3,x", "--seconds", "1"], "is not 4 numbers"),
        (["--rotors", "1,2,3,nan", "--seconds", "1"], "outside the allowed range"),
        (["--rotors", "1,2,3,4", "--seconds", "-1"], "--seconds: -1 is outside"),
        (["--rotors", "1,2,3,4", "--seconds", "nan"], "--seconds: nan is outside"),
        (["--rotors", "1,2,3,4", "--seconds", "1e9"], "--seconds: 1000000000 is outside"),
        (["--rotors", "1,2,3,4", "--seconds", "1e5", "--dt", "1e-4"], "are 1e+09 steps, more than 1e+08"),
        (["--rotors", "1_0,2,3,4", "--seconds", "1"], "is not 4 numbers"),
        (["--rotors", "5", "--seconds", "1"], "has 1 number, 4 are needed"),
        (["--rotors", "1," * 10_000 + "1", "--seconds", "1"], "1,…' has 10001 numbers, 4 are needed"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--torque-gust", "nan"], "--torque-gust: nan is outside"),
        (["--rotors", "1,2,3,4", "--seconds", "soon"], "--seconds"),
        (["--rotors", "1,2,3,4"], "--seconds"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--dt", "0"], "--dt: 0 is outside"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--plant", "flat"], "'flat' is not one of rigid, paper"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--pos", "0,0,1"], "below the ground"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--vehicle", "blimp"], "blimp"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--euler-deg", "1,2"], "has 2 numbers"),
        (["--rotors", "1,2,3,4", "--seconds", "1", "--bogus"], "--bogus"),
    ],
)
def test_bad_arguments_are_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert main(["open-loop", *arguments]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert said in shown.err
    assert shown.err.count("\n") == 1
    assert len(shown.err) < 200


def test_bad_vehicle_file_is_one_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "heavy.toml"
    file.write_text("name = 'heavy'\n[body]\nmass_kg = -1\n[rotor_type]\n")
    assert main(["open-loop", "--rotors", "1,2,3,4", "--seconds", "1", "--vehicle", str(file)]) == 2
    assert "body.mass_kg: -1 is outside the allowed range" in capsys.readouterr().err


@pytest.mark.parametrize("more", [["--torque", "1e9,1e9,1e9"], ["--rates", "1100,0,0"]])
def test_divergence_is_a_failure_not_a_number(capsys: pytest.CaptureFixture[str], more: list[str]) -> None:
    """Also with a finite state: more than 1 rad per step is not resolved."""
    common = ["open-loop", "--rotors", "0,0,0,0", "--seconds", "9", "--no-ground"]
    assert main([*common, *more]) == 1
    assert "diverged" in capsys.readouterr().err
