"""Compilation: where kernels are cached, what makes a cache stale, and how a template is specialised."""

from __future__ import annotations

import importlib
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from flightstack.control.mixer import mix
from flightstack.core import compiled as module
from flightstack.core import geometry
from flightstack.core.compiled import compiled, direct, specialise
from flightstack.core.geometry import quaternion_product
from flightstack.core.kernels import cache as kernel_cache
from flightstack.core.kernels.cache import is_own
from sim_bridge.plant.integrator import advance_kernel

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


def test_specialise_binds_given_names() -> None:
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


def test_direct_kernel_follows_the_layout_of_its_examples() -> None:
    @compiled
    def second(numbers: np.ndarray) -> float:  # type: ignore[type-arg]
        return numbers[1]  # type: ignore[no-any-return]

    dense, spread = np.array([3.0, 4.0]), np.array([3.0, 5.0, 4.0, 6.0])[::2]
    assert direct(second, dense)(dense) == direct(second, spread)(spread) == 4.0
    assert direct(second, np.zeros(2)) is direct(second, dense)


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


def test_only_our_own_functions_are_cached_by_themselves() -> None:
    assert is_own("flightstack.control.mixer")
    assert is_own("sim_bridge.plant.rigid")
    assert not is_own("lqr_controller")
    assert not is_own("flightstack_extras.law")
    assert Path(mix.stats.cache_path).is_dir()
    assert double.stats.cache_path is None


