"""The example of a user's repository passes its tests with an installed wheel, outside this repository.

The environment is new and has two packages of its own: the wheel of this source tree, and the example. All else, such
as NumPy, MAVSDK and pytest, comes from the environment of this test by a path file, which stands behind them. Nothing
is downloaded, and this source tree is not on the path.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.interop.needs import needs
from tests.support.plugin_run import KERNELS
from tests.support.tools import NIGHTLY

needs("mavsdk", "mavsdk")

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "mission_tests"
OFFLINE = ("--no-deps", "--no-index", "--no-build-isolation", "--disable-pip-version-check", "-q")
GITHUB, GITLAB = ".github/workflows/mission-tests.yml", ".gitlab-ci.yml"


def checked(*command: str | Path, **options: Any) -> str:
    """Run a command to its end and return its output."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{shlex.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the variables of a shell in which the new environment is active."""
    inherited = {name: text for name, text in os.environ.items() if not name.startswith(("PYTEST", "PYTHON"))}
    folder = tmp_path_factory.mktemp("environment")
    checked(sys.executable, "-m", "venv", "--without-pip", folder)
    packages = {sysconfig.get_path(name) for name in ("purelib", "platlib")}
    (site,) = folder.glob("lib/python3*/site-packages")
    (site / "behind.pth").write_text("\n".join(sorted(packages)), encoding="utf-8")
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return {**inherited, "PATH": path, "XDG_CACHE_HOME": KERNELS, "VIRTUAL_ENV": str(folder)}


@pytest.fixture(scope="module")
def installed(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the example, which is installed beside the wheel."""
    wheels, project = tmp_path_factory.mktemp("wheels"), tmp_path_factory.mktemp("user") / "repository"
    checked(sys.executable, "-m", "pip", "wheel", *OFFLINE, "-w", wheels, ROOT)
    shutil.copytree(EXAMPLE, project, ignore=shutil.ignore_patterns("__pycache__", ".pytest_cache"))
    python = Path(environment["VIRTUAL_ENV"]) / "bin" / "python"
    install = (sys.executable, "-m", "pip", "--python", python, "install", *OFFLINE)
    checked(*install, *wheels.glob("*.whl"), project, env=environment)
    return project


def commands(name: str) -> list[str]:
    """Return the shell commands of a workflow file."""
    workflow = yaml.safe_load((EXAMPLE / name).read_text(encoding="utf-8"))
    if name == GITLAB:
        return list(workflow["mission-tests"]["script"])
    return [step["run"] for step in workflow["jobs"]["fly"]["steps"] if "run" in step]


def test_wheel_is_imported_and_not_this_source_tree(environment: dict[str, str], installed: Path) -> None:
    program = "import flightstack, gcs_cli, sim_bridge as s; print(flightstack.__file__, gcs_cli.__file__, s.__file__)"
    files = checked("python", "-c", program, env=environment, cwd=installed).split()
    assert [Path(file).is_relative_to(environment["VIRTUAL_ENV"]) for file in files] == [True] * 3


@pytest.mark.skipif(not NIGHTLY, reason="installed as by a user, a minute: set NIGHTLY=1")
def test_example_passes_by_the_command_of_its_workflow(environment: dict[str, str], installed: Path) -> None:
    program, *arguments = shlex.split(commands(GITHUB)[-1])
    assert program == "pytest"
    checked("python", "-m", "pytest", "-W", "error", *arguments, env=environment, cwd=installed)
    (suite,) = ET.parse(installed / "report.xml").getroot()
    results = {name: int(suite.get(name, "")) for name in ("tests", "failures", "errors", "skipped")}
    assert results == {"tests": 12, "failures": 0, "errors": 0, "skipped": 0}


@pytest.mark.parametrize("page", ["ci", "test-mavsdk-app", "test-controller"])
def test_page_quotes_files_of_the_example(page: str) -> None:
    text = (ROOT / "docs" / "tutorials" / f"{page}.md").read_text(encoding="utf-8")
    quotes = re.findall(r'^```\w+ title="(examples/[^"]+)"\n(.*?)^```$', text, re.MULTILINE | re.DOTALL)
    assert quotes
    assert [name for name, quote in quotes if quote not in (ROOT / name).read_text(encoding="utf-8")] == []


def test_workflows_run_the_same_commands_and_keep_their_files() -> None:
    assert commands(GITHUB) == commands(GITLAB)
    install, test = map(shlex.split, commands(GITHUB))
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert install == ["pip", "install", "--find-links", "wheels", ".[test]"]
    assert "flightstack[testing]" in project["optional-dependencies"]["test"]
    written = [argument.partition("=")[2] for argument in test[1:]]
    for name in (GITHUB, GITLAB):
        text = (EXAMPLE / name).read_text(encoding="utf-8")
        assert [file for file in (*written, ".cache/flightstack", "XDG_CACHE_HOME") if file not in text] == []
