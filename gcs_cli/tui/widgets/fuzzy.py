"""Fuzzy search over names. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

_WHOLE, _BOUNDARY = 100.0, 20.0
_BOUNDARIES = " ._[/"


class Match(NamedTuple):
    """A name with the positions of the letters that match."""

    score: float
    name: str
    positions: tuple[int, ...]


def search(query: str, names: Iterable[str]) -> list[Match]:
    """Return the names that contain the letters of each word of ``query`` in order, best first."""
    words = tuple(query.lower().split())
    matches = [match for name in names if (match := _match(words, name)) is not None]
    return sorted(matches, key=lambda match: (-match.score, match.name))


@lru_cache(maxsize=8192)
def _match(words: tuple[str, ...], name: str) -> Match | None:
    lower, score, positions = name.lower(), 0.0, set[int]()
    for word in words:
        found = _best(word, lower)
        if found is None:
            return None
        score += found[0]
        positions.update(found[1])
    return Match(score - 0.1 * len(name), name, tuple(sorted(positions)))


def _best(word: str, name: str) -> tuple[float, tuple[int, ...]] | None:
    """Return score and positions of the shortest stretch of ``name`` with the letters of ``word`` in order."""
    best: tuple[float, tuple[int, ...]] | None = None
    start = name.find(word[0])
    while start >= 0 and (positions := _positions(word, name, start)) is not None:
        gaps = positions[-1] - start + 1 - len(word)
        score = (_WHOLE if not gaps else 50.0 - gaps) - start * 0.01
        if start == 0 or name[start - 1] in _BOUNDARIES:
            score += _BOUNDARY
        if best is None or score > best[0]:
            best = (score, positions)
        start = name.find(word[0], start + 1)
    return best


def _positions(word: str, name: str, start: int) -> tuple[int, ...] | None:
    """Return where each letter of ``word`` comes next in ``name`` from ``start`` on; None if one does not.

    The nearest letters leave the most of the name to the next ones, so no other choice has to be tried.
    """
    positions = []
    for letter in word:
        start = name.find(letter, start)
        if start < 0:
            return None
        positions.append(start)
        start += 1
    return tuple(positions)
