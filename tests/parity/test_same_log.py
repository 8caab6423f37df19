"""The same log on every processor: flights under settings that make libraries choose the code of an older one.

Each setting is first shown to act, on what its library computes in the same process. Where it does not, the machine has
one variant only, and the test is skipped. Settings of libraries act in one process; with NIGHTLY=1 each has its own,
which shows which of them a difference comes from, and Numba compiles for another processor, which takes a minute. Other
architectures: tests/firmware/test_aarch64.py.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.parity import flown_log
from tests.parity.flown_log import FLIGHTS
from tests.support.tools import NIGHTLY

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]


def newer_features() -> str:
    """Names of the features of this processor that NumPy chooses its loops by."""
    return ",".join(np.show_config(mode="dicts")["SIMD Extensions"].get("found", []))  # type: ignore[index]


SETTINGS = {
    "lapack": {"OPENBLAS_CORETYPE": "Nehalem"},
    "libm": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2"},
    "numpy": {"NPY_DISABLE_CPU_FEATURES": newer_features()},
    "numba": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
}


PLAN = "square.plan"


@functools.cache
def digests(*libraries: str) -> dict[str, str]:
    """Digests of libraries and logs in a process with the settings of these libraries; without any, in this one."""
    if not libraries:
        return flown_log.digests(PLAN)
    command = [sys.executable, "-m", "tests.parity.flown_log", PLAN]
    environment = {
        **os.environ,
        **{name: value for one in libraries for name, value in SETTINGS[one].items()},
    }
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return dict(line.split() for line in done.stdout.splitlines())


def logs(digests_of_process: dict[str, str]) -> list[str]:
    return [digests_of_process["-".join(flight)] for flight in FLIGHTS]


LIBRARIES = ("lapack", "libm", "numpy")


def elsewhere(library: str) -> dict[str, str]:
    return digests(*([library] if NIGHTLY else LIBRARIES))


@pytest.mark.parametrize("library", LIBRARIES)
def test_log_does_not_depend_on_the_variant_of(library: str) -> None:
    here, there = digests(), elsewhere(library)
    if here[library] == there[library]:
        pytest.skip(f"{library} has one variant on this machine")
    assert logs(here) == logs(there)


@pytest.mark.skipif(not NIGHTLY, reason="compiles all kernels anew: set NIGHTLY=1")
def test_log_does_not_depend_on_the_processor_that_numba_compiles_for() -> None:
    """LLVM chooses instructions for the processor; it must neither contract nor reorder."""
    here, there = digests(), elsewhere("numba")
    assert logs(here) == logs(there)
