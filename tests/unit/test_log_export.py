"""Exports of a log, each read back by its own library, with the values of the log."""

from __future__ import annotations

import csv
import errno
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs_cli.errors import FAILED, USAGE
from gcs_cli.logs.export_mcap import export_mcap
from gcs_cli.logs.export_rerun import TIMELINE, entity_path, export_rerun
from gcs_cli.logs.export_tables import export_csv, export_parquet
from gcs_cli.logs.reader import read_log
from gcs_cli.logs.recording import Recording
from tests.support.commands import gcs
from tests.support.sample_logs import small_tlog, small_ulog


@pytest.fixture(scope="module", params=["flight.ulg", "gcs.tlog"])
def log(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("log") / request.param
    path.write_bytes(small_ulog() if path.suffix == ".ulg" else small_tlog())
    return read_log(path)


def test_csv_has_a_table_for_each_topic(log: Recording, tmp_path: Path) -> None:
    assert export_csv(log, tmp_path / "out", False) == len(list((tmp_path / "out").iterdir()))
    for topic in log.topics:
        with (tmp_path / "out" / f"{topic.name}.csv").open(newline="") as file:
            header, *rows = csv.reader(file)
        assert header == ["timestamp", *topic.fields]
        columns = dict(zip(header, zip(*rows, strict=True), strict=True))
        assert [int(text) for text in columns["timestamp"]] == topic.time_us.tolist()
        for name, values in topic.fields.items():
            if values.dtype.kind == "f":
                np.testing.assert_array_equal(np.array(columns[name], dtype=values.dtype), values)
            else:
                assert list(columns[name]) == [str(value) for value in values.tolist()]


def test_parquet_has_the_values_and_types_of_the_log(log: Recording, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export_parquet(log, tmp_path / "out", False)
    for topic in log.topics:
        table = parquet.read_table(tmp_path / "out" / f"{topic.name}.parquet")
        assert table.column_names == ["timestamp", *topic.fields]
        for name, values in topic.fields.items():
            column = table[name].to_numpy()
            np.testing.assert_array_equal(column, values)
            assert values.dtype.kind == "U" or column.dtype == values.dtype
    assert json.loads(table.schema.metadata[b"info"]) == json.loads(json.dumps(dict(log.info)))


def messages_of(path: Path) -> dict[str, list[tuple[int, str, Any]]]:
    """Return time, schema and content of the messages of each topic in an MCAP file."""
    reader = pytest.importorskip("mcap.reader")
    found: dict[str, list[tuple[int, str, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            assert json.loads(schema.data)["type"] == "object"
            entry = (message.log_time, schema.name, json.loads(message.data))
            found.setdefault(channel.topic, []).append(entry)
    return found


def test_mcap_has_every_sample_of_the_log(log: Recording, tmp_path: Path) -> None:
    count = export_mcap(log, tmp_path / "log.mcap")
    found = messages_of(tmp_path / "log.mcap")
    assert count == sum(map(len, found.values()))
    for topic in log.topics:
        messages = found[topic.name]
        assert [time for time, _, _ in messages] == [log.unix_ns(time) for time in topic.time_us.tolist()]
        for name, values in topic.fields.items():
            base, _, index = name.removesuffix("]").partition("[")
            for (_, _, content), value in zip(messages, values.tolist(), strict=True):
                got = content[base][int(index)] if index else content[base]
                assert got == (None if isinstance(value, float) and not math.isfinite(value) else value)


def test_mcap_has_poses_and_places_in_types_of_foxglove(log: Recording, tmp_path: Path) -> None:
    export_mcap(log, tmp_path / "log.mcap")
    found = messages_of(tmp_path / "log.mcap")
    schemas = {topic: messages[0][1] for topic, messages in found.items() if topic.startswith("/")}
    assert schemas == {
        "/tf": "foxglove.FrameTransform",
        "/path": "foxglove.SceneUpdate",
        "/location": "foxglove.LocationFix",
        "/texts": "foxglove.Log",
    }
    time_ns, _, transform = found["/tf"][-1]
    stamp = transform["timestamp"]
    assert stamp["sec"] * 1_000_000_000 + stamp["nsec"] == time_ns
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("map", "base_link")
    assert math.dist(transform["rotation"].values(), (0.0,) * 4) == pytest.approx(1.0, abs=1e-6)
    assert found["/location"][0][2]["latitude"] == pytest.approx(47.397742, abs=1e-5)


def test_rerun_recording_has_every_number_of_the_log(log: Recording, tmp_path: Path) -> None:
    chunks = pytest.importorskip("rerun.chunk")
    path = tmp_path / "log.rrd"
    export_rerun(log, path)
    found: dict[str, list[tuple[float, float]]] = {}
    entities = set()
    for chunk in chunks.RrdReader(path).stream():
        entities.add(chunk.entity_path)
        if chunk.is_static or TIMELINE not in chunk.timeline_names:
            continue
        batch = chunk.to_record_batch()
        scalars = next((name for name in batch.schema.names if "Scalars:scalars" in name), None)
        if scalars is not None:
            times = batch[batch.schema.names.index(TIMELINE)].cast("int64").to_pylist()
            values = [row[0] for row in batch[batch.schema.names.index(scalars)].to_pylist()]
            found.setdefault(chunk.entity_path, []).extend(zip(times, values, strict=True))
    assert {"/world/vehicle", "/world/path", "/map/vehicle", "/texts"} <= entities
    for topic in log.topics:
        for name, values in topic.fields.items():
            if values.dtype.kind in "biuf":
                times, numbers = zip(*sorted(found[f"/{entity_path(topic.name, name)}"]), strict=True)
                expected = (topic.time_us - log.start_us) * 1000
                np.testing.assert_array_equal(sorted(times), np.sort(expected))
                np.testing.assert_array_equal(np.sort(numbers), np.sort(values.astype(np.float64)))


def test_an_interrupted_export_leaves_nothing(
    log: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gcs_cli.logs.export_tables.csv.writer", interrupt)
    monkeypatch.setattr("gcs_cli.logs.export_mcap.json.dumps", interrupt)
    with pytest.raises(KeyboardInterrupt):
        export_csv(log, tmp_path / "out", False)
    with pytest.raises(KeyboardInterrupt):
        export_mcap(log, tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_a_write_error_names_the_given_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, out = tmp_path / "a.tlog", tmp_path / "out"
    log.write_bytes(small_tlog())

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    def read_only(path: Path, *_: object, **__: object) -> None:
        if path.parent == tmp_path:
            raise OSError(errno.EROFS, "Read-only file system", str(path))

    with monkeypatch.context() as patch:
        patch.setattr("gcs_cli.logs.export_tables.csv.writer", full)
        expected = f"gcs: {out}: No space left on device\n"
        assert gcs("log", "export", log, "--csv", out) == ("", expected, FAILED)
    monkeypatch.setattr("pathlib.Path.mkdir", read_only)
    expected = f"gcs: {out}: Read-only file system\n"
    assert gcs("log", "export", log, "--csv", out) == ("", expected, FAILED)


def test_a_recording_that_rerun_cannot_write_is_named(
    log: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rerun = pytest.importorskip("rerun")

    def fail(_: object) -> None:
        raise RuntimeError("the writer ended")

    monkeypatch.setattr(rerun.RecordingStream, "flush", fail)
    with pytest.raises(OSError, match="cannot be written: the writer ended") as raised:
        export_rerun(log, tmp_path / "log.rrd")
    assert raised.value.filename == str(tmp_path / "log.rrd")


def test_existing_exports_are_kept_without_overwrite(tmp_path: Path) -> None:
    log = tmp_path / "a.tlog"
    log.write_bytes(small_tlog())
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.csv").write_text("1")
    (tmp_path / "a.mcap").write_text("1")
    for option, name in (("--csv", "out"), ("--mcap", "a.mcap")):
        ended = gcs("log", "export", log, option, tmp_path / name)
        assert (ended.returncode, "--overwrite" in ended.stderr) == (USAGE, True)
    assert gcs("log", "export", log, "--csv", tmp_path / "out", "--overwrite").returncode == 0
    assert (tmp_path / "out" / "mine.csv").read_text() == "1"
    assert (tmp_path / "out" / "ATTITUDE.csv").is_file()


@pytest.mark.parametrize(
    ("option", "module", "package"),
    [("--parquet", "pyarrow", "pyarrow"), ("--mcap", "mcap", "mcap"), ("--rerun", "rerun", "rerun-sdk")],
)
def test_a_missing_library_is_one_sentence(
    option: str, module: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (module, *(name for name in sys.modules if name.startswith(f"{module}."))):
        monkeypatch.setitem(sys.modules, name, None)  # as one that cannot be found
    log = tmp_path / "a.tlog"
    log.write_bytes(small_tlog())
    ended = gcs("log", "export", log, option, tmp_path / "out")
    said = f"gcs: this format needs {package}: pip install 'flightstack[export]'\n"
    assert (ended.returncode, ended.stderr) == (USAGE, said)
    assert [path.name for path in tmp_path.iterdir()] == ["a.tlog"]
