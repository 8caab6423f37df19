"""Which curves of a chart lie on top of each other, said in words: one colour hides the other. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gcs_cli.report.chart import Line

ALIKE = 0.01
"""Curves that are nowhere farther apart than this share of the chart's height are one line to the eye."""


def hidden_note(charts: Mapping[str, Sequence[Line]]) -> str:
    """Return a sentence that names the curves of each chart that cannot be told apart; empty if all can."""
    where: dict[str, list[str]] = {}
    for title, lines in charts.items():
        for group in alike(lines):
            names = "all" if 2 < len(group) == len(lines) else " = ".join(group)
            where.setdefault(names, []).append(title)
    told = [f"{names} ({', '.join(titles)})" for names, titles in where.items()]
    return f"On top of each other: {'; '.join(told)}." if told else ""


def alike(lines: Sequence[Line]) -> list[tuple[str, ...]]:
    """Return the labels of curves that lie on top of the first one of their group; of the same times, finite."""
    if not lines:
        return []
    joined = np.concatenate([line.y for line in lines])
    reach = ALIKE * (float(joined.max()) - float(joined.min())) if len(joined) else 0.0
    groups: list[list[Line]] = []
    for line in lines:
        for group in groups:
            if len(line.y) == len(group[0].y) and bool(np.all(np.abs(line.y - group[0].y) <= reach)):
                group.append(line)
                break
        else:
            groups.append([line])
    return [tuple(line.label for line in group) for group in groups if len(group) > 1]
