"""Reads heights of the ground from a file: an ASCII grid (`.asc`), or a grayscale picture (`.png`).

An ASCII grid (Esri; GDAL's AAIGrid) has a header with `ncols`, `nrows`, `cellsize` and others, then one line of heights
in metres for each row, the northernmost first. A picture is grayscale with 8 or 16 bits, without interlacing: black is
0, white is `world.heightmap_white_m`, and a pixel is `world.heightmap_pixel_m` wide. Whatever the file says about its
place on earth, its middle is put at the origin and its lowest point at height 0.
"""

import struct
import zlib
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from fanet_mw.errors import ConfigError
from sim.world.engines.contract import Rows, Values
from sim.world.environment.given_file import content

Bytes = npt.NDArray[np.uint8]
_MOST_CELLS: Final = 64_000_000
_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_HEADER: Final = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")


def read(path: Path, *, white_m: float, pixel_m: float) -> tuple[Rows, float]:
    """Heights, the southernmost row first, and the distance of neighboring points [m]; raises ConfigError with the
    file's name.
    """
    data = content(path, key="world.heightmap")
    try:
        if data.startswith(_SIGNATURE):
            heights, cell_m = _png(data) * white_m, pixel_m
        else:
            heights, cell_m = _asc(data.decode("ascii"))
    except (ValueError, KeyError, IndexError, struct.error, zlib.error) as error:
        raise ConfigError(
            f"world.heightmap: {path} is neither an ASCII grid nor a plain grayscale PNG: {error}"
        ) from error
    if min(heights.shape) < 2 or not np.isfinite(heights).all() or not 0 < cell_m < float("inf"):
        raise ConfigError(f"world.heightmap: {path} must hold at least 2 x 2 finite heights and a cell size > 0")
    return heights[::-1] - heights.min(), cell_m


def sample(heights: Rows, cell_m: float, east: Values, north: Values) -> Values:
    """Heights at some places by bilinear interpolation; outside of the grid those of its edge."""
    rows, columns = heights.shape
    x = np.clip(east / cell_m + (columns - 1) / 2, 0, columns - 1 - 1e-9)
    y = np.clip(north / cell_m + (rows - 1) / 2, 0, rows - 1 - 1e-9)
    i, j = y.astype(np.int64), x.astype(np.int64)
    v, u = y - i, x - j
    low = heights[i, j] * (1 - u) + heights[i, j + 1] * u
    high = heights[i + 1, j] * (1 - u) + heights[i + 1, j + 1] * u
    return np.asarray(low * (1 - v) + high * v)


def _asc(text: str) -> tuple[Rows, float]:
    lines = text.splitlines()
    header: dict[str, float] = {}
    while lines and lines[0].split()[:1] and lines[0].split()[0].lower() in _HEADER:
        key, value = lines.pop(0).split()
        header[key.lower()] = float(value)
    columns, rows = int(header["ncols"]), int(header["nrows"])
    if not 0 < columns * rows <= _MOST_CELLS:
        raise ValueError(f"{columns} x {rows} cells")
    heights = np.array(" ".join(lines).split(), dtype=np.float64)
    if len(heights) != columns * rows:
        raise ValueError(f"{len(heights)} heights, not {columns} x {rows}")
    missing = header.get("nodata_value")
    if missing is not None and (heights == missing).any():
        raise ValueError(f"{int((heights == missing).sum())} cells have no data")
    return heights.reshape(rows, columns), header["cellsize"]


def _png(data: bytes) -> Rows:
    """Brightness from 0 to 1 (PNG specification, third edition: chunks, filters)."""
    at, pixels, head = len(_SIGNATURE), b"", b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        head = body if kind == b"IHDR" else head
        pixels += body if kind == b"IDAT" else b""
        at += 12 + length
    width, height, depth, color, _, _, interlace = struct.unpack(">IIBBBBB", head)
    if color != 0 or depth not in (8, 16) or interlace:
        raise ValueError(f"color type {color}, {depth} bits, interlace {interlace}")
    if not 0 < width * height <= _MOST_CELLS:
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
