"""Compilation: where kernels are cached, what makes a cache stale, and how a template is specialised."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flightstack import compiled as module
from flightstack.compiled import as_tuple, compiled, direct, is_own, specialise, store
from flightstack.control.mixer import mix

inner = None  # bound by ``specialise``
FACTOR = 0.0


@compiled
def double(x: float) -> float:
    return 2.0 * x


@compiled
def negative(x: float) -> float:
    return -x


def template(x: float) -> float:
    return FACTOR * inner(x)


def test_a_template_is_bound_to_what_it_is_given() -> None:
    one = specialise(template, "one", inner=double, FACTOR=10.0)
    two = specialise(template, "two", inner=negative, FACTOR=0.5)
    assert (one(3.0), two(3.0)) == (60.0, -1.5)
    assert one.__name__ == "template__one"
    assert inner is None


@compiled
def first(numbers: np.ndarray, scale: float) -> float:  # type: ignore[type-arg]
    return numbers[0] * scale


def test_a_kernel_called_directly_does_the_same_and_refuses_numbers_of_another_size() -> None:
    numbers = np.array([3.0, 4.0])
    kernel = direct(first, np.zeros(1), 1.0)
    assert kernel(numbers, 2.0) == first(numbers, 2.0) == 6.0
    assert kernel(numbers, 2) == 6.0
    if "NUMBA_DISABLE_JIT" not in os.environ:
        with pytest.raises(TypeError):
            kernel(numbers.astype(np.float32), 2.0)


def test_without_compilation_a_direct_kernel_is_the_function() -> None:
    def plain(x: float) -> float:
        return x

    assert direct(plain, 1.0) is plain


def test_division_by_zero_is_ieee() -> None:
    @compiled
    def quotient(a: float, b: float) -> float:
        return a / b

    assert quotient(1.0, 0.0) == math.inf
    assert math.isnan(quotient(0.0, 0.0))


def test_arrays_become_tuples_and_tuples_arrays() -> None:
    @compiled
    def swapped(x: np.ndarray, out: np.ndarray) -> None:
        a, b, c = as_tuple(x, 3)
        store(out, (c, b, a))

    out = np.zeros(4)
    swapped(np.array([1.0, 2.0, 3.0, 4.0]), out)
    assert out.tolist() == [3.0, 2.0, 1.0, 0.0]
    assert as_tuple(np.array([1.0, 2.0, 3.0]), 2) == (1.0, 2.0)


def test_only_our_own_functions_are_cached_by_themselves() -> None:
    assert is_own("flightstack.control.mixer")
    assert is_own("sim_bridge.rigid")
    assert not is_own("lqr_controller")
    assert not is_own("flightstack_extras.law")
    assert Path(mix._cache.cache_path).is_dir()
    assert double._cache.cache_path is None


def test_the_cache_is_one_for_each_state_of_the_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (
        "flightstack/compiled.py",
        "flightstack/control/law.py",
        "flightstack/logging/m.py",
        "sim_bridge/p.py",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n")
    monkeypatch.setattr(module, "__file__", str(tmp_path / "flightstack/compiled.py"))
    digests = [module._sources_digest()]
    for name in ("flightstack/control/law.py", "sim_bridge/p.py"):
        (tmp_path / name).write_text("x = 2\n")
        digests.append(module._sources_digest())
    assert len(set(digests)) == 3
    (tmp_path / "flightstack/logging/m.py").write_text("x = 2\n")  # nothing compiled there
    assert module._sources_digest() == digests[-1]


def cache_directory(**variables: str) -> Path:
    """Where a process with these environment variables keeps its kernels."""
    environment = {
        key: text for key, text in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }
    code = "import flightstack.compiled, numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**environment, **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(done.stdout.strip())


def test_kernels_lie_in_the_users_cache_and_old_ones_are_removed(tmp_path: Path) -> None:
    kernels = tmp_path / "flightstack" / "kernels"
    for age in range(6):
        (kernels / f"old{age}").mkdir(parents=True)
        os.utime(kernels / f"old{age}", (1000.0 - age, 1000.0 - age))
    used = cache_directory(XDG_CACHE_HOME=str(tmp_path))
    assert used.parent == kernels
    assert sorted(path.name for path in kernels.iterdir()) == sorted([used.name, "old0", "old1", "old2"])


def test_a_home_that_cannot_be_written_does_not_stop_it(tmp_path: Path) -> None:
    used = cache_directory(XDG_CACHE_HOME=os.devnull, TMPDIR=str(tmp_path))
    assert used.parent == tmp_path


def test_numbas_own_variable_wins(tmp_path: Path) -> None:
    assert cache_directory(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path
