"""Component metadata: the files hang together, and follow the general schema of mavlink/component_metadata."""

from __future__ import annotations

import json
import lzma
import re

from flightstack import __version__
from flightstack.mavlink.files import FileTree
from flightstack.mavlink.ftp_messages import mavlink_crc32
from flightstack.mavlink.link import Link
from flightstack.services.files.component_metadata import ComponentMetadata, vehicle_files
from flightstack.services.logs.log_store import NoLogs

PARAMETERS = json.dumps({"version": 1, "parameters": [{"name": "MIS_TAKEOFF_ALT", "type": "Float"}]})
METADATA = ComponentMetadata(PARAMETERS, "flightstack", "quadcopter", __version__)


def read(tree: FileTree, uri: str) -> bytes:
    file = tree.open(uri.removeprefix("mftp://"))
    assert file is not None, uri
    return file.read(0, file.size)


def test_from_the_message_to_the_parameters() -> None:
    tree = vehicle_files(METADATA, None, NoLogs())
    (message,) = Link(255, 190).decode(Link(1, 1).encode(METADATA.message(1234)))
    assert message.time_boot_ms == 1234
    packed = read(tree, message.uri)
    assert mavlink_crc32(packed) == message.file_crc
    general = json.loads(lzma.decompress(packed))
    (parameters,) = general["metadataTypes"]
    content = read(tree, parameters["uri"])
    assert mavlink_crc32(content) == parameters["fileCrc"]
    assert lzma.decompress(content).decode() == PARAMETERS
    fallback = read(tree, parameters["uriFallback"])
    assert mavlink_crc32(fallback) == parameters["fileCrcFallback"]
    assert fallback.decode() == PARAMETERS


def test_the_general_file_follows_its_schema() -> None:
    general = json.loads(read(vehicle_files(METADATA, None, NoLogs()), "/etc/extras/component_general.json"))
    assert set(general) == {"version", "vendorName", "modelName", "firmwareVersion", "metadataTypes"}
    assert general["version"] == 1
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
    assert {type(entry["type"]) for entry in general["metadataTypes"]} == {int}


def test_the_same_vehicle_always_says_the_same() -> None:
    again = ComponentMetadata(PARAMETERS, "flightstack", "quadcopter", __version__)
    assert again.message(0).file_crc == METADATA.message(0).file_crc
    other = ComponentMetadata(PARAMETERS + " ", "flightstack", "quadcopter", __version__)
    assert other.message(0).file_crc != METADATA.message(0).file_crc


def test_a_boot_time_of_years_wraps() -> None:
    assert METADATA.message(2**32 + 5).time_boot_ms == 5


def test_without_a_pack_of_parameters_there_is_none() -> None:
    assert vehicle_files(METADATA, None, NoLogs()).open("@PARAM/param.pck") is None
    packed = vehicle_files(METADATA, lambda arguments: b"pack", NoLogs()).open("/@PARAM/param.pck")
    assert packed is not None
    assert packed.size == 4
