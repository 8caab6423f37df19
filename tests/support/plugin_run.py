"""Runs of pytest with the plugin, in a directory outside this repository."""

from __future__ import annotations

import os
import tempfile
from importlib import import_module
from pathlib import Path

import pytest

from flightstack.testing import pytest_plugin
from flightstack.testing.artifacts import Artifacts, Flown
from flightstack.testing.world import World

PLUGIN = ("-p", pytest_plugin.__name__, "-p", "no:flightstack")
"""Loads the plugin of this source tree, and not that of an installation."""
KERNELS = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")


def load() -> None:
    """Import all that the runs use, before the fixture ``pytester``, which unloads later imports: Numba cannot."""
    import_module("flightstack.testing.sitl")
    with tempfile.TemporaryDirectory() as folder, World(vehicle="x_quad") as world:
        flown = Flown(world)
        world.arm()
        world.run_for(0.1)
        kept = Artifacts(Path(folder)).keep("loaded", flown.evidence(), "")
        assert len(kept.properties) == 3


def prepare(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Let runs and processes find imports and compiled kernels: ``pytester`` gives them an empty home."""
    monkeypatch.setenv("XDG_CACHE_HOME", KERNELS)
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    monkeypatch.delenv("PYTEST_XDIST_WORKER_COUNT", raising=False)
    return pytester


def run(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """Run pytest in this process. Any warning is an error; the hang guard of the outer test stays."""
    options = ("-p", "no:flightstack", "-p", "no:faulthandler", "-W", "error")
    return pytester.runpytest_inprocess(*options, *arguments, plugins=[pytest_plugin])


def section(result: pytest.RunResult) -> dict[str, str]:
    """Return the lines of the plugin's section by their first word; further lines of an entry are joined to it."""
    found: dict[str, str] = {}
    name = ""
    lines = iter(result.outlines)
    for line in lines:
        if line.strip("- ") == "flightstack":
            break
    for line in lines:
        if line.startswith(("=", "_", "-")):
            break
        word, colon, rest = line.partition(":")
        if colon and line[:1].isalpha() and " " not in word:
            name = word
            found[name] = rest.strip()
        else:
            found[name] += "\n" + line.strip()
    return found
