"""Make mutants of C text: copies with one small fault each, of the kinds that people make and reviews miss."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

TOKEN = re.compile(
    r"""
    (?P<skip>/\*.*?\*/ | //[^\n]* | "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])*' | ^[ \t]*\#[ \t]*(?!define)[^\n]*)
  | (?P<real>(?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?F? | \d+[eE][-+]?\d+F?)
  | (?P<whole>(?:0[xX][0-9a-fA-F]+|\d+)(?:UL|U)?)(?![\w.])
  | (?P<word>[A-Za-z_]\w*)
  | (?P<operator>->|\+\+|--|<<=|>>=|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/&|^]=|[-+*/&|^<>!=?:~.,;(){}\[\]\#])
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
OPERATORS = {
    **{
        "+": ["-"],
        "-": ["+"],
        "*": ["/"],
        "/": ["*"],
        "+=": ["-="],
        "-=": ["+="],
        "*=": ["/="],
        "++": ["--"],
        "--": ["++"],
    },
    **{"<": ["<=", ">"], ">": [">=", "<"], "<=": ["<"], ">=": [">"], "==": ["!="], "!=": ["=="]},
    **{"&&": ["||"], "||": ["&&"], "&": ["|"], "|": ["&"], "^": ["|"], "<<": [">>"], ">>": ["<<"]},
}
UNARY = {"-": "", "!": "", "~": ""}
WORDS = {
    **{"fs_min": "fs_max", "fs_max": "fs_min", "fs_abs": "", "low": "high", "high": "low"},
    **{"sine": "cosine", "cosine": "sine", "sine_of_small": "", "least": "most", "most": "least"},
    **{
        "min_thrust_n": "max_thrust_n",
        "max_thrust_n": "min_thrust_n",
        "roll": "pitch",
        "pitch": "yaw",
        "yaw": "roll",
    },
    **{
        "inner_hz": "outer_hz",
        "inner_dt_s": "outer_dt_s",
        "outer_dt_s": "inner_dt_s",
        "outer": "inner",
        "inner": "mixer",
    },
    **{
        "forward": "right",
        "right": "forward",
        "last_target": "target",
        "attitude": "",
        "demanded": "achieved",
    },
    **{"system": "component", "component": "sequence", "sequence": "system", "good": "bad", "bad": "unknown"},
    **{"unknown": "skipped", "header": "size", "count": "needed", "needed": "count", "length": "crc_extra"},
    **{"uint32_t": "uint16_t", "int32_t": "int16_t"},
    **{
        "fs_put_u16": "fs_put_octet",
        "fs_put_u32": "fs_put_u16",
        "fs_get_u16": "fs_get_octet",
        "fs_get_u32": "fs_get_u16",
    },
}
"""Names taken for one another; without a second name the word takes part in nothing."""
MEMBERS = {
    **{
        "x": "y",
        "y": "z",
        "z": "x",
        "w": "x",
        "p_rad_s": "q_rad_s",
        "q_rad_s": "r_rad_s",
        "r_rad_s": "p_rad_s",
    },
    **{"kp_xy": "kp_z", "kp_z": "kd_z", "kd_xy": "kp_xy", "kd_z": "ki_z", "ki_xy": "ki_z", "ki_z": "kp_z"},
    **{"c1": "c2", "c2": "c1", "c3": "c4", "c4": "c3", "c5": "c6", "c6": "c5"},
    **{
        "kp_roll": "ki_roll",
        "ki_roll": "kd_roll",
        "kd_roll": "kp_roll",
        "kp_pitch": "kp_roll",
        "kd_yaw": "kd_pitch",
    },
    **{"ix_kg_m2": "iy_kg_m2", "iy_kg_m2": "iz_kg_m2", "iz_kg_m2": "ix_kg_m2"},
    **{"position_ned_m": "velocity_ned_m_s", "velocity_ned_m_s": "position_ned_m"},
    **{"rate_feedforward": "acceleration_feedforward", "acceleration_feedforward": "rate_feedforward"},
}
"""Members of structures, swapped behind ``.`` and ``->`` only."""
A_TYPE = re.compile(r"(?:const|void|char|float|fs_[a-z_0-9]+|u?int\d+_t)$")
AFTER_OPERAND = re.compile(r"[\w)\]]")
ONE_STATEMENT = re.compile(
    r"^[ \t]+(?!return\b|static\b|const\b|typedef\b)[\w*][^;{}\n]*;(?=[ \t]*(?:/\*.*\*/)?[ \t]*$)", re.M
)
FUNCTION = re.compile(r"^\w[\w \t*]*?(\w+)\(", re.M)
DECLARATION = re.compile(r"\s*(?:const |static )?(?:fs_\w+|u?int\d+_t|float|char|void)\s+\*?\w+(?:\[|,|;| =)")


class Mutant(NamedTuple):
    """One fault: ``after`` instead of ``before`` at ``start``."""

    file: str
    start: int
    line: int
    kind: str
    before: str
    after: str
    function: str
    """Its name, or that of the last one before it; empty before the first."""
    key: str
    """Differs for each mutant, and for each version of the file's text."""

    def applied(self, text: str) -> str:
        """Return the text with the fault; ValueError when the text is another one."""
        end = self.start + len(self.before)
        if text[self.start : end] != self.before:
            raise ValueError(f"{self.file}:{self.line} is not as it was")
        return text[: self.start] + self.after + text[end:]

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.kind}: {self.before.strip()!r} -> {self.after.strip()!r}"


def mutants(file: str, text: str) -> Iterator[Mutant]:
    """Yield all mutants of a C file, in the order of the text. What is only for a host's double stays as it is."""
    unused = (
        {"name", "width", "statement"} if file.endswith(".h") else set()
    )  # a header is declarations, mostly
    names = [(found.start(), found[1]) for found in FUNCTION.finditer(text)]
    version = hashlib.sha256(text.encode()).hexdigest()[:8]
    for start, kind, before, after in sorted({*_of_tokens(text), *_of_statements(text)}):
        if kind not in unused and not any(first <= start < last for first, last in _double_parts(text)):
            function = next((name for at, name in reversed(names) if at <= start), "")
            key = f"{file} {version} {start} {kind} {after}"
            yield Mutant(file, start, text.count("\n", 0, start) + 1, kind, before, after, function, key)


def _of_tokens(text: str) -> Iterator[tuple[int, str, str, str]]:
    previous = ""
    for found in TOKEN.finditer(text):
        token, at, group = found[0], found.start(), found.lastgroup
        if group == "skip":
            continue
        if group == "real":
            yield at, "constant", token, one_ulp_more(token)
        elif group == "whole" and previous != "#":
            yield at, "constant", token, one_more(token)
        elif group == "word":
            if previous in {".", "->"} and MEMBERS.get(token):
                yield at, "field", token, MEMBERS[token]
            elif WORDS.get(token):
                yield at, "width" if token.endswith("_t") else "name", token, WORDS[token]
        elif A_TYPE.match(previous):
            pass  # a pointer's star
        elif AFTER_OPERAND.match(previous[-1:]):
            for other in OPERATORS.get(token, []):
                yield at, "operator", token, other
        elif token in UNARY:
            yield at, "operator", token, UNARY[token]
        previous = token


def _of_statements(text: str) -> Iterator[tuple[int, str, str, str]]:
    for found in ONE_STATEMENT.finditer(text):
        if not DECLARATION.match(found[0]):
            yield found.start(), "statement", found[0], re.sub(r"\S.*;$", ";", found[0])


def _double_parts(text: str) -> list[tuple[int, int]]:
    return [
        found.span()
        for found in re.finditer(
            r"#if(?:def FS_DOUBLE|.*FS_DOUBLE).*?(?=#else|#elif|#endif)", text, re.DOTALL
        )
    ]


def one_ulp_more(literal: str) -> str:
    """Return the next float32; 1 for 0, and the one before for the largest."""
    suffix = "F" if literal.endswith("F") else ""
    largest = np.finfo(np.float32).max
    value = np.float32(min(float(literal.removesuffix("F")), float(largest)))
    towards = np.float32(0.0) if value == largest else largest
    more = np.float32(1.0) if value == 0.0 else np.nextafter(value, towards)
    written = f"{float(more):.17g}"
    return (written if "." in written or "e" in written else written + ".0") + suffix


def one_more(literal: str) -> str:
    """Return the next whole number, with the same suffix."""
    digits = literal.rstrip("UL")
    base = 16 if digits.lower().startswith("0x") else 10
    more = int(digits, base) + 1
    return (f"0x{more:X}" if base == 16 else str(more)) + literal[len(digits) :]
