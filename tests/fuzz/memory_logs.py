"""Flight logs in memory, as the vehicle's link services see them."""

from __future__ import annotations

from flightstack.mavlink.files import BytesFile, VirtualFile
from flightstack.services.logs.log_store import LogInfo


class MemoryLogs:
    """Logs of these sizes; the last one is being written, and stays when the others are erased."""

    def __init__(self, *sizes: int) -> None:
        self._content = {f"{n:02}.ulg": bytes(i % 251 for i in range(size)) for n, size in enumerate(sizes)}

    def logs(self) -> list[LogInfo]:
        return [LogInfo(name, len(data), 1_750_000_000) for name, data in self._content.items()]

    def open(self, name: str) -> VirtualFile | None:
        data = self._content.get(name)
        return None if data is None else BytesFile(data)

    def open_tail(self) -> None:
        return

    def erase(self) -> int:
        gone = list(self._content)[:-1]
        for name in gone:
            del self._content[name]
        return len(gone)
