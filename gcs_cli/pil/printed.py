"""What ``gcs pil`` prints at the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from gcs_cli.pil.result import PASSED


def print_outcome(console: Console, result: dict[str, Any], folder: Path) -> None:
    """Print the verdict's checks, what a step costs, and where the report is."""
    rows = [("check", "measured", "limit", ""), *map(_cells, result["checks"])]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row, passed in zip(rows, (None, *(check["passed"] for check in result["checks"])), strict=True):
        name, measured, limit, about = row
        line = f"{name:<{widths[0]}}  {measured:>{widths[1]}}  {limit:>{widths[2]}}  {about}".rstrip()
        style = "bright_black" if passed is None else "" if passed else "red"
        console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
    for stage, figures in ((result["profile"] or {}).get("stages") or {}).items():
        unit = result["profile"]["unit"]
        words = f"mean {figures['mean']:.1f}, p99 {figures['p99']:.0f}, max {figures['max']:.0f} {unit}"
        console.print(f"[bright_black]{stage:<9}[/]{words}", highlight=False)
    style = "green" if result["verdict"] == PASSED else "red"
    console.print(f"[bright_black]verdict  [/][{style}]{result['verdict']}[/]", highlight=False)
    console.print("[bright_black]files    [/]", end="")
    console.print(f"{folder}/  pil.html pil.json", markup=False, highlight=False, soft_wrap=True)


def _cells(check: dict[str, Any]) -> tuple[str, str, str, str]:
    unit = f" {check['unit']}" if check["unit"] else ""
    measured = "not a number" if check["measured"] is None else f"{check['measured']:.4g}{unit}"
    return check["name"], measured, f"{check['limit']:g}{unit}", check["about"]
