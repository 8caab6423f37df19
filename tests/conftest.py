"""What must be so before any test module is imported."""

from __future__ import annotations

import faulthandler
import gc
import itertools
import os
import signal
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.support.tools import NIGHTLY

# pymavlink's mavutil reads it once, at its first import, whichever module that is: without it mavutil.mavlink is
# the dialect of version 1, whose messages cannot be signed
os.environ.setdefault("MAVLINK20", "1")

# the matrices of the tests are small: a second thread of BLAS waits actively, which costs four times the CPU time
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# a shell that runs the tests in its background lets them, and all that they start, ignore Ctrl-C: no test of
# Ctrl-C could pass
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# every run tries the same examples: one that fails does so on every machine, and again; nights try others, and more
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None, max_examples=40)
settings.register_profile("explore", deadline=None, database=None, print_blob=True)
settings.load_profile("explore" if NIGHTLY else "repeatable")

# a test of all samples takes minutes, and longer on a busy machine
HANGS_AFTER_S = 3600.0 if NIGHTLY else 600.0

# half a minute of CPU time
collect_ignore = [] if NIGHTLY else ["scenarios/files/long/loop_30_min.toml"]

TIERS = {
    "unit": "unit",
    "protocol": "protocol",
    "screens": "screen",
    "scenarios": "flight",
    "parity": "parity",
    "processes": "process",
    "interop": "interop",
    "firmware": "firmware",
    "mutation": "firmware",
    "fuzz": "fuzz",
}
"""Marker of the tests in each folder; ``make test`` runs some of them, ``make test-all`` all."""

SHORT = ("protocol", "unit")
"""Folders whose files come last: most are short, so that no worker waits long for another at the end."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without garbage collection, which takes a fifth of the time, and exempt the tests from later ones.

    Later ones of new objects are rarer than Python's: flights make many objects and few cycles.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 10)
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark each test with its tier, those of ``long.txt`` and below a folder ``long`` as long; mix the folders."""
    long = frozenset(Path(__file__).with_name("long.txt").read_text(encoding="utf-8").splitlines())
    files: dict[str, list[list[pytest.Item]]] = {}
    for path, found in itertools.groupby(items, lambda item: item.path):
        folder, *below = path.relative_to(Path(__file__).parent).parts
        tier = "paper" if path.name.startswith("test_paper") else TIERS[folder]
        in_file = list(found)
        for item in in_file:
            if "long" in below or item.nodeid in long:
                item.add_marker(pytest.mark.long)
            item.add_marker(getattr(pytest.mark, tier))
        files.setdefault(folder, []).append(in_file)
    items[:] = mixed(files)


def mixed(files: dict[str, list[list[pytest.Item]]]) -> list[pytest.Item]:
    """Return the tests of all folders, each spread over the whole run.

    Clients of others wait in real time: if all workers run those, the processors are idle.
    """
    placed = [
        (folder in SHORT, (number + 0.5) / len(all_of_it), folder, in_file)
        for folder, all_of_it in files.items()
        for number, in_file in enumerate(all_of_it)
    ]
    return [item for *_, in_file in sorted(placed, key=lambda each: each[:3]) for item in in_file]


@pytest.fixture(autouse=True)
def _never_hangs() -> Iterator[None]:
    """End the process with a trace of what it waited for: a run that hangs tells nobody anything."""
    faulthandler.dump_traceback_later(HANGS_AFTER_S, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture(autouse=True)
def _keeps_the_signals() -> Iterator[None]:
    """Restore what a program that ran in the test process does on a signal."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    handlers, hook = [signal.getsignal(number) for number in numbers], sys.unraisablehook
    yield
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)
    signal.set_wakeup_fd(-1)  # that of a simulator in this process, whose socket is closed
    sys.unraisablehook = hook
