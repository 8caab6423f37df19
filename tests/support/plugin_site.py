"""The example of a controller, installed without a network."""

from __future__ import annotations

import importlib
import importlib.util
import shutil
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "mission_tests"
GROUP = "flightstack.attitude_controllers"


def example_module() -> ModuleType:
    """Import the example's module, without an installation."""
    spec = importlib.util.spec_from_file_location("lqr_controller", EXAMPLE / "lqr_controller.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["lqr_controller"] = module
    spec.loader.exec_module(module)
    return module


def install(site: Path, project: Path = EXAMPLE) -> Path:
    """Do what pip does with the project, without a network: its module and its metadata into ``site``."""
    with (project / "pyproject.toml").open("rb") as file:
        declared = tomllib.load(file)["project"]
    for source in project.glob("*.py"):
        shutil.copy(source, site)
    info = site / f"{declared['name'].replace('-', '_')}-{declared['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {declared['name']}\nVersion: {declared['version']}\n"
    )
    entries = [f"{name} = {value}" for name, value in declared["entry-points"][GROUP].items()]
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n" + "\n".join(entries) + "\n")
    return site


def new_site(folder: Path, patch: pytest.MonkeyPatch) -> Path:
    """Make a directory of installed packages that this process sees until ``patch`` is undone."""
    folder.mkdir()
    patch.syspath_prepend(str(folder))
    for name in ("lqr_controller", "broken"):
        patch.delitem(sys.modules, name, raising=False)
    return folder


def installed_site(folder: Path, patch: pytest.MonkeyPatch) -> Path:
    """Make such a directory with the example's controller."""
    site = install(new_site(folder, patch))
    importlib.invalidate_caches()
    return site
