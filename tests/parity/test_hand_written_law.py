"""A law in C by hand flies in C on the host and, with the same bits, on the emulated target."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flightstack.control.control_law import ControlLaw, CStep
from flightstack.control.controller import controller_of
from flightstack.core.errors import ConfigError
from flightstack.firmware.c_loops import HostLoops, LoopsSetup
from flightstack.firmware.law_parity import law_parity
from flightstack.firmware.law_tree import firmware_for, law_tree
from flightstack.firmware.targets import make_loops
from flightstack.firmware.toolchain.build import host_library
from flightstack.params.config import StackConfig
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from flightstack.process.config_check import check
from gcs_cli.pil import pil_commands
from gcs_cli.pil.replay_run import fed, outcome_of, prepared
from tests.support.bare_target import without_estimator
from tests.support.plugin_site import ROOT
from tests.support.truth import World


@pytest.fixture
def law(monkeypatch: pytest.MonkeyPatch) -> ControlLaw:
    """The example's law, which ``--controller rate-pd`` names."""
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "c_law"))
    found: ControlLaw = importlib.import_module("rate_pd").CONTROLLER
    for module in ("flightstack.process.config_check", "flightstack.testing.setup"):
        monkeypatch.setattr(f"{module}.load_controller", lambda _: found)
    return found


def setup_of(law: ControlLaw) -> LoopsSetup:
    return LoopsSetup(load_vehicle("x_quad"), law, open_gains("tuned"), 0.6, 500.0, 100.0, 5)


def test_a_law_in_c_flies_the_square(law: ControlLaw) -> None:
    world = World(loops="c", controller="rate-pd")
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 60.0)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.05  # 13 mm seen
    assert world.engine.stack.loops.get_parameter("RPD_ANGLE") == 150.0


def test_a_law_in_c_has_the_same_bits_on_the_emulated_target(law: ControlLaw) -> None:
    setup, random = setup_of(law), np.random.default_rng(1)
    with without_estimator():
        here, there = (make_loops(loops, setup) for loops in ("c", "emulated"))
    rows = np.zeros(48), np.zeros(48)
    for loops in (here, there):
        loops.reset(np.array([0.0] * 6 + [1.0] + [0.0] * 6))
    for tick in range(200):
        attitude = np.array([1.0, *random.normal(0.0, 0.1, 3)])
        attitude /= np.linalg.norm(attitude)
        state = np.concatenate([random.normal(size=6), attitude, random.normal(0.0, 0.5, 3)])
        setpoint = random.normal(size=11)
        for loops, row in zip((here, there), rows, strict=True):
            loops.step(state, setpoint, np.zeros(8, np.float32), tick % 5 == 0, row)
        assert rows[0].tobytes() == rows[1].tobytes(), tick
    here.close()
    there.close()


def test_a_reset_calls_init(law: ControlLaw) -> None:
    setup = setup_of(law)
    with firmware_for(law):
        loops = HostLoops(host_library(), setup.numbers())
    outputs = []
    for rate, flags in ((0.1, 5), (0.2, 0), (0.1, 5)):
        loops.input[:] = 0.0
        loops.input[6], loops.input[10] = 1.0, rate
        loops.step(flags)
        outputs.append(loops.output.copy())
    assert outputs[0].tolist() == outputs[2].tolist() != outputs[1].tolist()


def test_loops_in_python_refuse_a_law_in_c(law: ControlLaw) -> None:
    with pytest.raises(ConfigError, match="its law of attitude is written in C: fly it with --loops c, host"):
        check(StackConfig(controller="rate-pd"))
    check(StackConfig(controller="rate-pd", loops="c"))


def test_a_law_in_c_has_no_step_to_compare_with_python(law: ControlLaw) -> None:
    assert law_parity(law) == (0, 0)


def test_generate_says_that_a_law_in_c_is_not_compared(
    law: ControlLaw, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pil_commands, "controller_named", lambda _: law)
    pil_commands.run_generate("rate-pd", tmp_path / "text", as_json=False)
    assert capsys.readouterr().out.endswith("nothing to compare: the law is written in C\n")
    pil_commands.run_generate("rate-pd", tmp_path / "json", as_json=True)
    assert json.loads(capsys.readouterr().out)["steps_compared"] == 0


def test_a_file_of_the_firmwares_name_is_refused(law: ControlLaw) -> None:
    assert isinstance(law.step, CStep)
    core = ROOT / "firmware" / "core"
    with pytest.raises(
        ConfigError, match=r"fs_loops\.h needs another name: those with fs_ belong to the firmware"
    ):
        law_tree(law._replace(step=law.step._replace(header=core / "fs_loops.h")))


def test_a_flight_of_a_law_in_c_is_replayed(
    law: ControlLaw, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flightstack.firmware.law_tree.load_controller", lambda _: controller_of(law))
    world = World(loops="c", controller="rate-pd")
    world.arm()
    world.takeoff(1.0)
    world.run_for(4.0)
    world.disarm(force=True)
    path = tmp_path / "flight.ulg"
    path.write_bytes(world.engine.logs[-1].content)
    replay = prepared(path, None)
    outputs, _ = fed(replay, "c", tmp_path, Console(quiet=True))
    facts: dict[str, Any] = {"title": "", "about": "", "meaning": "", "conditions": {}}
    outcome = outcome_of(replay, outputs, None, True, facts)
    assert outcome.passed
    assert outcome.result["differences"]
    assert all(row["largest"] == 0.0 for row in outcome.result["differences"])
    assert outcome.result["meaning"].endswith("it has no stage in Python to compare with.")
    assert not outcome_of(replay, outputs * 1.01, None, True, facts).passed
