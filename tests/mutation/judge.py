"""Run the fast tests of core, codec and application against a mutant, in a forked child of a process that is warm."""

from __future__ import annotations

import contextlib
import functools
import os
import resource
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest
from hypothesis import Phase
from hypothesis import settings as hypothesis_settings

from tests.mutation.cached_compiler import CachedCompiler, CompileError, WarningError
from tests.mutation.mutants import Mutant

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
COUNT = 20_000
"""Samples for each law, where the tests in earnest take 200 000, and a million at night."""
CPU_LIMIT_S = 30
TESTS = {
    "core": [
        *(
            "tests/parity/test_c_laws.py",
            "tests/parity/test_c_mixer.py",
            "tests/firmware/test_core_loops.py",
            "tests/firmware/test_core_math.py",
        ),
        *("tests/firmware/test_core_builds.py", "tests/parity/test_c_mission.py"),
    ],
    "mavlink": ["tests/firmware/test_codec_messages.py", "tests/firmware/test_codec_parser.py"],
    "app": [
        f"tests/firmware/test_app_{what}.py"
        for what in ("pil", "params", "windows", "baud", "free", "services", "safe_state", "damage")
    ],
}
HOST = Path("ports/host")
"""What the application's tests need beside the mutated parts."""
SLOW = "not compiler and not compiles and not sanitizers and not fresh and not own_no_memory"
"""Without these, of which each compiles everything again."""
KEPT = {"flight"}
"""Caches that hold what Python computed: missions as flown."""

KILLED, WARNED, LOOPED, SURVIVED = "killed", "warned of", "without end", "survived"
INVALID, UNTRIED = "no C", "not tried, by a fault of this program"
_CODES = [SURVIVED, KILLED, WARNED, INVALID, UNTRIED]


class Verdict(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    fate: str


def warm_up(parts: set[str], sources: Path, objects: Path) -> None:
    """Load the tests of these parts and run them against the true sources; SystemExit if one fails."""
    hypothesis_settings.register_profile(
        "mutation", database=None, deadline=None, derandomize=True, phases=[Phase.explicit, Phase.generate]
    )
    hypothesis_settings.load_profile("mutation")
    _shrink_samples()
    _use(sources)
    for part in sorted(parts):
        _compile_with(CachedCompiler(objects))
        if _run_tests(part) != pytest.ExitCode.OK:
            sys.exit(f"the tests of {part} fail without any mutant: see pytest {' '.join(TESTS[part])}")


def _helpers() -> tuple[ModuleType, ModuleType, ModuleType]:
    from tests.firmware import (  # noqa: PLC0415  the profile must be loaded before
        app_support,
        codec_support,
        core_support,
    )

    return core_support, codec_support, app_support


def _shrink_samples() -> None:
    from tests.firmware import test_core_math  # noqa: PLC0415
    from tests.parity import test_c_laws, test_c_mixer  # noqa: PLC0415

    test_c_laws.COUNT = test_c_mixer.COUNT = test_core_math.COUNT = COUNT
    test_c_mixer.mixed.__defaults__ = (COUNT // 5,)


def _compile_with(compiler: CachedCompiler) -> None:
    for module in _helpers():
        module.subprocess = compiler  # type: ignore[attr-defined]


def _run_tests(part: str) -> int:
    options = ["-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-k", SLOW]
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):
        return int(pytest.main([*options, *TESTS[part]]))


def _forget() -> None:
    """Empty the caches of the tests that hold what the true sources made."""
    for name, module in list(sys.modules.items()):
        if name.startswith(("tests.firmware", "tests.parity")):
            for word, thing in list(vars(module).items()):
                if isinstance(thing, functools._lru_cache_wrapper) and word not in KEPT:
                    thing.cache_clear()


def snapshot(folder: Path) -> None:
    """Copy the sources, so that all mutants are of the same state."""
    for part in TESTS:
        shutil.copytree(FIRMWARE / part, folder / part)
    shutil.copytree(FIRMWARE / HOST, folder / HOST)


def part_of(mutant: Mutant) -> str:
    """Return the folder that the mutant's file is in."""
    return next(part for part in TESTS if (FIRMWARE / part / mutant.file).exists())


def _use(sources: Path) -> None:
    """Let the tests compile core, codec and application of this folder."""
    core_support, codec_support, app_support = _helpers()
    app_support.FIRMWARE = sources
    core_support.CORE = sources / "core"
    codec_support.CODEC = sources / "mavlink"
    codec_support.SOURCES = sorted(codec_support.CODEC.glob("*.c"))


def _try(mutant: Mutant, work: Path, sources: Path, objects: Path) -> int:
    """Build and test one mutant; return an index of _CODES."""
    part = part_of(mutant)
    folder = work / part
    shutil.copytree(sources, work, dirs_exist_ok=True)
    path = folder / mutant.file
    path.write_text(mutant.applied(path.read_text()))
    _use(work)
    tempfile.tempdir = str(work)
    mutated_objects = work / "objects"
    shutil.copytree(objects, mutated_objects, copy_function=os.link)
    compiler = CachedCompiler(mutated_objects, mutant.file)
    _compile_with(compiler)
    _forget()
    try:
        _build(part, work)
    except CompileError:
        return 3
    except WarningError:
        return 2
    return 1 if _run_tests(part) else 0


def _build(part: str, work: Path) -> None:
    core_support, codec_support, app_support = _helpers()
    if part == "core":
        for real in ("double", "float"):
            core_support.library_path(real)
    elif part == "mavlink":
        codec_support.load(work)
    else:
        app_support.library()


def start(mutant: Mutant, work: Path, sources: Path, objects: Path) -> int:
    """Fork a child that tries the mutant in the empty folder ``work``, and return its process id."""
    child = os.fork()
    if child:
        return child
    code = _CODES.index(UNTRIED)
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with Path(os.devnull).open("w") as nothing:
            os.dup2(nothing.fileno(), 1)
            os.dup2(nothing.fileno(), 2)
            code = _try(mutant, work, sources, objects)
    finally:
        os._exit(code)


def fate_of(status: int) -> str:
    """Return what a child's wait status says."""
    if os.WIFSIGNALED(status):
        return LOOPED if os.WTERMSIG(status) in {signal.SIGXCPU, signal.SIGKILL} else KILLED
    return _CODES[os.waitstatus_to_exitcode(status)]
