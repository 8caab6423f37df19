"""A user's own attitude controller: the documented example installed and flown."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from flightstack.control.attitude_pid import CONTROLLER as PID
from flightstack.control.controller_loading import (
    controller_names,
    form_problem,
    load_controller,
)
from flightstack.control.mixer import mix
from flightstack.core.compiled import specialised
from flightstack.core.contract import LoopRow
from flightstack.core.errors import ConfigError
from flightstack.core.kernels import cache as kernel_cache
from flightstack.core.kernels.cache import is_own
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, LoopsSetup
from flightstack.firmware.stages import StageModel
from flightstack.params.config import StackConfig
from flightstack.params.gains_file import BUILT_IN, open_gains
from flightstack.params.tunable import Tunable, undeclared
from flightstack.params.vehicle import load_vehicle
from flightstack.process.assembly import build
from tests.support.commands import flightstack_command
from tests.support.console_blocks import File, steps
from tests.support.plugin_site import EXAMPLE, GROUP, ROOT, install, installed_site, new_site
from tests.support.truth import World

MODULE = (EXAMPLE / "lqr_controller.py").read_text(encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return new_site(tmp_path / "site", monkeypatch)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return installed_site(tmp_path / "site", monkeypatch)


# ---------------------------------------------------------------------- the example


def test_the_documentation_shows_the_example_as_it_is() -> None:
    shown = list(steps(ROOT / "docs" / "tutorials" / "controller.md"))
    assert File("lqr_controller.py", MODULE) in shown
    (documented,) = (step.text for step in shown if isinstance(step, File) and step.name == "pyproject.toml")
    declared = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    plugins, own = (tomllib.loads(text)["project"]["entry-points"][GROUP] for text in (documented, declared))
    assert plugins == own


def test_an_installed_controller_is_listed(installed: Path) -> None:
    assert controller_names() == ["backstepping", "lqr", "pid"]
    assert load_controller("lqr").name == "lqr"


def test_its_gains_solve_the_riccati_equation(installed: Path) -> None:
    load_controller("lqr")
    gains = sys.modules["lqr_controller"].lqr_gains(0.2, 2.5, 40.0)
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    weight, effort = np.diag([1 / 0.2**2, 1 / 2.5**2]), np.array([[1 / 40.0**2]])
    solution = solve_continuous_are(a, b, weight, effort)
    assert gains == pytest.approx((b.T @ solution / effort).ravel(), rel=1e-9)


@pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
def test_it_flies_the_square(installed: Path, vehicle: str) -> None:
    world = World(controller="lqr", vehicle=vehicle)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 60.0)
    assert world.reached == [0, 1, 2, 3, 4, 5]
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.05  # 13 mm seen


def test_its_own_table_in_a_gains_file_is_read_and_checked(installed: Path, tmp_path: Path) -> None:
    tuned = (BUILT_IN / "tuned.toml").read_text(encoding="utf-8")
    path = tmp_path / "my.toml"
    path.write_text(tuned + "\n[attitude_lqr]\nlargest_angle_rad = [0.1, 0.1, 0.2]\n")
    build(StackConfig(controller="lqr", gains=str(path)), lambda: None)
    for bad, sentence in (
        (
            "largest_angle = 1",
            "attitude_lqr.largest_angle: is not a known key; did you mean largest_angle_rad?",
        ),
        (
            "largest_angle_rad = [9, 9, 9]",
            "attitude_lqr.largest_angle_rad: 9 is outside the allowed range 0.001 to 3",
        ),
    ):
        path.write_text(f"{tuned}\n[attitude_lqr]\n{bad}\n")
        with pytest.raises(ConfigError) as error:
            build(StackConfig(controller="lqr", gains=str(path)), lambda: None)
        assert str(error.value) == f"{path}: {sentence}"


# ---------------------------------------------------------------------- its parameters


def test_without_a_declaration_every_field_is_a_parameter(installed: Path) -> None:
    world = World(controller="lqr", force=(0.0, 0.3, 0.0), params={"LQR_ANGLE_ROLL": 250})
    params = world.engine.stack.params
    assert [name for name in params.specs if name.startswith("LQR_")] == [
        "LQR_ANGLE_PITCH", "LQR_ANGLE_ROLL", "LQR_ANGLE_YAW", "LQR_IX_KG_M2", "LQR_IY_KG_M2", "LQR_IZ_KG_M2",
        "LQR_RATE_PITCH", "LQR_RATE_ROLL", "LQR_RATE_YAW",
    ]  # fmt: skip
    spec = params.specs["LQR_ANGLE_ROLL"]
    assert (spec.default, spec.low, spec.high, spec.group) == (
        pytest.approx(200.0), -1e6, 1e6, "Attitude Controller lqr",
    )  # fmt: skip
    assert world.engine.stack.loops.get_parameter("LQR_ANGLE_ROLL") == 250.0
    world.arm()
    world.takeoff(2.0)
    world.run_for(1.0)
    before = world.engine.stack.now.row.copy()
    params.set("LQR_IX_KG_M2", 0.0)
    world.tick()
    assert before[LoopRow.WRENCH][1] != 0.0
    assert world.engine.stack.now.row[LoopRow.WRENCH][1] == 0.0, "no inertia, no torque, in the next tick"


def test_a_declaration_chooses_names_and_ranges(site: Path) -> None:
    text = MODULE.replace("Params, (0.0,), read_params)", "Params, (0.0,), read_params, TUNABLES)").replace(
        "CONTROLLER =",
        'TUNABLES = (Tunable("angle_roll", "LQR_Q", 0.0, 500.0, "1/s^2", "Stiffness"),)\n\nCONTROLLER =',
    )
    install(site)
    (site / "lqr_controller.py").write_text("from flightstack.params.tunable import Tunable\n" + text.replace(
        "from __future__ import annotations\n", ""))  # fmt: skip
    importlib.invalidate_caches()
    stack = build(StackConfig(controller="lqr"), lambda: None)
    assert [name for name in stack.params.specs if name.startswith("LQR_")] == ["LQR_Q"]
    assert stack.params.set("LQR_Q", 501.0) == "501 is outside 0 to 500 1/s^2"


def test_names_made_of_fields_fit_and_differ() -> None:
    fields = ("rate_feedforward_x", "rate_feedforward_y", "q", "Ω", "kp.1")
    names = [tunable.name for tunable in undeclared("my-very-own", fields)]
    assert names == ["MY_V_RATE_FEEDFO", "MY_V_RATE_FEED_2", "MY_V_Q", "MY_V_P", "MY_V_KP_1"]


BAD_DECLARATIONS = {
    "no declaration": ([3], "must declare its parameters as a tuple of Tunable"),
    "small letters": (
        (Tunable("unused", "lqr_q", 0, 1, "", "Q"),),
        "needs another name (A to Z, 0 to 9 and _, at most 16) for its parameter 'lqr_q'",
    ),
    "no such field": ((Tunable("q", "LQR_Q", 0, 1, "", "Q"),), "has no field 'q' for its parameter 'LQR_Q'"),
    "no such memory": (
        (Tunable("kp_roll", "LQR_Q", 0, 1, "", "Q", integrates="x"),),
        "has no field 'x' in its memory for its parameter 'LQR_Q'",
    ),
    "no range": ((Tunable("kp_roll", "LQR_Q", 1, 1, "", "Q"),), "has no range for its parameter 'LQR_Q'"),
    "twice": ((Tunable("kp_roll", "LQR_Q", 0, 1, "", "Q"),) * 2, "declares a parameter twice"),
}


@pytest.mark.parametrize("name", BAD_DECLARATIONS)
def test_a_declaration_that_cannot_be(name: str) -> None:
    tunables, sentence = BAD_DECLARATIONS[name]
    assert form_problem("pid", PID._replace(tunables=tunables)) == sentence


def test_a_name_that_the_vehicle_has_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = PID._replace(tunables=(Tunable("kp_roll", "MPC_XY_CRUISE", 0, 1e5, "", "Gain"),))
    monkeypatch.setattr("flightstack.process.config_check.load_controller", lambda _: taken)
    with pytest.raises(
        ConfigError, match="declares the parameter MPC_XY_CRUISE, which the vehicle has already"
    ):
        build(StackConfig(), lambda: None)


# ---------------------------------------------------------------------- as a process


def run(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    command = [sys.executable, "-m", "flightstack", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_command_takes_an_installed_controller_and_lists_them_for_an_unknown_one(installed: Path) -> None:
    done = run(installed, "--controller", "lqr", "--check")
    assert done.returncode == 0, done.stderr
    assert "lqr" in done.stdout
    unknown = flightstack_command("--controller", "lqg", "--check")
    assert unknown.returncode == 2
    assert unknown.stderr == (
        "flightstack: --controller: lqg: there is no such attitude controller; "
        "installed are backstepping, lqr, pid\n"
    )


def test_a_controller_that_is_gone_leaves_the_others_compilable(installed: Path) -> None:
    """Our functions' caches name no type of a user's package: Numba would import it to read any of them."""
    build(StackConfig(controller="lqr"), lambda: None)
    vehicle, gains = load_vehicle("paper_quad"), open_gains("tuned")
    model = StageModel(LoopsSetup(vehicle, load_controller("lqr"), gains, 0.6, 500.0, 100.0, 5))
    model.expected(np.zeros((1, INPUT_SIZE)), np.zeros(1, np.int64), np.zeros((1, OUTPUT_SIZE)))
    top, base = Path(kernel_cache.__file__).parents[3], Path(mix.stats.cache_path).parents[1]
    digests = {kernel_cache.digest(top, [name], numba.__version__) for name in sys.modules if is_own(name)}
    folders = {base / digest for digest in digests} | {
        Path(path).parent for kernel in specialised.values() if (path := kernel.stats.cache_path)
    }
    indices = [path for folder in folders for path in folder.rglob("*.nbi")]
    kernels = [path for path in indices if "kernel__lqr" in path.name]
    assert {path.name.partition("__lqr")[0] for path in kernels} >= {
        "loop_kernels.inner_kernel",
        "stages.stages_kernel",
    }
    for path in indices:
        if path not in kernels:
            assert b"lqr_controller" not in path.read_bytes(), path.name
