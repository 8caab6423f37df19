"""A user's own attitude controller: the documented example installed and flown, and broken ones."""

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
    compile_error,
    controller_names,
    form_problem,
    load_controller,
)
from flightstack.control.mixer import mix
from flightstack.core import kernel_cache
from flightstack.core.compiled import specialised
from flightstack.core.contract import LoopRow
from flightstack.core.errors import ConfigError
from flightstack.core.kernel_cache import is_own
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, LoopsSetup
from flightstack.firmware.stages import StageModel
from flightstack.params.config import StackConfig
from flightstack.params.gains_file import BUILT_IN, open_gains
from flightstack.params.tunable import Tunable, undeclared
from flightstack.params.vehicle import load_vehicle
from flightstack.process.assembly import build
from flightstack.testing import World
from tests.support.commands import flightstack_command
from tests.support.console_blocks import File, steps
from tests.support.plugin_site import EXAMPLE, GROUP, ROOT, install

MODULE = (EXAMPLE / "lqr_controller.py").read_text(encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of installed packages that this process and its children see."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    for name in ("lqr_controller", "broken"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return folder


@pytest.fixture
def installed(site: Path) -> Path:
    install(site)
    importlib.invalidate_caches()
    return site


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
        ("largest_angle = 1", "attitude_lqr.largest_angle: is not a known key"),
        (
            "largest_angle_rad = [9, 9, 9]",
            "attitude_lqr.largest_angle_rad: 9 is outside the allowed range 0.001 to 3",
        ),
    ):
        path.write_text(f"{tuned}\n[attitude_lqr]\n{bad}\n")
        with pytest.raises(ConfigError) as error:
            build(StackConfig(controller="lqr", gains=str(path)), lambda: None)
        assert str(error.value) == f"{path}: {sentence}"


def test_an_edit_is_noticed(site: Path) -> None:
    """The key of the compiled loops names the sources: of the module, and of its package if it has one."""
    package = site / "laws"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "helper.py").write_text("GAIN = 1.0\n")
    (package / "lqr.py").write_text(MODULE)
    importlib.invalidate_caches()
    controller = importlib.import_module("laws.lqr").CONTROLLER
    keys = {controller.key}
    for name, text in (
        ("helper.py", "GAIN = 2.0\n"),
        ("lqr.py", MODULE + "# edited\n"),
        ("new.py", "X = 1\n"),
    ):
        (package / name).write_text(text)
        keys.add(controller.key)
    assert len(keys) == 4
    install(site)
    importlib.invalidate_caches()
    alone = load_controller("lqr").attitude
    key = alone.key
    (site / "neighbour.py").write_text("X = 1\n")  # another package in the same folder is no part of it
    assert alone.key == key
    for name in ("laws.lqr", "laws"):
        sys.modules.pop(name, None)


HELPERS = {
    "beside.py": """from pathlib import Path
from numba import njit
import beside_too
def limited(x): return min(x, beside_too.LIMIT) + WEIGHTS[0]
SCALE = 1.0
WEIGHTS = (float(Path(__file__).with_name("weight.txt").read_text()),)
@njit
def scaled(x): return SCALE * limited(x)
""",
    "beside_too.py": "LIMIT = 5.0\n",
    "weight.txt": "0.25",
}
"""A module beside a law, another one that it uses, and a file that it reads."""
HELPED = MODULE.replace(
    "from __future__ import annotations\n", "from __future__ import annotations\nimport beside\n"
).replace("return memory, ", "beside.scaled(dt_s)\n    return memory, ")


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("beside.py", "SCALE = 1.0", "SCALE = 2.0"),
        ("beside.py", "min(x,", "max(x,"),
        ("beside_too.py", "LIMIT = 5.0", "LIMIT = 6.0"),
        ("weight.txt", "0.25", "0.26"),
    ],
)
def test_an_edit_of_a_module_beside_the_law_is_noticed(
    site: Path, name: str, before: str, after: str
) -> None:
    assert "beside.scaled" in HELPED

    def key() -> str:
        importlib.invalidate_caches()
        for module in ("lqr_controller", "beside", "beside_too"):
            sys.modules.pop(module, None)
        return load_controller("lqr").attitude.key

    install(site)
    for file, text in {**HELPERS, "lqr_controller.py": HELPED}.items():
        (site / file).write_text(text)
    first = key()
    assert key() == first
    (site / "neighbour.py").write_text("X = 1\n")
    assert key() == first
    (site / name).write_text(HELPERS[name].replace(before, after))
    os.utime(site / name, (1e9, 1e9))  # the same size: bytecode is stale by its time
    assert key() != first


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
    monkeypatch.setattr("flightstack.process.assembly.load_controller", lambda _: taken)
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
    top, base = Path(kernel_cache.__file__).parents[2], Path(mix.stats.cache_path).parents[1]
    digests = {kernel_cache.digest(top, [name], numba.__version__) for name in sys.modules if is_own(name)}
    folders = {base / digest for digest in digests} | {
        Path(kernel.stats.cache_path).parent for kernel in specialised.values()
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


# ---------------------------------------------------------------------- broken ones


def replaced(old: str, new: str) -> str:
    assert old in MODULE
    return MODULE.replace(old, new)


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
        "its step cannot be compiled: NameError: name 'ahead_x' is not defined",
    ),
    "torque that is no vector": (
        replaced("return memory, Vector3(", "return memory, ("),
        "its step cannot be compiled: Unknown attribute 'x' of type",
    ),
    "one result too many": (
        replaced("return memory, Vector3(", "return memory, 0.0, Vector3("),
        "its step cannot be compiled: ",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_controller_is_one_sentence_that_lists_the_installed_ones(site: Path, name: str) -> None:
    text, sentence = BROKEN[name]
    if text is not None:
        if "CONTROLLER has" not in sentence and "calls itself" not in sentence:
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
    assert "compiled: Unknown attribute (a.py, line 3)" in str(compile_error("pid", ValueError(text)))


def test_two_packages_with_one_name_are_not_guessed_between(installed: Path) -> None:
    info = installed / "rival-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: rival\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nlqr = rival:CONTROLLER\n")
    with pytest.raises(ConfigError, match="several packages have a controller of this name: my-app, rival"):
        load_controller("lqr")
