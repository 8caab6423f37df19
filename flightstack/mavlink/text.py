"""Texts from a link, made fit to be shown on a terminal and written to files. Pure."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink

REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def clean(text: str) -> str:
    """Return ``text`` on one line, with nothing in it that a terminal obeys or that hides other characters.

    White space of any kind is a space. Other characters that are not printable (control characters of C0 and C1,
    escape, marks of text direction, lone surrogates) are replaced by U+FFFD.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else REPLACEMENT for c in text)


def clean_fields(message: mavlink.MAVLink_message) -> None:
    """Clean the texts of a decoded message; its frame and the octets of its texts stay as they are."""
    kind = type(message)
    fields = _FIELDS.get(kind)
    if fields is None:
        fields = _FIELDS[kind] = _text_fields(kind)
    for name in fields:
        setattr(message, name, clean(getattr(message, name)))


_FIELDS: dict[type, tuple[str, ...]] = {}
"""Names of the text fields, by the class of the message."""


def _text_fields(kind: type[mavlink.MAVLink_message]) -> tuple[str, ...]:
    fields = zip(kind.fieldnames, kind.fieldtypes, strict=True)
    return tuple(str(name) for name, type_name in fields if type_name == "char")
