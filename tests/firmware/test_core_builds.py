"""The core compiles without a warning, gives the same bits from every compiler, and runs clean under sanitizers."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.contract import LoopStatus
from flightstack.firmware.numbers import TARGET_NUMBERS, default_numbers
from tests.firmware.core_support import (
    CORE,
    EXACT,
    PYTHON,
    ROOT,
    WARNINGS,
    Core,
    Loops,
    library_path,
    run_tool,
    sources,
)
from tests.firmware.core_workout import workout
from tests.firmware.core_works import assert_equal, made_here, of_real, work_out
from tests.support.tools import NIGHTLY, missing

REALS = ("float", "double")


def test_clang_has_nothing_to_warn_of_with_double() -> None:
    """The static checks of all portable sources ask the same of gcc, and of both with float."""
    if not shutil.which("clang"):
        missing("no clang")
    flags = [*EXACT, *WARNINGS, *of_real("double"), f"-I{CORE}"]
    run_tool(["clang", *flags, "-fsyntax-only", *sources()])


@pytest.mark.parametrize("name", ["avr-gcc", "arm-none-eabi-gcc"])
def test_it_compiles_where_int_has_16_bits_and_where_nothing_is_beneath(name: str) -> None:
    if not shutil.which(name):
        missing(f"no {name}")
    machine = (
        ["-mmcu=atmega2560"]
        if name == "avr-gcc"
        else ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
    )
    flags = [*EXACT, *WARNINGS, "-ffreestanding", *machine]
    run_tool([name, *flags, f"-I{CORE}", "-fsyntax-only", *sources()])


BUILDS = [
    ("gcc", "-O0", "double"),
    ("gcc", "-O3", "float"),
    ("clang", "-O0", "float"),
    ("clang", "-O2", "double"),
]
OTHERS = [
    ("gcc", "-O0", "float"),
    ("gcc", "-O3", "double"),
    ("clang", "-O0", "double"),
    ("clang", "-O2", "float"),
]


@pytest.mark.parametrize(("name", "level", "real"), BUILDS + NIGHTLY * OTHERS)
def test_every_compiler_and_level_gives_the_same_bits(name: str, level: str, real: str) -> None:
    if not shutil.which(name):
        missing(f"no {name}")
    assert_equal(workout(Core(real, library_path(real, name, (level,)))), made_here(real))


SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g", "-O1")


@pytest.mark.parametrize("real", REALS if NIGHTLY else ["float"])
def test_the_sanitizers_find_nothing(real: str, tmp_path: Path) -> None:
    if not shutil.which("gcc"):
        missing("no gcc")
    run_time = run_tool(["gcc", "-print-file-name=libasan.so"]).strip()
    if not Path(run_time).is_absolute():
        missing("gcc has no address sanitizer here")
    library = library_path(real, "gcc", SANITIZERS)
    # Python is not built with the sanitizer, whose run time must come first; what Python keeps is no leak of ours
    made = work_out(real, library, tmp_path / "out.npz", LD_PRELOAD=run_time, ASAN_OPTIONS="detect_leaks=0")
    assert_equal(made, made_here(real))


def test_the_sanitizers_would_find_something(tmp_path: Path) -> None:
    if not shutil.which("gcc"):
        missing("no gcc")
    bad = tmp_path / "bad.c"
    bad.write_text(
        "int main(int count, char **words) { float f = 1e10F * (float)count; return (int)f + words[0][0]; }"
    )
    run_tool(["gcc", *SANITIZERS, bad, "-o", tmp_path / "bad"])
    done = subprocess.run([tmp_path / "bad"], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "outside the range" in done.stderr


@pytest.mark.parametrize("real", REALS)
def test_whatever_finite_goes_in_what_comes_out_is_finite(real: str) -> None:
    made = made_here(real)
    for law in (0, 1):
        assert np.isfinite(made[f"extreme {law}"]).all()
        assert not (made[f"extreme {law} status"] & LoopStatus.INPUT_NOT_FINITE).any()
    assert any(
        (made_here("float")[f"extreme {law} status"] & LoopStatus.OUTPUT_NOT_FINITE).any() for law in (0, 1)
    )


def test_costs_are_differences_of_the_clock_across_its_end() -> None:
    # the clock moves ten at each look: at the start, around the outer loop, before and after each part of the inner one
    first, plain, given, outer, _, unsound = made_here("float")["costs"].tolist()
    assert first == outer == [10, 10, 10, 50, 6]
    assert plain == given == [0, 10, 10, 40, 5]
    assert unsound == [10, 0, 0, 30, 4]


def test_the_outer_loop_is_due_in_every_nth_tick_and_the_first() -> None:
    made = made_here("float")
    for divisor in (0, 1, 5, 65535):
        ticks = np.arange(made[f"due {divisor}"].size)
        assert np.array_equal(made[f"due {divisor}"] == 1, ticks % max(1, divisor) == 0)


@pytest.mark.parametrize("real", REALS)
def test_every_parameter_starts_at_its_default_and_takes_its_range(real: str) -> None:
    core = Core(real)
    loops, defaults, tiny = Loops(core, {}), default_numbers(), core.dtype.type
    assert core.library.fs_param_count() == len(TARGET_NUMBERS)
    for index, number in enumerate(TARGET_NUMBERS):
        assert core.library.fs_param_name(index).decode() == number.name
        assert core.index(number.name) == index
        default = defaults[number.name]
        given = (
            0.0 if abs(default) < 1e-9 else float(f"{default:.12g}")
        )  # the generator's digits, and no rubbish
        assert loops.get(number.name) == tiny(given)  # to the last bit
    loops.set("POS_THR_MIN", 0.0)  # must not be above POS_THR_MAX
    for number in TARGET_NUMBERS:
        between = [] if number.is_whole else [number.high - (number.high - number.low) / 3.0]
        for value in (number.low, *between, number.high):
            assert loops.set(number.name, value) == 0
            assert loops.get(number.name) == tiny(value)
        beyond = [
            np.nextafter(tiny(number.low), tiny(-np.inf)),
            np.nextafter(tiny(number.high), tiny(np.inf)),
        ]
        for value in (*beyond, np.nan, np.inf, -np.inf, *([number.low + 0.5] if number.is_whole else [])):
            assert loops.set(number.name, value) == 1
            assert loops.get(number.name) == tiny(number.high)


@pytest.mark.parametrize("real", REALS)
def test_setting_a_parameter_changes_no_other(real: str) -> None:
    loops = Loops(Core(real), {})
    loops.set("POS_THR_MIN", 0.0)  # must not be above POS_THR_MAX
    for index, number in enumerate(TARGET_NUMBERS):
        before = loops.values()
        for value in (number.low, number.high):
            assert loops.set(number.name, value) == 0
        before[index] = loops.get(number.name)
        assert loops.values() == before


def test_a_name_ends_at_nul_or_after_16_characters() -> None:
    find = Core("float").library.fs_param_find
    assert find(b"MPC_TILTMAX_AIR") == find(b"MPC_TILTMAX_AIR\0rubbish") >= 0
    assert find(b"XPC_TILTMAX_AIR") == find(b"MPC_TILTMAX_AIR_") == -1
    assert find(b"MPC_TILTMAX_AIRS") == find(b"MPC_TILTMAX") == find(b"") == find(b"mpc_tiltmax_air") == -1


def test_the_generated_files_are_fresh() -> None:
    run_tool([PYTHON, "-m", "firmware.tools.generate_core", "--check"], cwd=ROOT)
