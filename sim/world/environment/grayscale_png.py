"""Reads a grayscale picture (PNG) with 8 or 16 bits, without interlacing."""

import struct
import zlib
from typing import Final

import numpy as np
import numpy.typing as npt

from sim.world.arrays import Rows

Bytes = npt.NDArray[np.uint8]
SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_MOST_PIXELS: Final = 64_000_000
_KINDS: Final = {
    0: "gray", 2: "colored", 3: "of a palette", 4: "gray and transparent", 6: "colored and transparent",
}  # fmt: skip


def brightness(data: bytes) -> Rows:
    """Brightness from 0 to 1 (PNG specification, third edition: chunks, filters)."""
    at, pixels, head = len(SIGNATURE), b"", b""
    while at < len(data):
        if at + 8 > len(data):
            raise ValueError("it is cut short")
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        head = body if kind == b"IHDR" else head
        pixels += body if kind == b"IDAT" else b""
        at += 12 + length
    width, height, depth, color, _, _, interlace = struct.unpack(">IIBBBBB", head)
    if color != 0 or depth not in (8, 16) or interlace:
        what = f"{_KINDS.get(color, f'of color type {color}')}, {depth} bits{', interlaced' * bool(interlace)}"
        raise ValueError(f"its pixels are {what}; save it as grayscale of 8 or 16 bits")
    if not 0 < width * height <= _MOST_PIXELS:
        raise ValueError(f"{width} x {height} pixels")
    step = depth // 8
    line = 1 + width * step
    opened = zlib.decompressobj()
    raw = opened.decompress(pixels, line * height)
    if len(raw) != line * height:
        raise ValueError("too few pixels")
    rows = np.frombuffer(raw, np.uint8).reshape(height, line)
    found = np.zeros((height, line - 1), np.uint8)
    before = np.zeros(line - 1, np.uint8)
    for index in range(height):
        before = found[index] = _unfiltered(int(rows[index, 0]), rows[index, 1:], before, step)
    values = found.reshape(height, width, step)
    bright = values[..., 0].astype(np.float64)
    if step == 2:
        bright = bright * 256 + values[..., 1]
    return np.asarray(bright / (256.0**step - 1))


def _unfiltered(kind: int, line: Bytes, above: Bytes, step: int) -> Bytes:
    """One line of bytes without its PNG filter."""
    if kind == 0:
        return line
    if kind == 2:
        return np.add(line, above, dtype=np.uint8)
    if kind not in (1, 3, 4):
        raise ValueError(f"filter {kind}")
    out = [0] * len(line)
    up = above.tolist()
    for i, value in enumerate(line.tolist()):
        left = out[i - step] if i >= step else 0
        corner = up[i - step] if i >= step else 0
        guess = left if kind == 1 else (left + up[i]) // 2 if kind == 3 else _paeth(left, up[i], corner)
        out[i] = (value + guess) & 0xFF
    return np.array(out, np.uint8)


def _paeth(left: int, up: int, corner: int) -> int:
    """Whichever of the three neighbors is nearest to left + up - corner."""
    guess = left + up - corner
    return min((left, up, corner), key=lambda value: abs(guess - value))
