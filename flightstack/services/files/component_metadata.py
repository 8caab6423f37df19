"""Component metadata files, and the message with their URI.

https://mavlink.io/en/services/component_metadata.html. The paths are those of PX4.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Callable
from functools import lru_cache

from flightstack.mavlink import text_file
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import Content, FileTree, fixed
from flightstack.mavlink.ftp_messages import mavlink_crc32
from flightstack.mavlink.link import Message
from flightstack.services.logs.log_store import DatedLogs, FlatLogs, LogStore

FOLDER = "etc/extras"
GENERAL = f"{FOLDER}/component_general.json"
PARAMETERS = f"{FOLDER}/parameters.json"
PARAMETER_PACK = "@PARAM/param.pck"
"""Path at which clients of ArduPilot read all parameters at once."""
LOGS_FLAT = "@MAV_LOG"
LOGS_DATED = "fs/microsd/log"
_PARAMETER_TYPE = 1  # COMP_METADATA_TYPE_PARAMETER
_MAX_BOOT_MS = 0xFFFF_FFFF


class ComponentMetadata:
    """The metadata files of one component, which do not change after the start.

    ``parameters_json`` is the parameter metadata (COMP_METADATA_TYPE_PARAMETER) as text; ``version`` is
    major.minor.patch.
    """

    def __init__(self, parameters_json: str, vendor: str, model: str, version: str) -> None:
        parameters = parameters_json.encode()
        packed_parameters = _compressed(parameters)
        general = json.dumps(
            {
                "version": 1,
                "vendorName": vendor,
                "modelName": model,
                "firmwareVersion": version,
                "metadataTypes": [
                    {
                        "type": _PARAMETER_TYPE,
                        "uri": f"mftp:///{PARAMETERS}.xz",
                        "fileCrc": mavlink_crc32(packed_parameters),
                        "uriFallback": f"mftp:///{PARAMETERS}",
                        "fileCrcFallback": mavlink_crc32(parameters),
                    }
                ],
            }
        ).encode()
        packed_general = _compressed(general)
        self.files: dict[str, Content] = {
            GENERAL: fixed(general),
            f"{GENERAL}.xz": fixed(packed_general),
            PARAMETERS: fixed(parameters),
            f"{PARAMETERS}.xz": fixed(packed_parameters),
        }
        self._crc = mavlink_crc32(packed_general)

    def message(self, boot_ms: int) -> Message:
        """Return COMPONENT_METADATA; ``boot_ms`` is vehicle time."""
        return component_metadata_message(boot_ms, self._crc, f"mftp:///{GENERAL}.xz")


@lru_cache(maxsize=4)
def _compressed(content: bytes) -> bytes:
    """Return ``content`` as .xz with CRC32, the checksum that every decoder supports. Kept: it takes milliseconds."""
    return lzma.compress(content, check=lzma.CHECK_CRC32, preset=1)


def component_metadata_message(boot_ms: int, file_crc: int, uri: str) -> Message:
    """Return COMPONENT_METADATA for the general metadata file at ``uri``."""
    return mavlink.MAVLink_component_metadata_message(boot_ms & _MAX_BOOT_MS, file_crc, uri.encode())


def vehicle_files(
    metadata: ComponentMetadata | None,
    parameter_pack: Callable[[str], bytes | None] | None,
    logs: LogStore,
    texts: Callable[[], bytes] = bytes,
) -> FileTree:
    """Return the files that a vehicle serves over MAVLink FTP.

    ``parameter_pack`` returns ``@PARAM/param.pck`` for the arguments after its "?". If it is None, the file does not
    exist, and clients read the parameters one by one. ``texts`` returns the file of past status texts.
    """
    files = {} if metadata is None else dict(metadata.files)
    if parameter_pack is not None:
        files[PARAMETER_PACK] = parameter_pack
    files[text_file.PATH] = lambda arguments: None if arguments else texts()
    return FileTree(files, {LOGS_FLAT: FlatLogs(logs), LOGS_DATED: DatedLogs(logs)})
