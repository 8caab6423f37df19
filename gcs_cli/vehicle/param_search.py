"""Search over names and descriptions of parameters. Pure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from difflib import SequenceMatcher, get_close_matches

from flightstack.mavlink.param_values import Parameter
from gcs_cli.vehicle.param_info import UNKNOWN, ParamInfo

_SIMILAR = 0.75
"""Ratio of equal letters at which a misspelt word still matches."""
_MOST_NEAR = 3
_SHORTEST_WORD = 3
"""Letters of a word that a suggestion must have."""
_WORD = re.compile(r"[a-z0-9]+")


def search_parameters(
    parameters: Sequence[Parameter], infos: Mapping[str, ParamInfo], words: Sequence[str]
) -> list[Parameter]:
    """Return the parameters that match all ``words``, the best first; equal ones in their order.

    A word counts most as the whole name or its beginning, then within the name, the short description, the long
    description and choices; least as a misspelling of a word of these, or as letters of the name in their order.
    """
    wanted = [word.lower() for text in words for word in text.split()]
    scored = [
        (_score(parameter.name, infos.get(parameter.name, UNKNOWN), wanted), parameter)
        for parameter in parameters
    ]
    found = [(score, parameter) for score, parameter in scored if score > 0.0]
    return [parameter for _, parameter in sorted(found, key=lambda entry: -entry[0])]


def near_names(name: str, names: Sequence[str]) -> list[str]:
    """Return those of ``names`` that are spelt like ``name``, the best first; else those that have its words."""
    near = get_close_matches(name.upper(), names, cutoff=_SIMILAR)
    if near:
        return near
    wanted = [word for word in name.lower().split("_") if len(word) >= _SHORTEST_WORD]
    scored = [(_score(each, UNKNOWN, wanted), each) for each in names if _has_words(each, wanted)]
    return [each for _, each in sorted(scored, key=lambda entry: -entry[0])]


def suggestion(name: str, names: Sequence[str], is_present: Callable[[str], bool] = lambda _: True) -> str:
    """Return the end of a sentence about an unknown name, with those of ``names`` near to it; empty without any."""
    near = [each for each in near_names(name, names)[:_MOST_NEAR] if is_present(each)]
    return f"; did you mean {' or '.join(near)}?" if near else ""


def _has_words(name: str, wanted: Sequence[str]) -> bool:
    """Return True if each word stands in the name, perhaps misspelt."""
    parts = name.lower().split("_")
    return bool(wanted) and all(
        word in name.lower() or any(_similarity(word, part) >= _SIMILAR for part in parts) for word in wanted
    )


def _score(name: str, info: ParamInfo, wanted: Sequence[str]) -> float:
    """Return the sum of the scores of all words, 0 if one of them does not match."""
    lower, short = name.lower(), info.help.lower()
    rest = " ".join((info.details, info.group, *(text for _, text in info.choices))).lower()
    known = {*_WORD.findall(lower), *_WORD.findall(short), *_WORD.findall(rest)}
    scores = [_word_score(word, lower, short, rest, known) for word in wanted]
    return sum(scores) if all(scores) else 0.0


def _word_score(word: str, name: str, short: str, rest: str, known: set[str]) -> float:
    exact = (
        (name == word, 10.0),
        (name.startswith(word), 8.0),
        (word in name.split("_"), 7.0),
        (word in name, 6.0),
        (word in _WORD.findall(short), 5.0),
        (word in short, 4.0),
        (word in rest, 3.0),
    )
    score = next((value for matches, value in exact if matches), 0.0)
    if score or len(word) < 3:
        return score
    ratio = max((_similarity(word, other) for other in known), default=0.0)
    if ratio >= _SIMILAR:
        return 2.0 * ratio
    return 0.5 if _is_subsequence(word, name) else 0.0


def _similarity(word: str, other: str) -> float:
    if abs(len(word) - len(other)) > 2:
        return 0.0
    matcher = SequenceMatcher(None, word, other, autojunk=False)
    return matcher.ratio() if matcher.quick_ratio() >= _SIMILAR else 0.0


def _is_subsequence(word: str, name: str) -> bool:
    letters = iter(name)
    return all(letter in letters for letter in word)
