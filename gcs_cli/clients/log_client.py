"""Client of the log protocol, sans-IO: lists a vehicle's logs, downloads one, and erases all.

``start_…`` begins an operation, ``poll`` returns the messages to send, ``receive`` processes received ones, and
``result`` is the result at the end.

A list of n logs is complete when n entries have come: ArduPilot counts ids from 1 with last_log_num = n, we from 0 with
last_log_num = n - 1, and PX4 from 0 with last_log_num = n, an id that it does not have.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import MAX_SIZE, PartialFile
from flightstack.mavlink.link import Address, Message, is_from
from flightstack.mavlink.log_messages import BLOCK, log_data

RETRY_S = 0.4
"""Time without messages after which missing data is requested again."""
SILENCE_S = 6.0
"""Longest time without progress before an operation fails."""
WINDOW = 4000 * BLOCK
"""Size of a request."""
FEW = 40
"""Number of missing blocks above which one request covers them and the blocks between them."""
MAX_REQUESTS = 20
ALL_LOGS = 0xFFFF
ERASE_RETRY_S = 1.0
"""Time after which LOG_ERASE is repeated; it has no acknowledgement, and a vehicle may erase for seconds."""
ERASE_TRIES = 3
ERASE_ANSWERS = 3
"""Number of answers to TIMESYNC after which silence about the list confirms an erase: the vehicle has no logs."""


class LogEntry(NamedTuple):
    """One log of the vehicle."""

    log_id: int
    size: int
    time_utc_s: int
    """Seconds since 1970; 0 if unknown."""


class LogDone(NamedTuple):
    """The operation succeeded."""

    entries: tuple[LogEntry, ...] = ()
    content: bytes = b""


class LogFailed(NamedTuple):
    """The operation failed."""

    reason: str
    """One sentence for the user."""
    silent: bool = False
    """True if the vehicle did not answer."""


class LogClient:
    """One operation at a time with one vehicle.

    A vehicle that ``is_silent_without_logs`` answers no request for a list while it has none.
    """

    def __init__(self, vehicle: Address, *, is_silent_without_logs: bool = False) -> None:
        self.vehicle = vehicle
        self._is_silent_without_logs = is_silent_without_logs
        self.result: LogDone | LogFailed | None = None
        self._outbox: list[Message] = []
        self._entries: dict[int, LogEntry] = {}
        self._ids: range | None = None
        """Candidate ids: one more than there are logs."""
        self._before: int | None = None
        """Number of logs before an erase."""
        self._erases_left = 0
        self._is_erased = False
        """True if a text of the vehicle has confirmed the erase."""
        self._stamps: set[int] = set()
        """Those of TIMESYNC requests after an erase, until they are answered."""
        self._answers = 0
        self._log_id: int | None = None
        self._file: PartialFile | None = None
        self._asked_end = 0
        """End of the latest request: its last block triggers the next."""
        self._retry_s: float | None = None
        self._progress_s = math.inf

    def start_list(self) -> None:
        """List all logs."""
        self._start()
        self._entries, self._ids, self._before = {}, None, None

    def start_erase(self, before: int) -> None:
        """Erase all of ``before`` logs, and list those that are left.

        Repeated until fewer are left; the log that is being written may stay. If the vehicle is silent without logs,
        its answers to TIMESYNC show that it receives the requests.
        """
        self.start_list()
        self._before, self._erases_left = before, ERASE_TRIES
        self._is_erased, self._stamps, self._answers = False, set(), 0

    def start_download(self, entry: LogEntry) -> None:
        """Download a log of the list."""
        self._start()
        self._log_id, self._file, self._asked_end = entry.log_id, PartialFile(min(entry.size, MAX_SIZE)), 0
        if not entry.size:
            self._end(LogDone())
        elif entry.size > MAX_SIZE:
            self._end(LogFailed(f"a log of {entry.size} bytes is too large"))

    def cancel(self) -> None:
        """Cancel the operation, and tell the vehicle."""
        if self.result is None and self._retry_s is not None:
            self._end(LogFailed("the operation was cancelled"))

    @property
    def progress(self) -> tuple[int, int]:
        """Received bytes and their total, of a download."""
        return (self._file.size - self._file.left, self._file.size) if self._file else (0, 0)

    # -- messages

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message; messages that do not belong to this operation are ignored."""
        if self.result is not None or self._retry_s is None or not is_from(message, self.vehicle):
            return
        kind = message.get_type()
        if kind == "LOG_ENTRY" and self._file is None:
            self._on_entry(message, now_s)
        elif kind == "LOG_DATA" and self._file is not None and message.id == self._log_id:
            self._on_data(self._file, message, now_s)
        elif kind == "STATUSTEXT" and self._before is not None and "log" in message.text.lower():
            self._on_erase_text(message)
        elif kind == "TIMESYNC" and message.tc1 and message.ts1 in self._stamps:
            self._stamps.remove(message.ts1)
            self._answers += 1

    def _on_erase_text(self, message: Message) -> None:
        """Take a text about the erase: a warning is the reason of a refusal, a notice says that it is done."""
        if message.severity <= mavlink.MAV_SEVERITY_WARNING:
            self._end(LogFailed(message.text.partition(": ")[2] or message.text))
        elif "erased" in message.text:
            self._erases_left, self._is_erased = 0, True

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""
        if self.result is None and self._retry_s is not None and now_s >= self._retry_s:
            self._progress_s = min(self._progress_s, now_s)
            if now_s - self._progress_s >= SILENCE_S:
                self._end(self._of_silence())
            elif self._file is not None:
                self._ask_for_data(self._file, now_s)
            else:
                self._ask_for_entries(now_s)
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next ``poll`` without an earlier message; -inf: immediately, None: never."""
        if self._outbox:
            return -math.inf
        return None if self.result is not None else self._retry_s

    def _of_silence(self) -> LogDone | LogFailed:
        vehicle = f"the vehicle (system {self.vehicle.system})"
        if self._is_silent_without_logs and self._file is None and not self._entries:
            if self._before is None or self._is_erased or self._answers >= ERASE_ANSWERS:
                return LogDone()
            return LogFailed(f"{vehicle} does not confirm it", silent=True)
        return LogFailed(f"{vehicle} does not answer", silent=True)

    # -- list

    def _on_entry(self, message: Message, now_s: float) -> None:
        if message.num_logs == 0:
            self._end(LogDone())
            return
        # the latest numbers count: a new log may have begun
        last = message.last_log_num
        self._ids = range(max(0, last - message.num_logs), last + 1)
        if message.id not in self._entries:
            self._progress_s = now_s
        self._entries[message.id] = LogEntry(message.id, message.size, message.time_utc)
        self._retry_s = now_s + RETRY_S
        found = [self._entries[log_id] for log_id in self._ids if log_id in self._entries]
        if len(found) >= message.num_logs:
            self._on_list(tuple(found[-message.num_logs :]), now_s)

    def _on_list(self, entries: tuple[LogEntry, ...], now_s: float) -> None:
        """End with the complete list, or repeat an erase that has had no effect."""
        if self._before is None or len(entries) < self._before or not self._erases_left:
            self._end(LogDone(entries))
        else:
            self._entries, self._ids = {}, None
            self._retry_s = now_s + ERASE_RETRY_S
            self._progress_s = now_s

    def _ask_for_entries(self, now_s: float) -> None:
        if self._erases_left and self._ids is None:
            self._erases_left -= 1
            self._outbox.append(mavlink.MAVLink_log_erase_message(*self.vehicle))
        missing = [log_id for log_id in self._ids or () if log_id not in self._entries]
        first, last = (missing[0], missing[-1]) if missing else (0, ALL_LOGS)
        self._outbox.append(mavlink.MAVLink_log_request_list_message(*self.vehicle, first, last))
        if self._before is not None and self._is_silent_without_logs:
            stamp = max(1, round(now_s * 1e9))
            self._stamps.add(stamp)
            self._outbox.append(mavlink.MAVLink_timesync_message(0, stamp))
        self._retry_s = now_s + RETRY_S

    # -- download

    def _on_data(self, file: PartialFile, message: Message, now_s: float) -> None:
        data = log_data(message)
        if not data and message.ofs < file.size:
            self._end(LogFailed("the vehicle cannot read the log, or it became shorter"))
            return
        if file.fill(message.ofs, data):
            self._progress_s = now_s
        self._retry_s = now_s + RETRY_S
        if not file.left:
            self._end(LogDone(content=bytes(file.content)))
        elif message.ofs + len(data) >= self._asked_end:
            self._ask_for_data(file, now_s)

    def _ask_for_data(self, file: PartialFile, now_s: float) -> None:
        first = file.first
        end = min(first + WINDOW, file.size)
        if file.within(first, end) > FEW * BLOCK:
            pieces = [(first, end - first)]
        else:
            pieces = list(itertools.islice(file.pieces(BLOCK), MAX_REQUESTS))
        self._asked_end = pieces[-1][0] + pieces[-1][1]
        for offset, count in pieces:
            request = mavlink.MAVLink_log_request_data_message(*self.vehicle, self._log_id, offset, count)
            self._outbox.append(request)
        self._retry_s = now_s + RETRY_S

    # -- helpers

    def _start(self) -> None:
        self.cancel()
        self.result, self._file, self._retry_s = None, None, -math.inf
        self._progress_s = math.inf

    def _end(self, result: LogDone | LogFailed) -> None:
        self.result, self._retry_s = result, None
        self._outbox.append(mavlink.MAVLink_log_request_end_message(*self.vehicle))
