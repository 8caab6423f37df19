"""What a process prints, and where it cannot."""

from __future__ import annotations

import io
import sys

import pytest

from flightstack import console


class Output(io.TextIOWrapper):
    """Stands for stdout that can encode Latin-1 only."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), encoding="latin-1")

    def written(self) -> bytes:
        assert isinstance(self.buffer, io.BytesIO)
        return self.buffer.getvalue()


def test_an_unencodable_character_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    monkeypatch.setattr(sys, "stdout", output)
    console.replace_unencodable()
    assert console.say("yaw ψ = 30°") is None
    assert console.say("next line") is None
    assert output.written() == b"yaw ? = 30\xb0\nnext line\n"


def test_an_encoding_error_does_not_drop_the_output(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    monkeypatch.setattr(sys, "stdout", output)
    monkeypatch.setattr(console, "drop", lambda _: pytest.fail("the output is dropped"))
    with pytest.raises(UnicodeEncodeError):
        console.say("ψ")
    assert console.say("next line") is None
    assert output.written() == b"next line\n"


def test_a_closed_output_is_an_error_that_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    output = Output()
    output.close()
    monkeypatch.setattr(sys, "stdout", output)
    assert isinstance(console.say("line"), ValueError)
