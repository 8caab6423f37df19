"""Open-loop replay of recorded flights: the same bits where C flew, and every planted fault found.

What is replayed here is computed by the C core inside this process: ``tests/processes/test_gcs_pil.py`` does it on
targets.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flightstack.control.attitude_pid import PidParams
from flightstack.control.controller import Controller, controller_of
from flightstack.core.contract import FloatArray, LoopFlags
from flightstack.core.errors import ConfigError
from flightstack.params.gains_file import BUILT_IN
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle
from gcs_cli.errors import CliError
from gcs_cli.pil.flight_samples import FlightSamples, read_samples
from gcs_cli.pil.replay import UnfitLogError, recording
from gcs_cli.pil.replay_run import Replay, fed, outcome_of, prepared
from gcs_cli.pil.result import Outcome
from tests.support.plugin_site import example_module
from tests.support.synthetic_flight import synthetic_flight_bytes
from tests.support.truth import World

FACTS: dict[str, Any] = {"title": "", "about": "", "meaning": "", "conditions": {}}


@functools.cache
def flown(loops: str, **config: Any) -> bytes:
    world = World(loops=loops, **config)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.engine.stack.params.set("PID_ROLL_P", 7.0) if config.get("controller") != "backstepping" else None
    world.run_until("not armed")
    return world.engine.logs[-1].content


def flown_in_the_air() -> bytes:
    """A log that ends in flight: a landing resets the loops, of which only ``loop_flags`` tells."""
    world = World(loops="c")
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_for(15.0)
    world.disarm(force=True)
    return world.engine.logs[-1].content


@pytest.fixture
def log(tmp_path: Path) -> Any:
    def write(content: bytes) -> Path:
        path = tmp_path / "flight.ulg"
        path.write_bytes(content)
        return path

    return write


def replayed(replay: Replay, tmp_path: Path) -> tuple[FloatArray, Outcome]:
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    return outputs, outcome_of(replay, outputs, None, True, FACTS)


def differing(outcome: Outcome) -> set[str]:
    """Return the signals that differ from the log."""
    rows = outcome.result["differences"]
    return {row["signal"] for row in rows if row["pair"] == "log–target" and row["largest"] != 0.0}


def of_log(outcome: Outcome) -> list[dict[str, Any]]:
    """Return the checks against the log."""
    return [check for check in outcome.result["checks"] if check["name"].startswith("log–target")]


@pytest.mark.parametrize(
    "config",
    [{}, {"vehicle": "x_quad", "controller": "backstepping", "wind": (4.0, 1.0, 0.0), "gust": 1.0}],
    ids=["pid", "backstepping in gusts"],
)
def test_a_flight_of_c_replays_to_the_last_bit(config: dict[str, Any], log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown("c", **config)), None)
    _, outcome = replayed(replay, tmp_path)
    assert differing(outcome) == set()
    assert outcome.passed
    assert {check["limit"] for check in of_log(outcome)} == {0.0}
    assert {row["signal"] for row in outcome.result["differences"]} >= {"target_attitude", "rotor_command"}


def test_a_flight_of_python_replays_within_the_stated_limits(log: Any, tmp_path: Path) -> None:
    _, outcome = replayed(prepared(log(flown("python")), None), tmp_path)
    assert outcome.passed
    assert "torque" in differing(outcome)
    for check in outcome.result["checks"]:
        if check["unit"] in ("ulp", "ppm") and check["measured"]:
            assert check["margin"] > 3.0, check  # measured 4 and more, stage by stage


def test_the_recording_knows_what_each_step_began_with(log: Any) -> None:
    record = prepared(log(flown("c")), None).record
    flags = record.flags.tolist()
    assert flags[0] == LoopFlags.RESET | LoopFlags.OUTER_DUE
    touches = LoopFlags.RESET | LoopFlags.SET_TARGET  # on contact with the ground
    assert set(flags) == {0, LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET, flags[0], touches}
    assert flags.count(flags[0]) == flags.count(touches) == 1
    assert np.array_equal(np.flatnonzero(record.is_outer), np.flatnonzero(record.flags))
    assert sum(len(names) for names in record.changes.values()) == 1  # PID_ROLL_P, in flight


def test_a_parameter_changed_in_flight_changes_in_the_replay(log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown("c")), None)
    deaf = replay._replace(record=replay.record._replace(changes={}))
    assert "torque" in differing(replayed(deaf, tmp_path)[1])


def next_float32(value: float) -> float:
    return float(np.nextafter(np.float32(value), np.float32(math.inf)))


@pytest.mark.parametrize(
    ("name", "change", "stage"),
    [
        ("POS_XY_P", next_float32, "attitude target"),
        ("ATT_REF_BW", next_float32, "attitude reference"),
        ("PID_PITCH_D", next_float32, "wrench"),
        ("FS_ALLOC_02", lambda value: -value, "actuators"),
        ("FS_MASS", next_float32, "attitude target"),
    ],
)
def test_a_planted_fault_is_found_in_its_stage(
    name: str, change: Any, stage: str, log: Any, tmp_path: Path
) -> None:
    replay = prepared(log(flown("c")), None)
    numbers = {**replay.setup.numbers(), **replay.numbers}
    planted = replay._replace(numbers={**replay.numbers, name: change(numbers[name])})
    _, outcome = replayed(planted, tmp_path)
    assert not outcome.passed
    failed = [check["name"] for check in outcome.result["checks"] if not check["passed"]]
    assert f"log–target {stage}" in failed
    if stage != "actuators":  # which reach back: the laws hear of saturation
        assert failed[0] == f"log–target {stage}"


def test_two_fields_that_changed_places_are_found(log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown("c")), None)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    swapped = outputs.copy()
    swapped[:, [16, 17]] = outputs[:, [17, 16]]  # roll and pitch torque
    assert differing(outcome_of(replay, swapped, None, True, FACTS)) == {"torque"}


def test_an_older_log_gives_its_targets_to_the_inner_loop(log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown_in_the_air()), None)
    topics = {name: dict(data) for name, data in replay.flight.topics.items()}
    del topics["vehicle_attitude_setpoint"]["loop_flags"]
    record = recording(replay.flight._replace(topics=topics))
    assert not record.tells_targets
    _, outcome = replayed(replay._replace(record=record), tmp_path)
    assert differing(outcome) == set()
    assert "target_attitude" not in {row["signal"] for row in outcome.result["differences"]}
    assert "does not tell" in outcome.result["meaning"]
    assert outcome.passed
    assert "log–target attitude target" not in {check["name"] for check in outcome.result["checks"]}


def test_the_verdict_of_a_board_is_not_asked_for_the_same_bits(log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown("c")), None)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    shaken = np.where(outputs == np.rint(outputs), outputs, outputs * (1.0 + 2.0**-23))
    assert not outcome_of(replay, shaken, None, True, FACTS).passed
    assert outcome_of(replay, shaken, None, False, FACTS).passed
    assert not outcome_of(replay, outputs * 1.01, None, False, FACTS).passed


def test_a_replay_that_compares_nothing_passes_nothing(log: Any, tmp_path: Path) -> None:
    replay = prepared(log(flown("c")), None)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    deaf = replay._replace(flight=without(replay.flight, "rotor_command"))
    (failed,) = [c for c in outcome_of(deaf, outputs, None, True, FACTS).result["checks"] if not c["passed"]]
    assert failed["name"] == "log–target actuators"
    assert failed["about"] == "rotor speed commands: no samples to compare"
    shifted = replay.record._replace(time_us=replay.record.time_us + 1)
    checks = of_log(outcome_of(replay._replace(record=shifted), outputs, None, True, FACTS))
    assert not any(check["passed"] for check in checks)


def without(flight: FlightSamples, name: str) -> FlightSamples:
    return flight._replace(signals={key: value for key, value in flight.signals.items() if key != name})


def test_logs_that_cannot_be_replayed_say_why(log: Any, tmp_path: Path) -> None:
    flight = read_samples(log(flown("c")))
    with pytest.raises(UnfitLogError, match="vehicle_angular_velocity"):
        recording(without(flight, "rates"))
    grounded = flight.status._replace(values=np.full_like(flight.status.values, 32.0))
    with pytest.raises(UnfitLogError, match="stayed on the ground"):
        recording(flight._replace(status=grounded))
    short = flight.signals["attitude"]
    cut = {**flight.signals, "attitude": short._replace(time_us=short.time_us[:99], values=short.values[:99])}
    with pytest.raises(UnfitLogError, match="attitude are missing"):
        recording(flight._replace(signals=cut))


def test_files_that_are_no_flight_logs_are_refused(log: Any, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        prepared(tmp_path / "none.ulg", None)
    with pytest.raises(ConfigError, match="not a readable flight log"):
        prepared(log(b"rubbish"), None)
    with pytest.raises((ConfigError, CliError)):
        prepared(log(synthetic_flight_bytes()), None)  # of a vehicle that nobody has
    whole = flown("c")
    cut = prepared(log(whole[: len(whole) // 3]), None)  # as after a power failure: what is whole is replayed
    assert 1000 < len(cut.record.time_us) < 6000
    assert differing(replayed(cut, tmp_path)[1]) == set()


def test_another_vehicle_is_refused(log: Any) -> None:
    with pytest.raises(CliError, match="was flown by another"):
        prepared(log(flown("c")), "x_quad")


def needy_controller() -> Controller:
    law = example_module().CONTROLLER
    tunables = (Tunable("angle_roll", "LQR_ROLL_ANGLE", 0.0, 1e4, "1/s^2", "Acceleration per angle error"),)

    def read(vehicle: Vehicle, gains: Table) -> tuple[float, ...]:
        inertia = gains.number("iz_kg_m2", 0.0, 1.0)
        return (*law.read_params(vehicle, gains)[:8], inertia)

    return controller_of(law._replace(read_params=read, tunables=tunables))


def test_a_law_that_needs_its_own_gains_table_is_replayed(
    log: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("flightstack.process.config_check", "flightstack.firmware.law_tree"):
        monkeypatch.setattr(f"{module}.load_controller", lambda _: needy_controller())
    gains = tmp_path / "gains.toml"
    gains.write_text((BUILT_IN / "tuned.toml").read_text() + "\n[attitude_lqr]\niz_kg_m2 = 0.02\n")
    world = World(loops="c", controller="lqr", gains=str(gains))
    world.takeoff(1.0)
    world.arm()
    world.takeoff(1.0)
    world.run_for(4.0)
    world.disarm(force=True)
    gains.unlink()
    path = log(world.engine.logs[-1].content)
    _, outcome = replayed(prepared(path, None), tmp_path)
    assert differing(outcome) == set()
    other = needy_controller()
    monkeypatch.setattr(
        "flightstack.firmware.law_tree.load_controller",
        lambda _: controller_of(other.attitude._replace(params_type=PidParams)),
    )
    with pytest.raises(ConfigError, match="flown by another version of the controller lqr: install that one"):
        prepared(path, None)
