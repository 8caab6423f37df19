"""Text tables."""

from __future__ import annotations

from collections.abc import Sequence

Row = Sequence[str]


def table(title: str, head: Row, rows: Sequence[Row]) -> str:
    """Return a table: the first column to the left, the others to the right; an empty row is a gap."""
    every = [head, *rows]
    widths = [max((len(row[i]) for row in every if i < len(row)), default=0) for i in range(len(head))]
    lines = [title]
    for row in every:
        cells = [
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=False))
        ]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return "\n".join(lines)
