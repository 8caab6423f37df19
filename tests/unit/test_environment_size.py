"""Size of the environment that ``make fly`` installs: flightstack with its dependencies, without extras."""

from __future__ import annotations

from importlib.metadata import Distribution, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LIMIT_MB = 700.0
OTHER_MB = 75.0
"""Pip, and the bytecode of what a flight imports: 640 MB of an environment whose distributions had 568 MB."""


def needed_distributions(name: str) -> dict[str, Distribution]:
    """Return the installed distribution and all that it needs on this machine, by canonical name."""
    found: dict[str, Distribution] = {}
    waiting, seen = [Requirement(name)], set()
    while waiting:
        requirement = waiting.pop()
        key = canonicalize_name(requirement.name)
        if (key, *sorted(requirement.extras)) in seen:
            continue
        seen.add((key, *sorted(requirement.extras)))
        found[key] = distribution(requirement.name)
        extras = ("", *requirement.extras)
        for needed in map(Requirement, found[key].requires or ()):
            if needed.marker is None or any(needed.marker.evaluate({"extra": extra}) for extra in extras):
                waiting.append(needed)
    return found


def size_mb(found: Distribution) -> float:
    """Return the size of the files in RECORD without bytecode, in 10⁶ bytes."""
    files = found.files or ()
    return sum(file.size or 0 for file in files if file.suffix != ".pyc") / 1e6


def test_environment_of_a_flight_stays_below_700_megabytes() -> None:
    """567.9 MB in 40 distributions measured, of which llvmlite has 179 MB and SciPy 114 MB."""
    sizes = {name: size_mb(found) for name, found in needed_distributions("flightstack").items()}
    largest = sorted(sizes, key=sizes.__getitem__, reverse=True)[:5]
    assert {"numba", "scipy", "matplotlib", "pymavlink"} <= sizes.keys()  # the dependencies are followed
    assert min(sizes[name] for name in largest) > 10.0  # RECORD has sizes
    assert sum(sizes.values()) < LIMIT_MB - OTHER_MB, {name: round(sizes[name], 1) for name in largest}


def test_environment_of_a_flight_has_no_tools_of_developers() -> None:
    needed = needed_distributions("flightstack").keys()
    assert not needed & {"pytest", "mypy", "ruff", "hypothesis", "mujoco", "ziglang", "unicorn", "pyarrow"}
