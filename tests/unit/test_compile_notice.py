"""Compilation is announced kernel by kernel, with how many there are; kernels in the cache are not."""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from flightstack.core.compiled import compiled
from flightstack.params.config import StackConfig
from flightstack.process import assembly
from flightstack.process.compile_notice import CompileNotice
from sim_bridge import plants

JIT = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
ROOT = Path(__file__).resolve().parents[2]
LOADED = """
import json
import os
import sys
from flightstack.core.compiled import Kernel
import flightstack.process.assembly
import sim_bridge.simulator

def report(name):
    found = {id(value): value for module_name, module in list(sys.modules.items())
             if module_name.partition(".")[0] in ("flightstack", "sim_bridge")
             for value in [*vars(module).values(), *getattr(module, "specialised", {}).values()]
             if isinstance(value, Kernel)}
    used = [kernel for kernel in found.values() if kernel.overloads]
    compiled = any(sum(kernel.stats.cache_misses.values()) for kernel in used)
    print(json.dumps([name, compiled, sorted(k.py_func.__name__.partition("__")[0] for k in used)]), flush=True)

for name, setup in json.loads(sys.argv[1]).items():
    child = os.fork()
    if not child:
        try:
            exec(setup, {})
            report(name)
            os._exit(0)
        except BaseException as error:
            print(name, repr(error), file=sys.stderr, flush=True)
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0, name
"""
STACK = """
from flightstack.process.assembly import build
from flightstack.params.config import StackConfig
build(StackConfig(loops="{loops}", lockstep={lockstep}), lambda: None)
"""
PLANT = """
from flightstack.params.vehicle import load_vehicle
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator
from flightstack.core.contract import Vector3
from sim_bridge.plant.battery import BatteryOptions
still = Vector3(0.0, 0.0, 0.0)
options = PlantOptions(Disturbance(still, 0.0, still, still, 0.0), 1, battery=BatteryOptions())
Simulator(load_vehicle("paper_quad"), "{plant}", options)
"""


@compiled
def part(x: float) -> float:
    return x + 1.0


@compiled
def whole(x: float) -> float:
    return 2.0 * part(x)


SETUPS = {
    **{loops: STACK.format(loops=loops, lockstep=True) for loops in ("python", "c")},
    "real time": STACK.format(loops="python", lockstep=False),
    **{plant: PLANT.format(plant=plant) for plant in ("rigid", "paper")},
    **({"multibody": PLANT.format(plant="multibody")} if find_spec("mujoco") else {}),
}


@cache
def loaded_kernels() -> dict[str, list[str]]:
    """Names of the kernels that each setup reads from warm caches: those that it calls, not what these call."""
    command = [sys.executable, "-c", LOADED, json.dumps(SETUPS)]
    for _ in range(2):  # the first one may have to compile them
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        reports = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("[")]
        if not any(compiled for _, compiled, _ in reports):
            break
    return {name: ["compiled"] if compiled else kernels for name, compiled, kernels in reports}


@contextlib.contextmanager
def reporting(said: list[str], *kernels: str) -> Iterator[None]:
    notice = CompileNotice(said.append, kernels)
    notice.start()
    yield
    notice.stop()


@JIT
def test_compile_notice_counts_kernels_not_their_parts() -> None:
    said: list[str] = []
    with reporting(said, "other", "whole"):
        assert whole(1.5) == 5.0
        assert whole(2.5) == 7.0
    assert said == [
        "compiling kernels, once; this takes about 7 s on two idle cores",
        "compiling kernel 2 of 2: whole",
    ]


@JIT
def test_compile_notice_names_a_kernel_that_is_not_listed() -> None:
    said: list[str] = []

    @compiled
    def surplus(x: float) -> float:
        return math.sqrt(x)

    with reporting(said):
        surplus(4.0)
    assert said[-1] == "compiling kernel: surplus"


@JIT
@pytest.mark.parametrize(
    ("setup", "config"), [("python", {}), ("c", {"loops": "c"}), ("real time", {"lockstep": False})]
)
def test_kernels_of_the_stack_are_those_it_loads(setup: str, config: dict[str, Any]) -> None:
    assert loaded_kernels()[setup] == sorted(assembly.kernels_of(StackConfig(**config)))


@JIT
@pytest.mark.parametrize("plant", ["rigid", "paper", "multibody"])
def test_kernels_of_a_plant_are_those_it_loads(plant: str) -> None:
    if plant == "multibody":
        pytest.importorskip("mujoco")
    assert loaded_kernels()[plant] == sorted(plants.kernels_of(plant))


@JIT
def test_nothing_is_compiled_after_the_vehicle_is_built_but_for_streams() -> None:
    """In lockstep, time stands still meanwhile; in real time that kernel is compiled too."""
    run = subprocess.run(
        [sys.executable, "-m", "tests.support.kernels_of_flights"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split() == ["flightstack.guidance.kernels.stream_kernel"]
