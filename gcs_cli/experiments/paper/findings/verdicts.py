"""Helpers for verdicts: a verdict as plain data, and the flights it compares. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from gcs_cli.experiments.paper.findings.comparisons import Cases
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    PID,
    POLES,
    RATE_FED_PID,
    SMALL_ANGLE,
    all_cases,
    key,
)

NAMES = {
    PID: "the PID as flown",
    RATE_FED_PID: "the PID with its rate fed ahead",
    BACKSTEPPING: "backstepping",
    POLES: "the linear PD with backstepping's poles",
}


_PLANNED = frozenset(case.key for case in all_cases(multibody=True))


class NotFlownError(Exception):
    """A verdict needs a flight or an analysis that is not part of this run."""


class NothingToCompareError(Exception):
    """A compared flight ended early, or the flights have no move in common; the text says which."""


class Question(NamedTuple):
    """A claim and the threshold that decides it."""

    name: str
    text: str
    source: str
    threshold: str

    def answer(self, holds: bool, words: str, **figures: Any) -> dict[str, Any]:
        """Return the verdict with its sentence and its figures."""
        return {
            "name": self.name, "claim": self.text, "source": self.source, "holds": holds,
            "threshold": self.threshold, "words": words, "figures": figures,
        }  # fmt: skip

    def nothing_to_compare(self, why: str, where: str) -> dict[str, Any]:
        """Return the verdict for compared flights that ended early: it does not hold."""
        return self.answer(False, f"{sentence(why)} {where}: nothing to compare.")


def where_of(plant: str) -> str:
    """Return a plant as the end of a sentence."""
    return "on the small-angle plant" if plant == SMALL_ANGLE else "on the rigid-body plant"


def sentence(words: str) -> str:
    """Return words with a capital first letter."""
    return words[:1].upper() + words[1:]


def flights(
    cases: Cases, names: Sequence[str], trajectory: str, condition: str, plant: str
) -> list[Mapping[str, Any]]:
    """Return the flights of these contenders; raise NotFlownError, or KeyError for a key outside the matrix."""
    return [flight(cases, key(name, trajectory, condition, plant)) for name in names]


def flight(cases: Cases, name: str) -> Mapping[str, Any]:
    """Return one flight; raise NotFlownError, or KeyError for a key outside the matrix."""
    if name not in cases and name in _PLANNED:
        raise NotFlownError(name)
    return cases[name]


def who_ended(names: Sequence[str], found: Sequence[Mapping[str, Any]]) -> str | None:
    """Return the contenders that crashed or lost control, as text; None if all flights are complete."""
    ended = [
        f"{NAMES[name]} {how_ended(case)}"
        for name, case in zip(names, found, strict=True)
        if case["ended"] is not None
    ]
    return ", ".join(ended) or None


def require_complete(names: Sequence[str], found: Sequence[Mapping[str, Any]], prefix: str = "") -> None:
    """Raise NothingToCompareError, with ``prefix``, if a flight of these contenders ended early."""
    if (why := who_ended(names, found)) is not None:
        raise NothingToCompareError(prefix + why)


def how_ended(case: Mapping[str, Any]) -> str:
    """Return "crashed" or "lost control"."""
    return "lost control" if case["ended"]["how"] == "lost" else "crashed"


def less_or_more(percent: float) -> str:
    """Return a difference in per cent, with its direction."""
    return f"{abs(percent):.0f} % {'less' if percent < 0.0 else 'more'}"
