"""Try mutants in forks of a pytest session that has collected and run the fast tests; the likeliest test goes first."""

from __future__ import annotations

import functools
import gc
import mmap
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from _pytest.runner import runtestprotocol
from hypothesis import Phase
from hypothesis import settings as hypothesis_settings

from tests.mutation.mutants import Mutant
from tests.mutation.objects import CompileError, Library, Objects, WarningError
from tests.mutation.order import Order

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
COUNT = 20_000
"""Samples for each law, where the tests in earnest take 200 000, and a million at night."""
TESTS = {
    "core": [
        *(
            f"tests/parity/test_c_{what}.py"
            for what in ("laws", "geometry", "mixer", "mixer_numbers", "mission")
        ),
        *(f"tests/firmware/test_core_{what}.py" for what in ("loops", "math", "builds")),
    ],
    "mavlink": [f"tests/firmware/test_codec_{what}.py" for what in ("messages", "parser")],
    "app": [
        f"tests/firmware/test_app_{what}.py"
        for what in ("pil", "params", "windows", "baud", "free", "services", "safe_state", "damage", "sense")
    ],
}
BESIDE = ("laws", "sensing", "ports/host")
"""What the application's tests compile beside the mutated parts."""
SLOW = "not clang and not compiler and not compiles and not sanitizers and not fresh and not own_no_memory"
"""Without these, of which each compiles everything again."""
KEPT = re.compile(r"flight|flown|filled_stack|stream|\w+_in_python")
"""Caches that hold nothing that the sources made: what Python makes of the same inputs."""
LEAST_LIMIT_S, TIMES = 1.0, 10.0
"""CPU time after which a test is taken for an endless loop: so many times what it takes without a mutant."""
MOST_MEMORY = 8 << 30

KILLED, WARNED, LOOPED, SURVIVED = "killed", "warned of", "without end", "survived"
EQUAL, INVALID, UNTRIED = "same code", "no C", "not tried, by a fault of this program"
_CODES = [SURVIVED, KILLED, UNTRIED]
NO_MUTANT = Mutant("", 0, 0, "", "", "", "", "")


class Verdict(NamedTuple):
    """What became of a mutant, by which test, and in how much CPU time."""

    mutant: Mutant
    fate: str
    test: str
    cpu_s: float


