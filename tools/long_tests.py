"""List the tests that ``make test`` leaves out: ``python -m tools.long_tests`` measures each one's processor time.

It runs the tiers of ``make test``, one test after another, for about twenty minutes, and writes ``tests/long.txt``. The
time of a test is that of its process and of the processes that it started and waited for.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "long.txt"
LIMIT_S = 0.5
"""Tests that take longer are left out: one in twelve, which take two thirds of the time."""
KEPT = "tests/scenarios/test_failsafe"
"""Files that start so are never left out: a change of a failsafe shows at once."""
FOLDERS = ("tests/parity", "tests/protocol", "tests/scenarios", "tests/unit")
_times_s: dict[str, float] = {}


def _processor_s() -> float:
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Measure a test with its fixtures."""
    began_s = _processor_s()
    try:
        return (yield)
    finally:
        _times_s[item.nodeid] = _processor_s() - began_s


def pytest_sessionfinish() -> None:
    """Write the list."""
    found = sorted(
        name
        for name, time_s in _times_s.items()
        if time_s > LIMIT_S and "\n" not in name and not name.startswith(KEPT)
    )
    LIST.write_text("".join(f"{name}\n" for name in found), encoding="utf-8")
    print(f"\n{len(found)} of {len(_times_s)} tests take more than {LIMIT_S} s")


if __name__ == "__main__":
    command = [sys.executable, "-m", "pytest", "-p", "tools.long_tests", "-n", "0", *FOLDERS]
    sys.exit(subprocess.run(command, cwd=ROOT, check=False).returncode)
