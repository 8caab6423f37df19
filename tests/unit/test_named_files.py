"""Names of built-in vehicles and gains, and files of the same name in the working directory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.params.gains_file import hidden_gains, open_gains
from flightstack.params.vehicle import BUILT_IN, hidden_vehicle, load_vehicle


@pytest.fixture(autouse=True)
def _in_an_empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def own_vehicle(name: str) -> None:
    text = (BUILT_IN / "x_quad.toml").read_text()
    Path(name).write_text(text.replace('name = "x_quad"', 'name = "mine"'))


def test_a_file_does_not_shadow_a_built_in_vehicle_or_gains() -> None:
    own_vehicle("x_quad")
    Path("tuned").write_text("not TOML at all")
    assert load_vehicle("x_quad").name == "x_quad"
    assert open_gains("tuned").has("position")


@pytest.mark.parametrize("name", ["./x_quad", "./x_quad.toml", "x_quad.toml", "./fleet/x_quad"])
def test_a_path_means_the_file(name: str) -> None:
    Path("fleet").mkdir()
    own_vehicle(name)
    assert load_vehicle(name).name == "mine"


@pytest.mark.parametrize(("name", "hidden"), [("x_quad", hidden_vehicle), ("tuned", hidden_gains)])
def test_a_hidden_file_is_named(name: str, hidden: Callable[[str], str | None]) -> None:
    assert hidden(name) is None
    Path(name).mkdir()
    assert hidden(name) is None
    Path(name).rmdir()
    Path(name).write_text("")
    sentence = hidden(name)
    assert sentence is not None
    assert f"to use the file give ./{name}" in sentence
    assert hidden(f"./{name}") is None


def test_a_plain_name_of_a_file_is_refused_with_its_path() -> None:
    own_vehicle("mine")
    with pytest.raises(ConfigError, match=r"^mine: is not a built-in vehicle .* give \./mine$"):
        load_vehicle("mine")
