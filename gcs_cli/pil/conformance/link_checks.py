"""Checks of the bytes between host and target: transparency, sizes, bursts, damage, cut frames."""

from __future__ import annotations

import random
import struct

from flightstack.core.contract import LoopFlags
from flightstack.firmware.pil.steps import REPORT_IDS, PilReport
from flightstack.mavlink.dialect import LAYOUT_BY_NAME, mavlink
from flightstack.mavlink.frames import pack_frame
from flightstack.mavlink.link import Message
from gcs_cli.pil.conformance.check import Check, check_of
from gcs_cli.pil.conformance.line import Line, is_echo

SEED = 1
BURST = 12
"""Frames in one piece: 288 bytes, and answers that fit into the outbox of 2048 bytes beside 1344 in reserve."""
NOISE_SIZE = 300
LONGEST_PAYLOAD = 255
CUT_SIZES = (3, 20, 60)
CUT_FRAME_S = 0.1
"""The target drops an incomplete frame after 20 ms without a byte."""
_PING = mavlink.MAVLink_ping_message
_STEP = LAYOUT_BY_NAME["FS_PIL_STEP"]
_UNKNOWN_ID = 0xFF_FFFE


def all_bytes(line: Line) -> Check:
    """Echo every byte value, in both directions."""
    lost = []
    for first in range(0, 256, 8):
        pattern = bytes(range(first, first + 8))
        if not line.ping(int.from_bytes(pattern, "little"), 1 + first, attempts=2):
            lost.append(first)
    ranges = ", ".join(f"0x{first:02X} to 0x{first + 7:02X}" for first in lost)
    return check_of(
        "byte values",
        not lost,
        "all 256 byte values are echoed" if not lost else f"no echo of a PING with bytes {ranges}",
        "The port must pass all 8 bits of every byte: no parity, no flow control by XON/XOFF, no change of line ends, "
        "and a baud rate within 2 %.",
    )


def sizes(line: Line) -> Check:
    """Exchange frames of all sizes that the target answers, and the largest that MAVLink has."""
    lost = [f"PING of {size}" for size in range(1, 13) if not _echoes(line, size)]
    layout = struct.Struct(_STEP.format)
    count = (layout.size - 8) // 4
    for index in range(count):
        numbers = [1e-3 if place == index else 0.0 for place in range(count)]
        payload = layout.pack(index, LoopFlags.RESET, *numbers).rstrip(b"\0")
        if _report(line, index, payload) is None:
            lost.append(f"FS_PIL_STEP of {len(payload)}")
    for size in (1, 64, 128, LONGEST_PAYLOAD):
        line.send(pack_frame(_UNKNOWN_ID, b"\x55" * size, 0, 0, 255, 190))
        if not line.ping(size, size, attempts=2):
            lost.append(f"PING after an unknown message of {size}")
    found = f"payloads of 1 to {layout.size} and {LONGEST_PAYLOAD} bytes arrive, reports of {_report_size()} return"
    return check_of(
        "message sizes",
        not lost,
        found if not lost else f"no answer to payloads in bytes: {', '.join(lost)}",
        "The port loses bytes of long frames: receive by interrupt or DMA into a ring of 512 bytes or more, and send "
        "only when the transmitter has room.",
    )


def _echoes(line: Line, size: int) -> bool:
    """Exchange a PING whose payload has this size: 1 to 8 bytes of time, then 1 to 4 of the number."""
    value = int.from_bytes(bytes(range(0x81, 0x81 + size)), "little")
    return line.ping(value & (1 << 64) - 1, value >> 64, attempts=2)


def _report(line: Line, step: int, payload: bytes) -> PilReport | None:
    frame = pack_frame(_STEP.message_id, payload, _STEP.crc_extra, step & 255, 255, 190)
    return line.ask(frame, lambda message: report_of(message, step), attempts=2)


def report_of(message: Message, step: int) -> PilReport | None:
    """Return the report in a message if it is of this step and was computed."""
    if message.get_msgId() not in REPORT_IDS:
        return None
    report = PilReport.of(bytes(message.get_msgbuf()))
    return report if report.step == step and not report.is_out_of_order else None


def _report_size() -> int:
    return struct.Struct(LAYOUT_BY_NAME["FS_PIL_REPORT"].format).size


def burst(line: Line) -> Check:
    """Send many frames without a pause; each is answered."""
    pairs = [(0x0102030405060708 + index, 0x1000 + index) for index in range(BURST)]
    data = b"".join(line.ping_frame(*pair) for pair in pairs)
    line.send(data)
    echoed = set()
    for _, message in line.hear(line.timeout_s):
        echoed |= {pair for pair in pairs if is_echo(*pair)(message)}
        if len(echoed) == BURST:
            break
    return check_of(
        "burst",
        len(echoed) == BURST,
        f"{len(echoed)} of {BURST} frames sent in one piece of {len(data)} bytes are answered",
        "Bytes are lost while the main loop works: enlarge the receive ring, or shorten the time with interrupts off.",
    )


def corrupted(line: Line) -> Check:
    """Send noise and frames with one wrong bit: no damaged frame is answered, and the next good one is."""
    rng = random.Random(SEED)
    line.send(rng.randbytes(NOISE_SIZE))
    line.wait(CUT_FRAME_S)
    answered = 0
    good = line.ping_frame(0x1122334455667788, 77)
    for place in range(len(good)):
        damaged = bytearray(good)
        damaged[place] ^= 1 << rng.randrange(8)
        line.send(bytes(damaged))
        heard = line.wait(CUT_FRAME_S)
        answered += sum(message.get_type() == "PING" for _, message in heard)
    is_alive = line.ping(5, 5, attempts=1)
    return check_of(
        "corrupted bytes",
        is_alive and not answered,
        f"{answered} of {len(good)} damaged frames were answered, a good one after them was"
        f"{'' if is_alive else ' not'}",
        "The checksum rejects damaged frames: if one is answered, the target sends back what it receives (echo of a "
        "console or of the line); if the good frame is not answered, bytes are lost after noise.",
    )


def cut_frame(line: Line) -> Check:
    """Send the beginning of a long frame: after a silence the next frame is answered at the first attempt."""
    step = pack_frame(_STEP.message_id, b"\x55" * struct.calcsize(_STEP.format), _STEP.crc_extra, 0, 255, 190)
    missed = 0
    for size in CUT_SIZES:
        line.send(step[:size])
        line.wait(CUT_FRAME_S)
        missed += not line.ping(size, size, attempts=1)
    return check_of(
        "cut frames",
        not missed,
        f"{len(CUT_SIZES) - missed} of {len(CUT_SIZES)} frames are answered at once after a frame that was cut off and "
        f"{CUT_FRAME_S * 1e3:.0f} ms of silence",
        "The firmware drops an incomplete frame after 20 ms of its own time: call fs_app_poll in every pass of the "
        "main loop, and check that the millisecond counter runs.",
    )
