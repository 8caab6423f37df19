"""Fold STATUSTEXT into a ``VehicleView``: the pieces of a long text are joined. Pure."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.fields import clean
from gcs_cli.vehicle.view_types import TEXTS_KEPT, Changes, PartialText, StatusText, VehicleView, view_with

PIECE_BYTES = 50
"""A piece of fewer bytes ends a text (MAVLink, STATUSTEXT.chunk_seq)."""
PIECE_TIMEOUT_S = 0.25
"""Time after which a text is shown without lost pieces."""
_LONGEST_BYTES = 500


def add_piece(view: VehicleView, message: Any, now_s: float) -> Changes:
    """Return the changes of ``view`` after a STATUSTEXT."""
    octets = message._text_raw.partition(b"\0")[0]  # pymavlink decodes ASCII, but vehicles send UTF-8
    before = view.partial_text
    shown: Changes = {}
    if before and (message.id, message.chunk_seq) == (before.message_id, before.pieces):
        joined = (before.octets + octets)[:_LONGEST_BYTES]
        partial = before._replace(octets=joined, pieces=before.pieces + 1)
    else:
        shown = _shown(view)
        partial = PartialText(message.id, message.severity, octets, 1, now_s, view.time_s)
    changes = {**shown, "partial_text": partial}
    is_last = not message.id or len(octets) < PIECE_BYTES
    return {**changes, **_shown(view_with(view, changes))} if is_last else changes


def without_stale_piece(view: VehicleView, now_s: float) -> Changes:
    """Return the changes of ``view`` if it has an incomplete text whose other pieces are late."""
    partial = view.partial_text
    stale = partial is not None and now_s - partial.received_s > PIECE_TIMEOUT_S
    return _shown(view) if stale else {}


def _shown(view: VehicleView) -> Changes:
    partial = view.partial_text
    if partial is None:
        return {}
    text = clean(partial.octets.decode("utf-8", "replace")).rstrip()  # PX4 ends some texts with a tab
    entry = StatusText(view.text_count, partial.severity, text, partial.received_s, partial.vehicle_time_s)
    texts = (*view.texts, entry)[-TEXTS_KEPT:]
    return {"texts": texts, "text_count": view.text_count + 1, "partial_text": None}
