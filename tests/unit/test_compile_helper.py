"""The compile helper: shares the compilation of a cold cache, ends with its parent, and may fail."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from flightstack.process import compile_helper
from flightstack.process.compile_notice import base_name
from tests.support.tools import NIGHTLY
from tests.support.truth import World

pytestmark = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
ROOT = Path(__file__).resolve().parents[2]
CPUS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
FLIGHT: dict[str, Any] = {"vehicle": "x_quad", "wind": (4.0, -2.0), "gust": 1.0}
COLD_FLIGHT = """
import hashlib, json, sys
from numba.core import event
from flightstack.process.compile_notice import base_name
from tests.support.truth import World

class Listener(event.Listener):
    compiled = []
    def on_start(self, event):
        kernel = event.data["dispatcher"].py_func
        self.compiled.append(f"{kernel.__module__.rpartition('.')[2]}.{base_name(kernel.__name__)}")
    def on_end(self, event):
        pass

event.register("numba:compile", Listener())
world = World(**json.loads(sys.argv[1]))
world.fly("square.plan")
print(json.dumps([Listener.compiled, hashlib.sha256(world.engine.newest_log()).hexdigest()]))
"""
ORPHAN = """
import os
from flightstack.process import compile_helper
compile_helper.start(["goal_kernel"])
os.write(1, str(compile_helper.helper.pid).encode())
os._exit(0)
"""

LAST_KERNEL = "row_kernel.put_rows"
"""The last one of the task COMMANDER."""


def cached(folder: Path) -> set[str]:
    """Return the kernels whose cache is in a folder, each as MODULE.NAME."""
    return {base_name(path.name.partition("-")[0]) for path in folder.rglob("*.nbi")}


def digest_of_flight() -> str:
    world = World(**FLIGHT)
    world.fly("square.plan")
    return hashlib.sha256(world.engine.newest_log()).hexdigest()


def run(code: str, *arguments: str, cache: Path) -> subprocess.CompletedProcess[str]:
    environment = {key: text for key, text in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=ROOT,
        env={**environment, "XDG_CACHE_HOME": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture
def not_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_helper, "helper", None)


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch, not_started: None) -> None:
    monkeypatch.setattr(compile_helper, "is_cached", lambda kernel: False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1}, raising=False)


@pytest.mark.skipif(
    not NIGHTLY, reason="half a minute of CPU time; the example of mission tests starts cold too"
)
@pytest.mark.skipif(CPUS < 2, reason="the helper needs a second CPU")
def test_cold_cache_is_compiled_once_and_gives_the_same_log(tmp_path: Path) -> None:
    """The helper compiles guidance and plant, this process the rest; no kernel of streams is needed."""
    compiled, digest = json.loads(run(COLD_FLIGHT, json.dumps(FLIGHT), cache=tmp_path).stdout)
    here, there = set(compiled), cached(tmp_path) - set(compiled)
    assert {"loop_kernels.inner_kernel", "fault_detector.detect", "fence.fence_step", LAST_KERNEL} <= here
    assert {"kernels.goal_kernel", "kernels.rest_kernel", "integrator._advance"} <= there
    assert "kernels.stream_kernel" not in here
    assert digest == digest_of_flight()


MEASUREMENTS = """
from numba.core import event
import numpy as np
from flightstack.estimation.agenda import fuse_next
from flightstack.estimation.delayed_filter import imu_kernel
from flightstack.estimation.imu_track import ImuTrack
from flightstack.estimation.memory import MEMORY
from flightstack.process.compile_helper import compile_measurements

class Listener(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event):
        pass

if __import__("sys").argv[1] == "helper":
    compile_measurements()
else:
    event.register("numba:compile", Listener())
    imu_kernel.dispatcher.result_for(np.zeros(1, MEMORY), ImuTrack().ring[0])
"""


@pytest.mark.skipif(not NIGHTLY, reason="a quarter of a minute of CPU time")
def test_helper_and_parent_each_compile_a_part_of_the_filter(tmp_path: Path) -> None:
    """The type of each argument of ``fuse_next`` is the one that the filter's kernel passes."""
    run(MEASUREMENTS, "helper", cache=tmp_path)
    compiled = run(MEASUREMENTS, "parent", cache=tmp_path).stdout.split()
    assert "imu_kernel" in compiled
    assert "_begin__part" in compiled
    assert not {"fuse_next__part", "take_gnss__part", "fuse__part"} & set(compiled)


@pytest.mark.skipif(CPUS < 2, reason="the helper needs a second CPU")
def test_compile_helper_ends_with_its_parent(tmp_path: Path) -> None:
    """The pipe of stderr closes when the helper has ended."""
    parent = run(ORPHAN, cache=tmp_path)
    assert int(parent.stdout) > 0
    assert LAST_KERNEL not in cached(tmp_path)


def test_compile_helper_ends_in_order() -> None:
    """Its parent holds its standard input open."""
    tasks = f"{compile_helper.GUIDANCE},{compile_helper.COMMANDER}"
    command = [sys.executable, "-P", "-m", "flightstack.process.compile_helper", tasks]
    path = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    environment = {**os.environ, "PYTHONPATH": path}
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
    ) as helper:
        assert helper.stdout is not None
        assert helper.stderr is not None
        assert helper.stdout.read() == b"\n"  # after the tasks
        assert helper.stderr.read() == b""
        assert helper.wait() == 0


def test_a_failing_compile_helper_changes_nothing(cold: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_helper, "__name__", "flightstack.process.no_such_module")
    expected = digest_of_flight()
    assert compile_helper.helper is not None
    assert compile_helper.helper.wait() != 0
    monkeypatch.setattr(compile_helper, "helper", None)
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    assert digest_of_flight() == expected
    assert compile_helper.helper is None


def test_compile_helper_starts_for_a_cold_cache_only(not_started: None) -> None:
    World(**FLIGHT)  # compiles, or loads from the cache
    assert not compile_helper.is_useful()


def test_compile_helper_needs_a_second_cpu(cold: None, monkeypatch: pytest.MonkeyPatch) -> None:
    assert compile_helper.is_useful()
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert not compile_helper.is_useful()
