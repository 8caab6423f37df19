"""The configuration file of ``gcs`` and the order of options, environment and file."""

from __future__ import annotations

from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from gcs_cli.config_file import Config, load_config
from gcs_cli.link.endpoint import parse_endpoint, vehicle_connection
from gcs_cli.settings import LinkOptions, completed
from tests.support.commands import gcs


def write(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = folder / "config.toml"
    path.write_text(text)
    monkeypatch.setenv("GCS_CONFIG", str(path))
    return path


def test_config_holds_link_timeout_system_and_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(
        tmp_path,
        'connect = "tcp:10.0.0.1:5760"\ntimeout = 2\nsystem = 3\nsigning_key = "my.key"\n',
        monkeypatch,
    )
    assert load_config() == Config("tcp:10.0.0.1:5760", 2, 3, tmp_path / "my.key")


def test_config_is_found_in_the_xdg_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GCS_CONFIG", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert load_config() == Config()
    (tmp_path / "gcs").mkdir()
    (tmp_path / "gcs" / "config.toml").write_text("timeout = 1.5\n")
    assert load_config() == Config(timeout=1.5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("conect = 'tcp:1'", "conect: is no setting; settings are connect, timeout, system, signing_key"),
        ("connect = 14550", "connect: 14550 is not a text in quotes"),
        ("timeout = 'long'", "timeout: 'long' is not a number from 0.1 to 86400 s"),
        ("timeout = 0", "timeout: 0 is not a number from 0.1 to 86400 s"),
        ("system = 0", "system: 0 is not a system id, 1 to 255"),
        ("system = 1.5", "system: 1.5 is not a system id, 1 to 255"),
        ("system = true", "system: True is not a system id, 1 to 255"),
        ("signing_key = 1", "signing_key: 1 is not a text in quotes"),
        ("connect", "is no TOML: "),
    ],
)
def test_bad_config_is_one_sentence_and_exit_code_2(
    text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, text, monkeypatch)
    result = gcs("status")
    assert (result.stdout, result.returncode, result.stderr.count("\n")) == ("", 2, 1)
    assert result.stderr.startswith(f"gcs: {path}: {said}")


def test_named_config_must_exist(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GCS_CONFIG", str(tmp_path / "none.toml"))
    with pytest.raises(ConfigError, match="no such file; GCS_CONFIG names it"):
        load_config()


def test_options_precede_environment_and_file() -> None:
    file = Config("tcp:file:1", 2.0, 3)
    assert completed(LinkOptions("tcp:option:1", 1.0, None, 4), "tcp:env:1", file) == LinkOptions(
        "tcp:option:1", 1.0, None, 4
    )
    assert completed(LinkOptions(), "tcp:env:1", file) == LinkOptions("tcp:env:1", 2.0, None, 3)
    assert completed(LinkOptions(), None, file) == LinkOptions("tcp:file:1", 2.0, None, 3)
    assert completed(LinkOptions(), None, Config()) == LinkOptions()


def test_instance_is_an_address_of_its_own() -> None:
    link = completed(LinkOptions(instance=2), "tcp:env:1", Config("tcp:file:1", None, 7))
    assert (link.endpoint, link.system_id) == (parse_endpoint(vehicle_connection(2)), 3)
