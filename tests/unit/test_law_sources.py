"""Sources and constants in the key of a user's compiled law: an edit of any of them is noticed."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

import pytest

from flightstack.control.controller_loading import load_controller
from tests.support.plugin_site import EXAMPLE, install

MODULE = (EXAMPLE / "lqr_controller.py").read_text(encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of installed packages that this process sees."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    for name in ("lqr_controller", "beside", "beside_too"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return folder


def test_an_edit_is_noticed(site: Path) -> None:
    """The key of the compiled loops names the sources: of the module, and of its package if it has one."""
    package = site / "laws"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "helper.py").write_text("GAIN = 1.0\n")
    (package / "lqr.py").write_text(MODULE)
    importlib.invalidate_caches()
    controller = importlib.import_module("laws.lqr").CONTROLLER
    keys = {controller.key}
    for name, text in (
        ("helper.py", "GAIN = 2.0\n"),
        ("lqr.py", MODULE + "# edited\n"),
        ("new.py", "X = 1\n"),
    ):
        (package / name).write_text(text)
        keys.add(controller.key)
    assert len(keys) == 4
    install(site)
    importlib.invalidate_caches()
    alone = load_controller("lqr").attitude
    key = alone.key
    (site / "neighbour.py").write_text("X = 1\n")  # another package in the same folder is no part of it
    assert alone.key == key
    for name in ("laws.lqr", "laws"):
        sys.modules.pop(name, None)


HELPERS = {
    "beside.py": """from pathlib import Path
from numba import njit
import beside_too
def limited(x): return min(x, beside_too.LIMIT) + WEIGHTS[0]
SCALE = 1.0
WEIGHTS = (float(Path(__file__).with_name("weight.txt").read_text()),)
@njit
def scaled(x): return SCALE * limited(x)
""",
    "beside_too.py": "LIMIT = 5.0\n",
    "weight.txt": "0.25",
}
"""A module beside a law, another one that it uses, and a file that it reads."""
HELPED = MODULE.replace(
    "from __future__ import annotations\n", "from __future__ import annotations\nimport beside\n"
).replace("return memory, ", "beside.scaled(dt_s)\n    return memory, ")


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("beside.py", "SCALE = 1.0", "SCALE = 2.0"),
        ("beside.py", "min(x,", "max(x,"),
        ("beside_too.py", "LIMIT = 5.0", "LIMIT = 6.0"),
        ("weight.txt", "0.25", "0.26"),
    ],
)
def test_an_edit_of_a_module_beside_the_law_is_noticed(
    site: Path, name: str, before: str, after: str
) -> None:
    assert "beside.scaled" in HELPED

    def key() -> str:
        importlib.invalidate_caches()
        for module in ("lqr_controller", "beside", "beside_too"):
            sys.modules.pop(module, None)
        return load_controller("lqr").attitude.key

    install(site)
    for file, text in {**HELPERS, "lqr_controller.py": HELPED}.items():
        (site / file).write_text(text)
    first = key()
    assert key() == first
    (site / "neighbour.py").write_text("X = 1\n")
    assert key() == first
    (site / name).write_text(HELPERS[name].replace(before, after))
    os.utime(site / name, (1e9, 1e9))  # the same size: bytecode is stale by its time
    assert key() != first
