"""The oldest libraries that pyproject.toml admits, as pip's constraints: python -m tools.oldest_versions

``make oldest`` runs tests with them: a bound that nobody has flown with is a guess.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path

_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)(\[[\w,]+\])?(>=(?P<version>[\d.]+))?")
_DEVELOPERS = ("test", "docs", "dev")
"""Extras of developers: their tools are the newest."""


def constraints(requirements: Iterable[str]) -> list[str]:
    """Return a constraint for each requirement that has a lower bound."""
    found = map(_REQUIREMENT.match, requirements)
    bounds = {item["name"]: item["version"] for item in found if item is not None and item["version"]}
    return [f"{name}=={version}" for name, version in bounds.items()]


def of_users() -> list[str]:
    """Return the requirements of the package, and those that its extras add for users."""
    path = Path(__file__).resolve().parents[1] / "pyproject.toml"
    project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
    extras = {
        name: items for name, items in project["optional-dependencies"].items() if name not in _DEVELOPERS
    }
    return [item for items in (project["dependencies"], *extras.values()) for item in items]


def main() -> None:
    """Print the constraints, one a line."""
    print("\n".join(constraints(of_users())))


if __name__ == "__main__":
    main()
