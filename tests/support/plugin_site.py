"""The example of a controller, installed without a network."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "mission_tests"
GROUP = "flightstack.attitude_controllers"


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
