"""Firmware generated for a user's controller."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from flightstack.control.control_law import AttitudeController
from flightstack.control.controller_loading import load_controller
from flightstack.core.errors import ConfigError
from flightstack.firmware.law_parity import Parity, law_parity
from flightstack.firmware.law_tree import firmware_for, generated_names, law_tree, write_tree
from flightstack.firmware.sources import firmware_root, source_hash
from gcs_cli.errors import CliError
from gcs_cli.pil import pil_commands
from tests.parity import generated_laws
from tests.support.plugin_site import example_module
from tests.support.tools import NIGHTLY

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def lqr(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AttitudeController:
    """The example's controller; generated firmware goes to a directory of the test."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    controller: AttitudeController = example_module().CONTROLLER
    return controller


def test_built_in_controller_uses_the_installed_firmware() -> None:
    assert law_tree(load_controller("pid")) == firmware_root() == ROOT / "firmware"


def test_user_controller_gets_a_whole_firmware_once(lqr: AttitudeController) -> None:
    tree = law_tree(lqr)
    assert tree.name.startswith("lqr-")
    assert generated_names(lqr) == {"lqr_controller.c", "lqr_controller.h"}
    assert {path.name for path in (tree / "core").iterdir()} >= generated_names(lqr) | {"fs_loops.c"}
    assert "run_attitude_lqr" in (tree / "core" / "fs_controllers.c").read_text()
    stamp = (tree / "core" / "lqr_controller.c").stat().st_mtime_ns
    assert law_tree(lqr) == tree
    assert (tree / "core" / "lqr_controller.c").stat().st_mtime_ns == stamp


def test_without_a_cache_to_write_to_firmware_is_generated_for_this_process(
    lqr: AttitudeController, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    tree = law_tree(lqr)
    assert tree.parent.name.startswith("flightstack-laws-")
    assert (tree / "core" / "lqr_controller.c").exists()


def test_target_with_a_user_controller_has_a_source_hash_of_its_own(lqr: AttitudeController) -> None:
    before = source_hash()
    with firmware_for(lqr) as tree:
        assert firmware_root() == tree
        assert source_hash() != before
    assert source_hash() == before
    assert firmware_root() == ROOT / "firmware"


def test_other_parameters_of_the_law_make_other_firmware(lqr: AttitudeController) -> None:
    other = lqr._replace(
        read_params=lambda vehicle, gains: lqr.read_params(vehicle, gains)._replace(angle_roll=1.0)
    )  # type: ignore[attr-defined]
    assert law_tree(other) != law_tree(lqr)


def test_oldest_generated_firmware_is_removed(
    lqr: AttitudeController, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flightstack.firmware.law_tree.KEPT_TREES", 1)
    first = law_tree(lqr)
    os.utime(first, (1.0, 1.0))
    second = law_tree(lqr._replace(name="other"))
    assert second.is_dir()
    assert not first.exists()


def test_law_with_a_function_of_portable_math_brings_it_along(
    lqr: AttitudeController, tmp_path: Path
) -> None:
    neural = AttitudeController(
        "neural", generated_laws.neural_step, generated_laws.GeometricMemory, generated_laws.NeuralParams, (0.0,),
        lambda vehicle, gains: (1.0,),
    )  # fmt: skip
    core = write_tree(neural, tmp_path / "firmware") / "core"
    assert "fs_exp(" in (core / "fs_portable_math.h").read_text()
    assert (core / "fs_law_math.h").exists()


def test_controller_that_needs_its_own_gains_file_starts_with_zeros(lqr: AttitudeController) -> None:
    demanding = lqr._replace(read_params=lambda vehicle, gains: lqr.params_type(gains.number("k", 0.0, 1.0)))
    text = (law_tree(demanding) / "core" / "fs_param_table.c").read_text()
    assert '{"LQR_ANGLE_ROLL", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U}' in text


def test_law_outside_the_subset_is_refused_with_line_and_advice(lqr: AttitudeController) -> None:
    stranger = lqr._replace(step=example_module().lqr_gains)
    with pytest.raises(ConfigError, match=r"lqr has no C: lqr_controller.py:\d+: power: write `x \* x`"):
        law_tree(stranger)


def test_generate_writes_firmware_and_names_the_laws_files(
    lqr: AttitudeController,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(pil_commands, "controller_named", lambda _: lqr)
    monkeypatch.setattr(pil_commands, "law_parity", lambda _: Parity(1000, 0))
    pil_commands.run_generate("lqr", tmp_path / "out", as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert told["files"] == ["lqr_controller.c", "lqr_controller.h"]
    assert told["steps_differing"] == 0
    assert (tmp_path / "out" / "ports" / "f28377s" / "CMakeLists.txt").exists()
    monkeypatch.setattr(pil_commands, "controller_named", load_controller)
    with pytest.raises(CliError, match="--controller pid: the firmware has it already"):
        pil_commands.run_generate("pid", tmp_path / "other", as_json=False)
    shutil.rmtree(tmp_path / "out")


def test_generate_fails_if_the_bits_differ(
    lqr: AttitudeController, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pil_commands, "controller_named", lambda _: lqr)
    monkeypatch.setattr(pil_commands, "law_parity", lambda _: Parity(1000, 3))
    with pytest.raises(CliError, match="differ in 3 of 1000 steps"):
        pil_commands.run_generate("lqr", tmp_path / "out", as_json=False)


def test_memory_of_other_types_than_float_is_refused(lqr: AttitudeController) -> None:
    with pytest.raises(ConfigError, match="field rates of IndiMemory is no float"):
        law_tree(lqr._replace(memory_type=generated_laws.IndiMemory))


@pytest.mark.skipif(not NIGHTLY, reason="compiles the law with Numba")
def test_generated_step_has_the_bits_of_the_compiled_one(lqr: AttitudeController) -> None:
    assert law_parity(lqr) == (1000, 0)
