"""Heights from a GeoTIFF of whatever reference system, by rasterio (GDAL): the extra `maps` of the package."""

import math
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.geodesy import Geodetic
from sim.world.arrays import Rows

_FEET: Final = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "us-ft": 1200 / 3937, "us survey foot": 1200 / 3937}
_VERTICAL_UNIT: Final = re.compile(r'VERT_CS\[.*?UNIT\["[^"]*",([\d.]+)')
"""The metres of a unit of height, in the text of a compound reference system."""
_MEMORY_FILE: Final = re.compile(r"(?:/vsimem/)?[0-9a-f-]{36}\S*?(?:: ?|, )|/vsimem/\S*")


def read(
    path: Path, data: bytes, places: Sequence[Geodetic], *, most_cells: int
) -> tuple[Rows, list[tuple[float, float]], tuple[float, float]]:
    """Heights of the first band, southernmost row first, NaN: none; column and row of each place; middle (lat, lon)."""
    try:
        from rasterio._err import CPLE_BaseError  # transform() lets GDAL's own errors through
        from rasterio.enums import ColorInterp
        from rasterio.errors import RasterioError
        from rasterio.io import MemoryFile
        from rasterio.warp import transform
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"world.heightmap: {path} is a GeoTIFF, which needs rasterio: pip install 'fanet-mw[maps]'"
        ) from error
    try:
        with warnings.catch_warnings(action="ignore"), MemoryFile(data).open() as file:
            if file.crs is None:
                raise ValueError("it has no reference system; give it one: gdal_translate -a_srs EPSG:...")
            if file.width * file.height > most_cells:
                raise ValueError(
                    f"{file.width} x {file.height} cells must be at most {most_cells}: cut it by gdalwarp -te"
                )
            if not abs(file.transform.determinant) > 0:
                raise ValueError("its cells have no size")
            color, kind = file.colorinterp[0], file.dtypes[0]
            if color in (ColorInterp.red, ColorInterp.palette) or kind.startswith("complex"):
                raise ValueError(f"its first band holds {color.name} of {kind}, and no heights")
            if file.scales[0] == 0:
                raise ValueError("its first band has scale = 0, which makes all heights alike")
            band = file.read(1, masked=True).astype(np.float64)
            metres = band.filled(np.nan) * file.scales[0] + file.offsets[0]
            vertical = _VERTICAL_UNIT.search(file.crs.to_wkt())
            unit_m = float(vertical[1]) if vertical else 1.0
            metres *= _FEET.get((file.units[0] or "").lower(), unit_m)
            lons, lats = [place.lon_deg for place in places], [place.lat_deg for place in places]
            x, y = transform("EPSG:4326", file.crs, lons, lats)
            to_cell, to_place = ~file.transform, file.transform
            across, down = file.width / 2, file.height / 2
            middle_x = to_place.a * across + to_place.b * down + to_place.c
            middle_y = to_place.d * across + to_place.e * down + to_place.f
            if file.crs.is_geographic:  # beside 180 degrees a place has two longitudes
                turn = math.tau / file.crs.units_factor[1]
                x = [px + turn * round((middle_x - px) / turn) for px in x]
            cells = [
                (to_cell.a * px + to_cell.b * py + to_cell.c, to_cell.d * px + to_cell.e * py + to_cell.f)
                for px, py in zip(x, y, strict=True)
            ]
            (lon,), (lat,) = transform(file.crs, "EPSG:4326", [middle_x], [middle_y])
            middle_deg = float(lat), float(lon)
    except (RasterioError, CPLE_BaseError) as error:
        raise ValueError(f"GDAL cannot read it: {_MEMORY_FILE.sub('', str(error.__cause__ or error))}") from error
    last = metres.shape[0] - 1
    return metres[::-1], [(column - 0.5, last - (row - 0.5)) for column, row in cells], middle_deg