class Session:
    """A plug-in of pytest that calls ``work`` with trials of the collected tests instead of running the tests."""

    def __init__(self, folder: Path, work: Callable[[Trials], None]) -> None:
        self.folder, self.work = folder, work
        self.has_run = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        """Let hypothesis try what it tries every day (the profile of tests/conftest.py), and shrink nothing."""
        hypothesis_settings.register_profile(
            "mutation", hypothesis_settings.get_profile("repeatable"), phases=[Phase.explicit, Phase.generate]
        )
        hypothesis_settings.load_profile("mutation")

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Prepare the tests and work with them."""
        if session.testsfailed:
            return True
        self.work(Trials(session.items, self.folder))
        self.has_run = True
        return True


def with_tests(part: str, work: Callable[[Trials], None]) -> None:
    """Call ``work`` inside a pytest session of the tests of a part; SystemExit if they cannot be run."""
    options = ["-q", "-s", "--no-header", "--no-summary", "--assert=plain", "--tb=native"]
    # the two last would blame a test for what the session before it has left to the garbage collector
    plugins = ("cacheprovider", "faulthandler", "unraisableexception", "threadexception")
    without = [*(word for name in plugins for word in ("-p", f"no:{name}")), "-k", SLOW]
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        session = Session(Path(folder), work)
        files = [str(ROOT / name) for name in TESTS[part]]
        pytest.main([*options, *without, f"--basetemp={folder}/work/pytest", *files], plugins=[session])
        tempfile.tempdir = None
    if not session.has_run:
        sys.exit(f"cannot run pytest {' '.join(TESTS[part])}")


class Trials:
    """Tries mutants in a copy of the firmware's sources with the tests of one part."""

    def __init__(self, items: list[pytest.Item], folder: Path) -> None:
        self.items = items
        self.sources, self._work = folder / "firmware", folder / "work"
        self.objects = Objects(folder / "objects")
        self.objects.folder.mkdir()
        tempfile.tempdir = str(self._work / "made")
        for made in ("made", "pytest"):
            (self._work / made).mkdir(parents=True)
        for name in (*TESTS, *BESIDE):
            shutil.copytree(FIRMWARE / name, self.sources / name)
        self._let_tests_use()
        costs = self._warm_up()
        self._empty()
        self.libraries = _in_double_first(self.objects.libraries)
        self.order = Order(costs)
        self._costs = costs
        self._spent = np.frombuffer(mmap.mmap(-1, 8 * (len(items) + 1)), np.float64)
        """Of the child: the test that runs, and CPU time of each [s], NaN if it has not run."""
        fate, test = self._tested(NO_MUTANT)
        if fate != SURVIVED:
            pytest.exit(f"{test} fails in a fork without any mutant")

    def _let_tests_use(self) -> None:
        core_support, codec_support, app_support = helpers = _helpers()
        app_support.FIRMWARE = self.sources
        core_support.CORE = self.sources / "core"
        codec_support.CODEC = self.sources / "mavlink"
        codec_support.SOURCES = sorted(codec_support.CODEC.glob("*.c"))
        for module in helpers:
            module.subprocess = self.objects  # type: ignore[attr-defined]
        _shrink_samples()

    def _empty(self) -> None:
        """Remove what tests have made: libraries, and files of pytest."""
        for made in self._work.iterdir():
            shutil.rmtree(made)
            made.mkdir()

    def _warm_up(self) -> list[float]:
        """Run each test twice without a mutant; return the CPU time of the second run [s]."""
        costs = []
        for item in self.items:
            failure = _failure(item)
            start_s = _cpu_s()
            if failure := failure or _failure(item):
                pytest.exit(f"{item.nodeid} fails without any mutant: {failure}")
            costs.append(_cpu_s() - start_s)
        _forget()
        return costs

    def remember(self, mutant: Mutant, test: str) -> None:
        """Learn from an earlier run that ``test`` found a mutant, empty: that none did."""
        found_by = next((index for index, item in enumerate(self.items) if item.nodeid == test), -1)
        if found_by >= 0 or not test:
            all_ran = np.array(self._costs)
            self.order.learn(mutant, all_ran if found_by < 0 else np.full_like(all_ran, np.nan), found_by)

    def verdict_of(self, mutant: Mutant) -> Verdict:
        """Return what becomes of a mutant; the sources are as before afterwards."""
        start_s = _cpu_s()
        path = self.sources / mutant.file
        original = path.read_text()
        path.write_text(mutant.applied(original))
        self.objects.mutate(path)
        test = ""
        try:
            if self.objects.is_same_code(self.libraries):
                fate = EQUAL
            else:
                fate, test = self._tested(mutant)
                if fate == SURVIVED and self.objects.is_same_optimised(self.libraries, original):
                    fate = EQUAL
        except CompileError:
            fate = INVALID
        except WarningError:
            fate = WARNED
        path.write_text(original)
        self.objects.mutate(None)
        return Verdict(mutant, fate, test, _cpu_s() - start_s)

    def _tested(self, mutant: Mutant) -> tuple[str, str]:
        """Run tests in a fork until one fails; return the mutant's fate and that test."""
        ranked = self.order.ranked(mutant)
        self._spent[:] = np.nan
        gc.freeze()
        child = os.fork()
        if not child:
            self._run(ranked)
        status = os.waitpid(child, 0)[1]
        self._empty()
        fate = _fate_of(status)
        killer = int(self._spent[-1]) if fate in {KILLED, LOOPED} else -1
        self.order.learn(mutant, self._spent[:-1], killer)
        return fate, self.items[killer].nodeid if killer >= 0 else ""

    def _run(self, ranked: list[int]) -> None:
        """In the child: run tests until one fails, and exit with an index of _CODES."""
        code = _CODES.index(UNTRIED)
        gc.disable()
        try:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
            nothing = os.open(os.devnull, os.O_RDWR)
            os.dup2(nothing, 1)
            os.dup2(nothing, 2)
            code = _CODES.index(self._until_one_fails(ranked))
        finally:
            os._exit(code)

    def _until_one_fails(self, ranked: list[int]) -> str:
        for index in ranked:
            self._spent[-1] = index
            signal.setitimer(signal.ITIMER_PROF, LEAST_LIMIT_S + TIMES * self._costs[index])
            start_s = _cpu_s()
            failure = _failure(self.items[index])
            self._spent[index] = _cpu_s() - start_s
            if failure:
                return KILLED
        return SURVIVED


def _failure(item: pytest.Item) -> str:
    """Run a test with the fixtures it needs and none kept; return why it fails, empty if it does not."""
    reports = runtestprotocol(item, log=False, nextitem=None)
    return next((f"{report.when}: {report.longreprtext}" for report in reports if report.failed), "")


def _cpu_s() -> float:
    """Return the CPU time of this process and of the children that have ended."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _in_double_first(libraries: list[Library]) -> list[Library]:
    """Order libraries so that the one that most tests use comes first."""
    return sorted(libraries, key=lambda library: "-DFS_DOUBLE" not in library.units[0].flags)


def _helpers() -> tuple[ModuleType, ModuleType, ModuleType]:
    """Return the helpers of the tests, which may be imported once pytest has loaded ``tests/conftest.py``."""
    core_support, codec_support, app_support = (
        import_module(f"tests.firmware.{name}") for name in ("core_support", "codec_support", "app_support")
    )
    return core_support, codec_support, app_support


def _shrink_samples() -> None:
    core_math, laws, mixer = (
        import_module(f"tests.{name}")
        for name in ("firmware.test_core_math", "parity.test_c_laws", "parity.test_c_mixer")
    )
    laws.COUNT = mixer.COUNT = core_math.COUNT = COUNT  # type: ignore[attr-defined]
    mixer.mixed.__defaults__ = (COUNT // 5,)


def _forget() -> None:
    """Empty the caches of the tests that hold what the true sources made."""
    for name, module in list(sys.modules.items()):
        if name.startswith(("tests.firmware", "tests.parity")):
            for word, thing in list(vars(module).items()):
                if isinstance(thing, functools._lru_cache_wrapper) and not KEPT.fullmatch(word):
                    thing.cache_clear()


def _fate_of(status: int) -> str:
    """Return what a child's wait status says; SIGKILL is the system's, which is short of memory."""
    if os.WIFSIGNALED(status):
        by = os.WTERMSIG(status)
        return LOOPED if by == signal.SIGPROF else UNTRIED if by == signal.SIGKILL else KILLED
    code = os.waitstatus_to_exitcode(status)
    return _CODES[code] if code < len(_CODES) else KILLED
