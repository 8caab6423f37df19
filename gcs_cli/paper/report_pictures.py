"""Pictures of the multibody vehicle in flight for the report, drawn by ``sim-bridge render`` where it can be."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from gcs_cli.paper.report_labels import anchored
from gcs_cli.report_plots import section


class Picture(NamedTuple):
    """A picture, or the sentence why there is none."""

    caption: str
    data_uri: str
    """Empty: there is no picture, and the caption says why."""


def pictures_section(pictures: Sequence[Picture]) -> str:
    """Return the pictures; empty if none was asked for."""
    if not pictures:
        return ""
    drawn = "".join(
        f'<figure><img alt="{escape(one.caption)}" src="{escape(one.data_uri)}">'
        f"<figcaption>{escape(one.caption)}</figcaption></figure>"
        for one in pictures
        if one.data_uri
    )
    missing = "".join(f'<p class="none">{escape(one.caption)}</p>' for one in pictures if not one.data_uri)
    return anchored(
        "pictures", section("The vehicle in flight", f'<div class="pictures">{drawn}</div>{missing}')
    )
