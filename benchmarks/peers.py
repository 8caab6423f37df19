"""Own flights and those of other programs in turns: ``--against ardupilot=DIRECTORY,rotorpy=PYTHON``.

Beside autopilots fly ``missions/square.plan`` on sensors, by wall time; beside simulators the flights of a campaign, by
processor time.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol

from benchmarks import campaigns, one_process, three_processes
from benchmarks.autopilots import AUTOPILOTS
from benchmarks.measure import Figure, figure
from benchmarks.peer_error import PeerError
from benchmarks.simulators import SIMULATORS
from flightstack.params.config import ESTIMATED
from gcs_cli.errors import CliError

Fly = Callable[[], float]
"""Flies once and returns the real-time factor."""


class Peer(Protocol):
    """A program that own flights are compared with."""

    def problem(self, path: Path, /) -> str:
        """Return the reason why it cannot fly from ``path``, or an empty text."""

    def opened(self, path: Path, /) -> contextlib.AbstractContextManager[dict[str, Fly]]:
        """Yield what flies once, by the name of its row."""


PEERS: dict[str, Peer] = {**AUTOPILOTS, **SIMULATORS}


def peers_of(text: str) -> dict[str, Path]:
    """Return the path of each peer in ``ardupilot=DIRECTORY,rotorpy=PYTHON``; raise ArgumentTypeError."""
    found: dict[str, Path] = {}
    for part in text.split(","):
        name, _, given = part.partition("=")
        if name not in PEERS or not given:
            raise argparse.ArgumentTypeError(f"{part!r} is not NAME=PATH with a NAME of {', '.join(PEERS)}")
        path = Path(given).absolute()  # not resolved: the Python of a virtual environment is a link
        if problem := PEERS[name].problem(path):
            raise argparse.ArgumentTypeError(problem)
        if name in found:
            raise argparse.ArgumentTypeError(f"{name} has two paths")
        found[name] = path
    return found


def _one_process(variant: one_process.Variant) -> float:
    return one_process.fly(variant)[0]


def _three_processes() -> float:
    summary, _ = three_processes.fly(500.0, state=ESTIMATED)
    return float(summary["real_time_factor"])


def _beside_autopilots() -> dict[str, Fly]:
    return {
        **{
            f"one process, {each.name}": partial(_one_process, each)
            for each in one_process.VARIANTS
            if each.state == ESTIMATED
        },
        "three processes, sensors and estimator, log": _three_processes,
    }


def _beside_simulators() -> dict[str, Fly]:
    return {f"campaign, {kind.name}": campaigns.Flights(kind).fly for kind in campaigns.KINDS}


GROUPS: dict[str, tuple[Mapping[str, Peer], Callable[[], dict[str, Fly]]]] = {
    "autopilots": (AUTOPILOTS, _beside_autopilots),
    "simulators": (SIMULATORS, _beside_simulators),
}
"""Peers that are compared with the same own flights."""


def flights(paths: dict[str, Path], rounds: int) -> dict[str, dict[str, Figure]]:
    """Return the factors of own flights and of the peers' by group, each group flown in turns."""
    return {
        group: _in_turns(own(), {name: paths[name] for name in paths if name in members}, rounds)
        for group, (members, own) in GROUPS.items()
        if any(name in members for name in paths)
    }


def _in_turns(flown: dict[str, Fly], paths: dict[str, Path], rounds: int) -> dict[str, Figure]:
    """Fly each in every round; the first round warms caches."""
    seen: dict[str, list[float]] = {}
    with contextlib.ExitStack() as stack:
        for name, path in paths.items():
            flown |= stack.enter_context(PEERS[name].opened(path))
        for number in range(rounds + 1):
            for name, once in flown.items():
                try:
                    factor = once()
                except (CliError, PeerError) as error:
                    print(f"round {number} left out: {error}", file=sys.stderr, flush=True)
                    continue
                if number:
                    seen.setdefault(name, []).append(factor)
    return {name: figure(seen[name]) for name in flown if name in seen}
