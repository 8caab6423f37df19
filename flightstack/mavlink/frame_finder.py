"""Find every intact frame of the simulator link at once, whatever junk is around it. Pure.

``FrameReader`` waits for the rest of what looks like a frame, and gives up on data with too many false starts.
Both are right for links to the ground, where a lost message is sent again. In lockstep a frame that is held back
is the last: each side waits for the other. So this one looks behind an incomplete beginning too.
"""

from __future__ import annotations

import re

from flightstack.mavlink.frames import checked, frame_size

_BEGINNING = re.compile(rb"\xfd.[\x00\x01]|\xfe|\xfd.?\Z", re.DOTALL)


class FrameFinder:
    """Cuts a stream into known frames whose checksum is right; all other bytes are junk.

    It keeps at most the beginning of one frame.
    """

    def __init__(self) -> None:
        self._held = b""
        self.junk = 0
        """Stretches of bytes that were no frame."""

    @property
    def partial_size(self) -> int:
        """Bytes kept of a frame whose rest has not come; less than one frame."""
        return len(self._held)

    def find(self, data: bytes | memoryview) -> list[bytes]:
        """Take ``data`` and return the frames that are complete now."""
        stream = self._held + bytes(data)
        frames: list[bytes] = []
        decided, at = 0, 0
        incomplete: int | None = None  # the first beginning whose rest has not come
        while (match := _BEGINNING.search(stream, at)) is not None:
            start = match.start()
            size = frame_size(stream, start)
            at = start + 1
            if size is None or start + size > len(stream):
                incomplete = start if incomplete is None else incomplete
                continue
            frame = checked(stream[start : start + size])
            if frame is None or not frame.known:
                continue
            self.junk += start > decided
            frames.append(frame.data)
            decided = at = start + size
            incomplete = None
        keep_from = len(stream) if incomplete is None else incomplete
        self.junk += keep_from > decided
        self._held = stream[keep_from:]
        return frames
