"""C text: names, comments in ASCII, and lines of limited width."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterable

WIDTH = 118
_ASCII = {
    "²": "^2", "³": "^3", "−": "-", "–": "-", "…": "to", "ẋ_d": "x_d'", "ẍ_d": "x_d''", "⊗": "(x)", "×": "x", "·": "*",
    "√": "sqrt", "±": "+-", "≤": "<=", "≥": ">=", "→": "->", "°": " deg", "Σ": "sum ", "ẋ": "x'", "ẍ": "x''", "⁴": "^4",
    "∈": "in", "‖": "|", "∞": "inf", "ᵀ": "'",
}  # fmt: skip
RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false NULL asm fs_real int16_t int32_t uint16_t uint32_t near far interrupt main rotors abort abs acos
    acosh alloca asin asinh atan atan2 atanh calloc cbrt ceil conj copysign cos cosh creal div erf erfc exit exp
    exp2 expm1 fabs fdim ffs floor fma fmax fmin fmod free frexp gamma hypot ilogb index isinf isnan isfinite j0 j1
    jn labs ldexp lgamma log log10 log1p log2 logb malloc memcmp memcpy memmove memset modf nan nearbyint pow printf
    puts remainder remquo rindex rint round scalb scalbn signbit significand sin sincos sinh sqrt tan tanh tgamma
    toascii trunc y0 y1 yn
    """.split()  # noqa: SIM905  # a list of names
)
"""Keywords of C and its compilers, and functions that compilers know."""


_START = re.compile(r"(return |[^=;(]* [-+*/]?= )")
"""Beginning of a statement, to the end of which an expression is aligned."""
_FARTHEST = 64
"""Column up to which lines are aligned."""
_BREAKS = {",": 0, "&": 1, "|": 0, "?": 3, ":": 3, "+": 4, "-": 4, "*": 7, "/": 7, "=": 9}
"""Cost of a break after a sign."""


def snake_case(name: str) -> str:
    """Return ``name`` as C writes it: words in lower case, joined by underscores."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", identifier(name)).lower()


def identifier(name: str) -> str:
    """Return a Python name as a C identifier in ASCII."""
    text = re.sub(r"\W", "_", ascii_text(name))
    return f"{text}_" if text in RESERVED else text


def ascii_text(text: str) -> str:
    """Return ``text`` in ASCII; Greek letters become their names."""
    for sign, written in _ASCII.items():
        text = text.replace(sign, written)
    return "".join(sign if sign.isascii() else _spelled(sign) for sign in text)


def _spelled(sign: str) -> str:
    words = unicodedata.name(sign, "?").split()
    if words[0] != "GREEK":
        plain = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode()
        return plain or "?"
    return words[-1].capitalize() if "CAPITAL" in words else words[-1].lower()


def comment(text: str, indent: str = "") -> list[str]:
    """Return a comment, folded; reStructuredText's double backquotes are left out."""
    text = ascii_text(text).replace("``", "").replace("*/", "* /").replace("/*", "/ *").strip()
    if not text:
        return []
    if "\n" not in text and len(indent) + len(text) + 6 <= WIDTH:
        return [f"{indent}/* {text} */"]
    lines = [f"{indent}/*"]
    for paragraph in text.split("\n\n"):
        words = " ".join(paragraph.split())
        if len(lines) > 1:
            lines.append(f"{indent} *")
        lines += [f"{indent} * {line}" for line in textwrap.wrap(words, WIDTH - len(indent) - 3)]
    return [*lines, f"{indent} */"]


def fold(text: str, indent: str = "") -> list[str]:
    """Return a statement in lines of at most ``WIDTH`` characters; continuation lines are aligned to their bracket."""
    lines, lead = [], indent
    start = _START.match(text)
    columns = [len(indent) + (start.end() if start else 4)]
    while len(lead) + len(text) > WIDTH:
        at = _break(text, WIDTH - len(lead))
        if at is None:
            break
        lines.append(lead + text[:at])
        for column, sign in enumerate(lines[-1][len(lead) :], start=len(lead) + 1):
            if sign in "([{":
                columns.append(column)
            elif sign in ")]}":
                columns.pop()
        is_far = columns[-1] > _FARTHEST
        text, lead = text[at + 1 :], " " * (len(indent) + 8 if is_far else columns[-1])
    return [*lines, lead + text]


def _break(text: str, width: int) -> int | None:
    """Return the best space to break at: at the least depth of brackets, then after a comma or a sum."""
    depth, found, least = 0, None, 1000
    for at, sign in enumerate(text[: width + 1]):
        depth += (sign in "([{") - (sign in ")]}")
        cost = _BREAKS.get(text[at - 1]) if sign == " " and at > width // 3 else None
        if cost is not None and depth * 10 + cost <= least:
            found, least = at, depth * 10 + cost
    return found


def indented(lines: Iterable[str], by: str = "    ") -> list[str]:
    """Return lines with an indentation."""
    return [by + line if line else line for line in lines]
