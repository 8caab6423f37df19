"""Broken attitude controllers of users: one sentence each, which lists the installed ones."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from flightstack.control.controller import Controller
from flightstack.control.controller_loading import (
    compile_error,
    load_controller,
)
from flightstack.core.errors import ConfigError
from flightstack.params.config import StackConfig
from flightstack.process.assembly import build
from tests.support.plugin_site import EXAMPLE, GROUP, installed_site, new_site

MODULE = (EXAMPLE / "lqr_controller.py").read_text(encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return new_site(tmp_path / "site", monkeypatch)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return installed_site(tmp_path / "site", monkeypatch)


def replaced(old: str, new: str) -> str:
    assert old in MODULE
    return MODULE.replace(old, new)


RESULT = "its step must return (memory, torque), of types (Memory, Vector3), and returns "
BROKEN = {
    "its module is missing": (None, "broken:CONTROLLER cannot be loaded: No module named 'broken'"),
    "its module fails": (
        "import no_such_thing",
        "broken:CONTROLLER cannot be loaded: No module named 'no_such_thing'",
    ),
    "its module is no Python": (
        "def",
        "broken:CONTROLLER cannot be loaded: invalid syntax (broken.py, line 1)",
    ),
    "it exits": ("raise RuntimeError('many\\nlines')", "broken:CONTROLLER cannot be loaded: many"),
    "it has no such name": ("X = 1", "broken:CONTROLLER cannot be loaded: module 'broken' has no attribute"),
    "it is something else": (
        "CONTROLLER = 3",
        "broken:CONTROLLER is neither a Controller nor an AttitudeController",
    ),
    "it has another name": (
        MODULE,
        "broken:CONTROLLER calls itself 'lqr', and must bear the name of its entry point",
    ),
    "too little memory": (
        replaced('"lqr", step, Memory, Params, (0.0,)', '"broken", step, Memory, Params, ()'),
        "broken:CONTROLLER has 0 initial values for the 1 fields of its memory (one at least)",
    ),
    "memory of no type": (
        replaced('"lqr", step, Memory, Params', '"broken", step, dict, Params'),
        "broken:CONTROLLER has 1 initial values for the 0 fields of its memory (one at least)",
    ),
    "no parameters": (
        replaced('"lqr", step, Memory, Params', '"broken", step, Memory, tuple'),
        "broken:CONTROLLER has no parameters",
    ),
    "parameters fail": (
        replaced("    pairs = ", "    1 / 0\n    pairs = "),
        "its parameters cannot be read: division by zero",
    ),
    "too few parameters": (
        replaced("Params(*angle_gains, *rate_gains, *vehicle.inertia_kg_m2)", "(1.0, 2.0)"),
        "its read_params must return 9 finite numbers",
    ),
    "infinite parameters": (
        replaced("*vehicle.inertia_kg_m2)", "1.0, 1.0, math.inf)"),
        "its read_params must return 9 finite numbers",
    ),
    "unknown attribute in the step": (
        replaced("inputs.error_rad, inputs.rates", "inputs.errors, inputs.rates"),
        "its step cannot be compiled: Unknown attribute 'errors' of type AttitudeInputs(",
    ),
    "unknown name in the step": (
        replaced("+ ahead.x", "+ ahead_x"),
        "its step cannot be compiled: NameError: name 'ahead_x' is not defined (broken.py, line 40)",
    ),
    "unknown name in a function that the step calls": (
        replaced(
            "class Memory(", "@compiled\ndef half(x):\n    return x * factor\n\n\nclass Memory("
        ).replace("+ ahead.x", "+ half(ahead.x)"),
        "its step cannot be compiled: NameError: name 'factor' is not defined (broken.py, line 17)",
    ),
    "unknown function of a module": (
        replaced("params.rate_roll * (", "math.sqrtt("),
        "its step cannot be compiled: module 'math' has no attribute 'sqrtt' (broken.py, line 40)",
    ),
    "torque alone": (
        replaced("return memory, Vector3(", "return Vector3("),
        f"{RESULT}Vector3 (broken.py, line 43)",
    ),
    "nothing returned": (
        replaced("    return memory, Vector3(", "    Vector3("),
        f"{RESULT}None (broken.py, line 36)",
    ),
    "torque that is no vector": (
        replaced("return memory, Vector3(", "return memory, ("),
        f"{RESULT}(Memory, (float64, float64, float64)) (broken.py, line 43)",
    ),
    "memory that is a number": (
        replaced("return memory, Vector3(", "return roll, Vector3("),
        f"{RESULT}(float64, Vector3) (broken.py, line 43)",
    ),
    "one result too many": (
        replaced("return memory, Vector3(", "return memory, 0.0, Vector3("),
        f"{RESULT}(Memory, float64, Vector3) (broken.py, line 43)",
    ),
    "one argument too few": (
        replaced("params: Params, dt_s: float", "params: Params"),
        "broken:CONTROLLER has a step(memory, inputs, params), which must take (memory, inputs, params, dt_s)",
    ),
    "a step that is not compiled": (
        replaced("@compiled\ndef step", "def step"),
        "its step of attitude is not marked @compiled",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_controller_is_one_sentence_that_lists_the_installed_ones(site: Path, name: str) -> None:
    text, sentence = BROKEN[name]
    if text is not None:
        if "CONTROLLER has" not in sentence.replace("has a step", "") and "calls itself" not in sentence:
            text = text.replace('AttitudeController("lqr"', 'AttitudeController("broken"')
        (site / "broken.py").write_text(text)
    info = site / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nbroken = broken:CONTROLLER\n")
    importlib.invalidate_caches()
    with pytest.raises(ConfigError) as error:
        build(StackConfig(controller="broken"), lambda: None)
    shown = str(error.value)
    assert shown.startswith(f"--controller: broken: {sentence}"), shown
    assert shown.endswith("; installed are backstepping, broken, pid")
    assert "\n" not in shown
    assert len(shown) < 400


def test_colours_of_the_compiler_do_not_hide_the_reason() -> None:
    """Numba colours its messages if colorama is installed."""
    text = '\x1b[1mFailed in nopython mode\x1b[0m\n\x1b[1mUnknown attribute\x1b[0m\n\x1b[1mFile "a.py", line 3:\x1b[0m'
    assert "compiled: Unknown attribute; installed" in str(compile_error(Controller("pid"), ValueError(text)))


def test_two_packages_with_one_name_are_not_guessed_between(installed: Path) -> None:
    info = installed / "rival-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: rival\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nlqr = rival:CONTROLLER\n")
    with pytest.raises(ConfigError, match="several packages have a controller of this name: my-app, rival"):
        load_controller("lqr")
