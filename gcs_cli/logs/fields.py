"""Fields of a log by a name that need not be complete. Pure."""

from __future__ import annotations

import difflib
import fnmatch
import re
from typing import NamedTuple

from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.recording import Recording, Topic

MOST_FIELDS = 24
"""Largest number of fields that a pattern may select."""
_SHOWN = 8
_WILDCARDS = {"*", "?"}


class Field(NamedTuple):
    """One field of one topic; ``name`` is ``topic.field``."""

    topic: Topic
    name: str

    @property
    def label(self) -> str:
        """Topic and field."""
        return f"{self.topic.name}.{self.name}"


def all_fields(recording: Recording) -> list[Field]:
    """Return the fields that hold numbers."""
    return [
        Field(topic, name)
        for topic in recording.topics
        for name, values in topic.fields.items()
        if values.dtype.kind in "biuf"
    ]


def find_fields(recording: Recording, wanted: str) -> list[Field]:
    """Return the fields that ``wanted`` names; raise CliError (usage) if none or too many.

    In this order: all fields of ``topic``; ``topic.field``; all elements of ``topic.array``; a pattern with ``*`` or
    ``?``; the only field that ends with the text; the only field that has its parts in this order. Case does not
    matter.
    """
    fields = all_fields(recording)
    text = wanted.strip().lower()
    if of_topic := [field for field in fields if field.topic.name.lower() == text]:
        if len(of_topic) <= MOST_FIELDS:
            return of_topic
        names = ", ".join(field.name for field in of_topic)
        raise CliError(f"{wanted} has {len(of_topic)} fields, give some of them: {names}", USAGE)
    for found in _matches(fields, text):
        is_unique = len({_base(field) for field in found}) == 1 or bool(_WILDCARDS & set(text))
        if is_unique and len(found) <= MOST_FIELDS:
            return found
        problem = "names too many fields" if is_unique else "is not unique"
        raise CliError(f"{wanted} {problem}: {_listed([field.label for field in found])}", USAGE)
    labels = {field.label.lower(): field.label for field in fields}
    close = difflib.get_close_matches(text, labels, n=4, cutoff=0.5)
    hint = f"; did you mean {', '.join(labels[name] for name in close)}?" if close else ""
    raise CliError(
        f"{wanted}: {recording.source} has no such field{hint} (gcs log info lists the topics)", USAGE
    )


def _matches(fields: list[Field], text: str) -> list[list[Field]]:
    """Return the fields that each rule selects, the strictest rule first; empty ones do not count."""
    lowered = [(field, field.label.lower()) for field in fields]
    bases = [(field, _base(field).lower()) for field in fields]
    rules = [
        [field for field, label in lowered if label == text],
        [field for field, base in bases if base == text],
    ]
    if _WILDCARDS & set(text):
        pattern = re.compile(r"(?:.*[._])?" + fnmatch.translate(text.replace("[", "[[]")))
        rules.append([field for field, label in lowered if pattern.fullmatch(label)])
    ending = re.compile(rf"(?:^|[._]){re.escape(text)}$")
    rules += [
        [field for field, label in lowered if ending.search(label)],
        [field for field, base in bases if ending.search(base)],
    ]
    parts = re.compile(".*".join(map(re.escape, re.split(r"[._\s]+", text))))
    rules += [
        [field for field, label in lowered if parts.search(label)],
    ]
    return [rule for rule in rules if rule]


def _base(field: Field) -> str:
    """Return the label without the index of an element."""
    return re.sub(r"\[\d+\]$", "", field.label)


def _listed(labels: list[str]) -> str:
    more = f" and {len(labels) - _SHOWN} more" if len(labels) > _SHOWN else ""
    return ", ".join(labels[:_SHOWN]) + more
