"""A number on the command line that means nothing is refused before a vehicle is searched or a file is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.commands import gcs


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("speed -5", "speed: -5 is outside the allowed range 0.1 to 100, -2 is the default"),
        ("speed -1", "speed: -1 is outside"),
        ("speed 0", "speed: 0 is outside"),
        ("speed nan", "speed: nan is outside"),
        ("speed inf", "speed: inf is outside"),
        ("yaw -10", "heading: -10 is outside the allowed range 0 to 360"),
        ("set-home 91 8 400", "latitude: 91 is outside the allowed range -90 to 90"),
        ("set-home 47 -181 400", "longitude: -181 is outside the allowed range -180 to 180"),
        ("set-home 47 8 nan", "altitude: nan is outside the allowed range -20000 to 20000"),
        ("mission new circle --size inf", "--size: inf is outside the allowed range 0.1 to 100000"),
        ("mission new survey --spacing inf", "--spacing: inf is outside"),
        ("mission new survey --angle nan", "--angle: nan is outside the allowed range -360 to 360"),
        ("log plot a.ulg field --from nan", "--from: nan is outside the allowed range 0 to 10000000"),
        ("log plot a.ulg field --to -1", "--to: -1 is outside"),
        ("replay a.ulg --from inf", "--from: inf is outside"),
    ],
)
def test_a_number_outside_its_range_is_refused(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = gcs(*words.split())
    assert (ended.stdout, ended.returncode) == ("", 2)
    assert ended.stderr.startswith(f"gcs: {said}")
    assert ended.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