def write_sources(top: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        path = top / "flightstack" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def digest_of(top: Path, *modules: str) -> str:
    kernel_cache.read_source.cache_clear()
    return kernel_cache.digest(top, modules, "1")


def test_the_digest_covers_direct_and_indirect_imports(tmp_path: Path) -> None:
    used = {
        "control/law.py": "from flightstack.control import helper\n"
        "from flightstack.core.geometry import (  # frames\n    wrap,\n)\n",
        "control/helper.py": "import flightstack.deep as d\n",
        "control/__init__.py": "",
        "core/geometry.py": "x = 1\n",
        "deep.py": "x = 1\n",
    }
    write_sources(tmp_path, {**used, "elsewhere.py": "", "control/law_2.py": ""})
    before = digest_of(tmp_path, "flightstack.control.law")
    for name, text in used.items():
        write_sources(tmp_path, {name: text + "y = 2\n"})
        assert digest_of(tmp_path, "flightstack.control.law") != before, name
        write_sources(tmp_path, {name: text})
    write_sources(tmp_path, {"elsewhere.py": "x = 2\n", "control/law_2.py": "x = 2\n"})
    assert digest_of(tmp_path, "flightstack.control.law") == before


def test_no_module_that_compiled_code_names_escapes_the_digest() -> None:
    """Compare the imports found in the text with what the running modules really hold."""
    top = Path(module.__file__).parents[2]
    for name in ("flightstack.control.loops", "flightstack.guidance.kernels", "sim_bridge.plant.integrator"):
        covered = set(kernel_cache.sources(top, [name]))
        for value in vars(importlib.import_module(name)).values():
            home = getattr(getattr(value, "py_func", value), "__module__", None) or ""
            if is_own(str(home)):
                assert Path(sys.modules[home].__file__ or "") in covered, (name, home)


def test_a_specialised_kernel_is_cached_by_the_sources_of_all_its_parts() -> None:
    top = Path(module.__file__).parents[2]
    made_of = ("sim_bridge.plant.integrator", "sim_bridge.plant.paper")
    joined = ("flightstack.control.loops", "sim_bridge.plant.paper")
    assert digest_of(top, *joined) != digest_of(top, *joined[:1])
    expected = kernel_cache.digest(top, made_of, numba.__version__)
    if "NUMBA_DISABLE_JIT" not in os.environ:
        assert Path(advance_kernel("paper").stats.cache_path).parent.name == expected


def cache_directory(**variables: str) -> Path:
    """Where a process with these environment variables keeps its kernels."""
    environment = {
        key: text for key, text in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }
    code = "from flightstack.control.mixer import mix; print(mix.stats.cache_path)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**environment, **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(done.stdout.strip()).parent


def test_kernels_are_in_the_users_cache_and_unused_ones_are_removed(tmp_path: Path) -> None:
    kernels = tmp_path / "flightstack" / "kernels"
    for name in ("recent", "old"):
        (kernels / name).mkdir(parents=True)
    os.utime(kernels / "old", (1000.0, 1000.0))
    used = cache_directory(XDG_CACHE_HOME=str(tmp_path))
    assert used.parent == kernels
    names = {path.name for path in kernels.iterdir()}
    assert {used.name, "recent"} <= names
    assert "old" not in names


def test_sources_newer_than_the_process_are_not_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process may run the version before: its machine code is not that of the sources on disk."""
    find = kernel_cache.directory.__wrapped__
    assert find(frozenset({"flightstack.control.mixer"}), "1") is not None
    monkeypatch.setattr(kernel_cache, "STARTED_S", Path(geometry.__file__).stat().st_ctime - 1.0)
    assert find(frozenset({"flightstack.control.mixer"}), "1") is None


def test_a_source_replaced_by_one_with_an_older_time_is_not_cached(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    replaced = tmp_path / "mixer.py"
    replaced.touch()
    os.utime(replaced, (1000.0, 1000.0))
    monkeypatch.setattr(kernel_cache, "sources", lambda _top, _names: [replaced])
    assert kernel_cache.directory.__wrapped__(frozenset({"mixer"}), "1") is None


def test_a_home_that_cannot_be_written_does_not_stop_it(tmp_path: Path) -> None:
    used = cache_directory(XDG_CACHE_HOME=os.devnull, TMPDIR=str(tmp_path))
    assert used.parent.parent == tmp_path


def test_kernels_in_numba_cache_dir_are_keyed_by_their_sources(tmp_path: Path) -> None:
    """Numba alone would load the kernels of the release before an upgrade."""
    top = Path(module.__file__).parents[2]
    key = kernel_cache.digest(top, ["flightstack.control.mixer"], numba.__version__)
    assert cache_directory(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path / "flightstack" / "kernels" / key
    covered = set(kernel_cache.sources(top, ["flightstack.control.mixer"]))
    compiler = {"cache.py", "compiler.py", "dispatcher.py", "intrinsics.py", "items.py"}
    assert {top / "flightstack" / "core" / "kernels" / name for name in compiler} <= covered


def test_copies_of_the_sources_share_their_kernels(tmp_path: Path) -> None:
    """A clone and an installed wheel of the same sources need no compilation of their own."""
    top = Path(module.__file__).parents[2]
    copy = tmp_path / "copy"
    for path in kernel_cache.sources(top, ["flightstack.core.geometry"]):
        target = copy / path.relative_to(top)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())  # of another time
    code = """if True:
        from flightstack.core.geometry import Quaternion, quaternion_product
        quaternion_product(Quaternion(1.0, 0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0))
        print(sum(quaternion_product.stats.cache_hits.values()))"""
    hits = []
    for place in (top, copy):
        environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(place)}
        environment.pop("NUMBA_CACHE_DIR", None)
        done = subprocess.run(
            [sys.executable, "-P", "-c", code], env=environment, capture_output=True, text=True, check=True
        )
        hits.append(int(done.stdout))
    assert hits == [0, 1]


@pytest.mark.parametrize(
    "example",
    [
        np.zeros(3),
        np.zeros((2, 3), np.float32),
        np.zeros((2, 3), order="F"),
        np.zeros((4, 6))[::2, ::3],
        np.broadcast_to(0.0, 3),
        np.zeros(2, [("a", "<f8", 3), ("b", "<i8")]),
        np.zeros((), np.dtype([("a", "<i2"), ("b", "<f8")], align=True)),
    ],
    ids=lambda example: f"{example.dtype} {example.shape}",
)
def test_types_of_arrays_are_those_of_numba(example: np.ndarray) -> None:  # type: ignore[type-arg]
    assert mix.dispatcher.typeof_pyval(example) == numba.typeof(example)  # type: ignore[attr-defined]


def test_a_kernel_of_arrays_is_called_without_the_import_of_masked_arrays() -> None:
    code = (
        "import sys, numpy as np; from flightstack.core.arrays import all_finite; "
        "all_finite(np.zeros(3)); sys.exit('numpy.ma' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_stored_kernel_for_other_types_is_not_used(tmp_path: Path) -> None:
    """Two processes that save their first kernel of a function at once write the same file."""
    code = """if True:
        from flightstack.core.geometry import Quaternion, quaternion_product
        for number in (1, 1.0):
            turn = Quaternion(0 * number, number, 0 * number, 0 * number)
            print(*quaternion_product(turn, turn))"""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)

    def printed() -> str:
        return subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        ).stdout

    assert printed() == "-1 0 0 0\n-1.0 0.0 0.0 0.0\n"
    stored = sorted(tmp_path.rglob("geometry.quaternion_product-*.nbc"))
    assert len(stored) == 2 * ("NUMBA_DISABLE_JIT" not in os.environ)
    contents = [path.read_bytes() for path in stored]
    for path, content in zip(stored, reversed(contents), strict=True):
        path.write_bytes(content)
    assert printed() == "-1 0 0 0\n-1.0 0.0 0.0 0.0\n"


DAMAGED = {
    "cross": ("nbi", lambda content: b""),
    "conjugate": ("nbi", lambda content: content[:200]),
    "heading": ("nbi", lambda content: bytes(400)),
    "normalised": ("nbc", lambda content: b""),
    "quaternion_product": ("nbc", lambda content: content[:200]),
    "wrap_pi": ("nbc", lambda content: bytes(400)),
}
"""Kernels of the geometry, which of their files is damaged, and how."""


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_damaged_files_of_a_kernel_are_written_again(tmp_path: Path) -> None:
    """After a power failure, a file may be empty, cut or zero."""
    code = """if True:
        from flightstack.core import geometry
        turn, vector = geometry.Quaternion(1.0, 0.0, 0.0, 0.0), geometry.Vector3(1.0, 0.0, 0.0)
        given = dict(cross=[vector] * 2, quaternion_product=[turn] * 2, wrap_pi=[1.0])
        for name in KERNELS:
            kernel = getattr(geometry, name)
            kernel(*given.get(name, [turn]))
            print(sum(kernel.stats.cache_hits.values()))"""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)

    def hits() -> dict[str, int]:
        command = [sys.executable, "-c", code.replace("KERNELS", repr(list(DAMAGED)))]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return dict(zip(DAMAGED, map(int, done.stdout.split()), strict=True))

    assert hits() == dict.fromkeys(DAMAGED, 0)
    for name, (suffix, damage) in DAMAGED.items():
        (stored,) = tmp_path.rglob(f"geometry.{name}-*.{suffix}")
        stored.write_bytes(damage(stored.read_bytes()))
    assert hits() == dict.fromkeys(DAMAGED, 0)
    assert hits() == dict.fromkeys(DAMAGED, 1)


def test_kernel_for_a_type_of_another_package_is_not_stored(tmp_path: Path) -> None:
    """A process without the package could not read the file, which has the results for all types."""
    (tmp_path / "own_law.py").write_text(
        "from typing import NamedTuple\nclass Memory(NamedTuple):\n    x: float\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)
    begin = "from flightstack.core.arrays import all_finite\nfrom flightstack.core.contract import Vector3\n"
    with_package = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\nfrom own_law import Memory\n"
    for script in (
        with_package + begin + "assert all_finite(Memory(1.0))",
        begin + "assert all_finite(Vector3(1.0, 2.0, 3.0))",
    ):
        subprocess.run([sys.executable, "-c", script], env=environment, check=True)
    assert list(tmp_path.rglob("arrays.all_finite-*.nbc"))


def test_cache_directory_of_other_numba_users_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "elsewhere")
    module.Kernel(quaternion_product.py_func, frozenset({geometry.__name__}))
    assert numba.config.CACHE_DIR == "elsewhere"


def test_existing_read_only_cache_does_not_stop_compilation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    old, recent = tmp_path / "flightstack-kernels-old", tmp_path / "flightstack-kernels-recent"
    for folder in (old, recent):
        (folder / "a").mkdir(parents=True)
    os.utime(old, (0.0, 0.0))
    made = kernel_cache.base_directory.__wrapped__()
    assert made.name.startswith("flightstack-kernels-")
    assert sorted(tmp_path.iterdir()) == sorted([made, recent])


@compiled
def product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    return np.dot(matrix, vector)


def test_a_kernel_may_use_blas() -> None:
    assert product(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([5.0, 6.0])).tolist() == [17.0, 39.0]


def test_a_vehicle_starts_without_scipy_linalg() -> None:
    program = """
import sys
from flightstack.process.assembly import build
from flightstack.params.config import StackConfig
build(StackConfig(vehicle="paper_quad", gains="tuned"), lambda: None)
print("scipy.linalg" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@compiled
def _first(array: Any) -> Any:
    return array[0]


@pytest.mark.parametrize("kind", [">f8", np.longdouble])
def test_array_that_numba_does_not_know_is_reported_as_numba_does(kind: Any) -> None:
    """With the place of the argument, by early versions with the dtype."""
    with pytest.raises(TypingError, match=r"(?s)pyobject.*argument|Unsupported array dtype"):
        _first(np.ones(3, kind))
