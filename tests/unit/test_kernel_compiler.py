"""Functions that kernels call: compiled as parts of the kernel, and Numba's compiler in other uses."""

from __future__ import annotations

import gc
import importlib
import math
import os
import subprocess
import sys
from enum import Enum, EnumMeta
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import event

from flightstack.core import compiled as module
from flightstack.core import geometry
from flightstack.core.compiled import Kernel, compiled
from flightstack.core.contract import Quaternion
from flightstack.core.geometry import quaternion_product
from flightstack.core.kernels import compiler as kernel_compiler
from flightstack.core.kernels.cache import is_own
from flightstack.core.portable_math import euler_angles, tan

JIT = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")


@JIT
def test_kernels_call_parts_without_a_wrapper_for_python() -> None:
    @compiled
    def used(x: float) -> float:
        return x + 1.0

    @compiled
    def using(x: float) -> float:
        return used(x)

    assert using(1.0) == 2.0
    assert used.overloads == {}
    (part,) = used.part.overloads.values()
    assert part.library.get_pointer_to_function(part.fndesc.llvm_func_name) == 0
    assert used(2.0) == 3.0
    assert gc.isenabled()


@JIT
def test_cached_part_is_included_in_another_kernel() -> None:
    loaded = module.Kernel(quaternion_product.py_func, frozenset({geometry.__name__}))

    @compiled
    def square(a: Quaternion) -> Quaternion:
        return loaded(a, a)

    turn = Quaternion(0.0, 1.0, 0.0, 0.0)
    quaternion_product.part.compile((numba.typeof(turn), numba.typeof(turn)))  # writes the cache
    assert square(turn) == (-1.0, 0.0, 0.0, 0.0)
    assert sum(loaded.part.stats.cache_hits.values()) == 1


@JIT
def test_kernel_and_part_share_the_functions_that_they_call() -> None:
    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: event.Event) -> None:
            compilations.append(event.data["dispatcher"].py_func.__name__)

        def on_end(self, event: event.Event) -> None: ...

    @compiled
    def used(x: np.float32) -> float:
        return tan(x)

    @compiled
    def using(x: np.float32) -> float:
        return tan(x) - used(x)

    compilations: list[str] = []
    with event.install_listener("numba:compile", Listener()):
        assert using(np.float32(0.5)) == 0.0
    assert compilations.count("used__part") == compilations.count("tan") == compilations.count("sin_cos") == 1


@JIT
def test_operators_of_floats_and_integers_have_numbas_types() -> None:
    @compiled
    def results(x: float, n: int) -> tuple[float, float, int, bool]:
        return x * x, x / n, n * n, x < n

    assert results(3.0, 2) == (9.0, 1.5, 4, False)
    (signature,) = results.nopython_signatures
    kinds = (numba.float64, numba.float64, numba.int64, numba.boolean)
    assert signature.return_type == numba.types.Tuple(kinds)


@compiled
def printed(x: float) -> float:
    print("value", x)
    return x


@compiled
def checked(x: float) -> float:
    if x < 0.0:
        raise ValueError("negative value", x)
    return x


@compiled
def reported(x: float) -> float:
    return checked(printed(x))


def test_compiled_function_called_by_a_kernel_prints(capsys: pytest.CaptureFixture[str]) -> None:
    assert reported(2.5) == 2.5
    assert capsys.readouterr().out == "value 2.5\n"


def test_compiled_function_called_by_a_kernel_raises_with_values() -> None:
    with pytest.raises(ValueError, match="negative value") as raised:
        reported(-1.0)
    assert raised.value.args == ("negative value", -1.0)


@JIT
def test_operators_of_other_numba_users_are_typed_by_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_compiler.FloatOperator, "result", numba.boolean)
    twice = numba.njit(lambda x: x + x)
    assert twice(1.5) == 3.0


UNTESTED_NUMBA = """
import sys
import numba
numba.version_info = numba.version_info._replace(short=(9, 0))
from flightstack.core.array_items import store
from flightstack.core.compiled import compiled
@compiled
def half(x):
    print("value", x)
    return 0.5 * x
@compiled
def quarter(x):
    return half(half(x))
print(quarter(6.0), "flightstack.core.kernels.compiler" in sys.modules)
"""


@JIT
def test_an_untested_numba_compiles_with_its_own_compiler() -> None:
    done = subprocess.run([sys.executable, "-c", UNTESTED_NUMBA], capture_output=True, text=True, check=True)
    assert done.stdout == "value 6.0\nvalue 3.0\n1.5 False\n"


LOADED_KERNEL = """
import sys
from flightstack.control.mixer import mix
from flightstack.core.contract import Quaternion
from flightstack.core.geometry import quaternion_product
turn = Quaternion(0.0, 1.0, 0.0, 0.0)
print("numba" in sys.modules, quaternion_product(turn, turn).w, "numba.np.arraymath" in sys.modules)
"""


@JIT
def test_a_kernel_of_the_cache_is_read_without_the_compiler(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def printed() -> str:
        command = [sys.executable, "-c", LOADED_KERNEL]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    assert printed() == "False -1.0 True\n"  # compiled
    assert printed() == "False -1.0 False\n"


@compiled
def _taken_apart(number: float) -> tuple[float, int]:
    return math.frexp(number)


def test_frexp_in_a_kernel_has_the_bits_of_python() -> None:
    bits = np.random.default_rng(5).integers(0, 2**64, 2000, np.uint64)
    subnormal = bits >> np.uint64(12)
    ends = [0.0, 0.5, 1.0, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, math.inf, math.nan]
    numbers = [*bits.view(float).tolist(), *subnormal.view(float).tolist(), *ends]
    for number in (*numbers, *(-each for each in numbers)):
        mantissa, power = _taken_apart(number)
        expected, expected_power = math.frexp(number)
        assert (np.float64(mantissa).tobytes(), power) == (np.float64(expected).tobytes(), expected_power)


@JIT
def test_parts_of_a_kernel_are_internal_to_it() -> None:
    @compiled
    def turns(w: float, x: float) -> float:
        return euler_angles(w, x, 0.0, 0.0)[0] + euler_angles(x, w, 0.0, 0.0)[0]

    assert turns(1.0, 0.0) == pytest.approx(math.pi)
    (kernel,) = turns.dispatcher.overloads.values()
    functions = [line for line in kernel.library.get_llvm_str().splitlines() if line.startswith("define")]
    assert any(line.startswith("define internal") for line in functions)
    assert not any(line.startswith("define linkonce_odr") for line in functions)


def test_kernels_use_no_enumerations() -> None:
    """Numba before 0.62 cannot pass their members to a function, and takes microseconds for each from Python."""
    for name in (
        "flightstack.testing.engine",
        "flightstack.process.quiet_exchange",
        "sim_bridge.server.server",
    ):
        importlib.import_module(name)
    modules = [module for name, module in list(sys.modules.items()) if is_own(name)]
    kernels = {each for module in modules for each in vars(module).values() if isinstance(each, Kernel)}
    assert len(kernels) > 100
    for kernel in kernels:
        function = kernel.py_func
        used = [function.__globals__.get(name) for name in function.__code__.co_names]
        found = [each for each in used if isinstance(each, (Enum, EnumMeta))]
        assert not found, f"{function.__module__}.{function.__qualname__}"
