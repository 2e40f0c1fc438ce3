"""Maps as people bring them: each spelling is read as its author meant it, or refused in one sentence that says what to
change.
"""

import contextlib
import json
import math
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from kit import slow

from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Geodetic, to_geodetic
from fanet_mw.scenario import Scenario, World, config
from fanet_mw.units import Enu
from sim.scenarios.notes import notes
from sim.world.environment import footprints, heightmap
from sim.world.environment.obstacles import Obstacles, terrain
from sim.world.environment.solids import Solids

MakeScenario = Callable[..., Scenario]
PARIS = Geodetic(48.8566, 2.3522, 0.0)


# --- heights ----------------------------------------------------------------------------------------------------------


def ground(path: Path, *at: tuple[float, float], area_m: float = 100, **world: Any) -> list[float]:
    """Heights of the ground that a world makes of a file."""
    scenario = config.build({"world": {"heightmap": str(path), "area_m": area_m, **world}})
    return Solids(Obstacles(terrain(scenario), ())).ground_m(np.array(at, dtype=float)).tolist()


def grid(header: str, rows: list[list[object]], *, between: str = " ") -> str:
    return f"ncols {len(rows[0])}\nnrows {len(rows)}\n{header}\n" + "".join(
        f"{between.join(map(str, row))}\n" for row in rows
    )


def hill(side: int = 11, *, east: float = 1.0, north: float = 0.0) -> list[list[object]]:
    """Rises by so much a cell; 200 m at its south-western corner, or wherever it is lowest. Northernmost row first."""
    return [[200 + east * column + north * (side - 1 - row) for column in range(side)] for row in range(side)]


CORNER = "xllcorner 448000\nyllcorner 5411000\ncellsize 10"


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (grid(CORNER, hill()), "as GDAL writes it"),
        (grid("xllcenter 448005\nyllcenter 5411005\nCELLSIZE 10\nNODATA_value -9999", hill()), "corner by its center"),
        (grid("xllcorner 0\nyllcorner 0\ndx 10\ndy 10", hill()), "dx and dy"),
        (grid("xllcorner 0\nyllcorner 0\ncellsize 10,0\nNODATA_value -9999,0", hill()).replace(".", ","), "commas"),
        ("# heights of the town\n" + grid(CORNER + "\n# metres", hill()), "comments"),
        ("\ufeff" + grid(CORNER, hill()), "byte-order mark"),
        (grid(CORNER, hill()).replace("\n", "\r\n"), "lines of Windows"),
        (grid(CORNER, hill(), between=";"), "semicolons"),
        (grid(CORNER, hill(), between=","), "commas between"),
        (grid(CORNER, [[int(v) for v in row] for row in hill()], between=","), "commas between whole numbers"),
        (grid(CORNER, hill(), between=", "), "commas and spaces between"),
        (grid(CORNER, [[f"{v:.3f}".replace(".", ",") for v in row] for row in hill()]), "decimal commas"),
        (grid(CORNER, [[f"{v:.3f}".replace(".", ",") for v in row] for row in hill()], between=";"), "both"),
        (grid(CORNER, hill()).replace("\n201", " 201"), "one long line"),
        (grid(CORNER, hill(), between="\u00a0"), "hard spaces"),
    ],
    ids=lambda value: value if len(value) < 30 else "",
)
def test_an_ascii_grid_is_read_however_it_is_spelt(tmp_path: Path, data: str, what: str) -> None:
    for encoding in ("utf-8", "utf-16") if data[0] == "\ufeff" else ("utf-8",):
        path = tmp_path / "hill.asc"
        path.write_bytes(data.removeprefix("\ufeff" if encoding == "utf-16" else "").encode(encoding))
        assert ground(path, (-50, 0), (0, 0), (35, 20)) == pytest.approx([0, 5, 8.5], abs=1e-6), what


def test_cells_that_are_no_squares_keep_their_sides(tmp_path: Path) -> None:
    path = tmp_path / "hill.asc"
    path.write_text(grid("xllcorner 0\nyllcorner 0\ndx 20\ndy 10", hill(11, east=2, north=3)))
    middle, east, north = ground(path, (0, 0), (20, 0), (0, 10))
    assert (east - middle, north - middle) == pytest.approx((2, 3), abs=0.01)


@pytest.mark.parametrize("void", [-9999, -32768, -32767, 32767, "-3.4028235e+38", 1e20, "nan", "-1.#IND", -99999])
def test_a_void_that_the_header_does_not_declare_is_refused_with_its_place(tmp_path: Path, void: object) -> None:
    rows = hill()
    rows[0][3] = void
    path = tmp_path / "hill.asc"
    path.write_text(grid(CORNER, rows))
    with pytest.raises(ConfigError, match=r"1 cell within .* = 100 has no data.*\(line 6, column 4\); fill"):
        ground(path, (0, 0))


@pytest.mark.parametrize(("low", "count", "is_odd"), [(-99, 1, True), (150, 12, True), (170, 1, False), (0, 61, False)])
def test_a_few_cells_far_below_all_others_are_told(tmp_path: Path, low: int, count: int, is_odd: bool) -> None:
    """A void that nobody declares may be a height on earth."""
    rows: list[list[object]] = [[200.0] * 11 for _ in range(11)]
    for at in range(count):
        rows[at // 11][at % 11] = low
    path = tmp_path / "hill.asc"
    path.write_text(grid(CORNER, rows))
    said = notes(config.build({"world": {"heightmap": str(path), "area_m": 100}}))
    told = f"world.heightmap: {low} m at {count} of 121 cells of the area, and at least 200 m at all others: a void"
    assert [note.startswith(told) for note in said] == [True] * is_odd


@pytest.mark.parametrize(
    ("declared", "written"),
    [
        ("-3.4028234663852886e+38", "-3.402823e+38"),
        ("-9999", "-9999.000"),
        ("-9999.0", "-9999"),
        ("0", "0.00"),
        ("-99.9000015258789", "-99.9"),
    ],
)
def test_a_declared_void_is_recognized_in_other_digits_and_counts_for_nothing_outside_the_area(
    tmp_path: Path, declared: str, written: str
) -> None:
    rows = hill(21)
    rows[0] = [written] * 21
    path = tmp_path / "hill.asc"
    path.write_text(grid(f"{CORNER}\nNODATA_value {declared}", rows))
    assert ground(path, (0, 0)) == pytest.approx([10])
    with pytest.raises(ConfigError, match="21 cells within"):
        ground(path, (0, 0), area_m=200)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (grid(CORNER, hill()).replace("205.0", "2o5", 1), r"line 6: '2o5' is no number"),
        (grid(CORNER, hill()).replace("205.0", "2_05", 1), r"line 6: '2_05' is no number"),
        (grid(CORNER, hill()).replace("r 5411000", "r 1e999"), r"yllcorner = 1e999 must be a finite number"),
        (grid(CORNER, hill()).replace(" 205.0", "", 1), r"120 heights, not 11 x 11; line 6 has 10"),
        (grid(CORNER, hill()).replace("cellsize 10", "cellsize ten"), r"line 5: 'ten' is no number"),
        (grid(CORNER, hill()).replace("ncols 11", "columns 11"), r"line 1: 'columns 11' is no line of the header"),
        (grid(CORNER, hill()).replace("cellsize 10\n", ""), r"no cellsize, nor dx and dy"),
        (grid(f"{CORNER}\ncellsize 20", hill()), r"line 6: cellsize = 20, and 10 in a line above"),
        (grid(f"{CORNER}\ndx 20\ndy 20", hill()), r"dx = 20 contradicts cellsize = 10"),
        (grid(CORNER, hill()).replace("cellsize 10", "cellsize 1,000"), r"line 5: 1,000 may be thousands or"),
        (grid(CORNER, [[f"1,{i:03}" for i in range(j, j + 11)] for j in range(11)]), r"comma in 1,000, .* thousands"),
        (grid(CORNER, hill()).replace(" 210.0\n", "\n210.0 ", 1), r"line 6 has 10 heights, not ncols = 11"),
        (grid(CORNER, hill()[:9]).replace("ncols 11\nnrows 9", "ncols 9\nnrows 11"), r"11 heights each, .* swapped\?"),
        (grid(CORNER, hill()).replace("cellsize 10", "cellsize 1e300"), r"1e\+300 must be .* in \(0, 1e\+07"),
        ("\0\1\2" * 99, "it is binary"),
    ],
)
def test_an_ascii_grid_that_is_wrong_is_refused_with_the_line(tmp_path: Path, data: str, why: str) -> None:
    path = tmp_path / "hill.asc"
    path.write_text(data)
    with pytest.raises(ConfigError, match=why):
        ground(path, (0, 0))


@pytest.mark.parametrize(
    ("said", "unit"),
    [
        ('PROJCS["A",GEOGCS["B",UNIT["Degree",0.0174532925199433]],UNIT["Foot_US",0.3048006096012192]]', "Foot_US"),
        ("Projection STATEPLANE\r\nUnits FEET\r\nDatum NAD27\r\n", "FEET"),
        ('PROJCS["A",GEOGCS["B",UNIT["Degree",0.0174532925199433]],UNIT["Meter",1.0]]', ""),
        ("Projection UTM\nUnits METERS\nZunits NO\n", ""),
        ("\0\1", ""),
    ],
)
def test_a_grid_in_feet_by_the_file_beside_it_is_not_taken_as_metres(tmp_path: Path, said: str, unit: str) -> None:
    (tmp_path / "feet.asc").write_text(grid(CORNER, hill()))
    (tmp_path / "feet.prj").write_text(said)
    if not unit:
        assert ground(tmp_path / "feet.asc", (0, 0)) == pytest.approx([5])
        return
    with pytest.raises(ConfigError, match=rf"feet\.prj says that its lengths are in {unit}; convert it"):
        ground(tmp_path / "feet.asc", (0, 0))


@pytest.mark.parametrize(
    ("cell_m", "area_m"),
    [(5.0, 610.0), (3.0, 610.0), (7.0, 610.0), (7.0, 2500.0), *slow((3.0, 2500.0), (5.0, 2500.0))],
)
def test_a_ridge_of_one_cell_keeps_its_height_and_a_slope_stays_what_it_is(
    tmp_path: Path, cell_m: float, area_m: float
) -> None:
    side = int(area_m / cell_m) + 3
    at = side // 3
    path = tmp_path / "ridge.asc"
    rows = np.full((side, side), 100.0)
    rows[:, at] = 160.0
    path.write_text(grid(f"xllcorner 0\nyllcorner 0\ncellsize {cell_m}", rows.tolist()))
    ridge_m = (at - (side - 1) / 2) * cell_m
    norths = np.linspace(-area_m / 2, area_m / 2, 41)
    assert ground(path, *((ridge_m, north) for north in norths), area_m=area_m) == pytest.approx([60.0] * 41, abs=0.01)
    assert max(ground(path, *((ridge_m + side_m, 0.0) for side_m in (-25, 25)), area_m=area_m)) == 0
    rows = np.add.outer(np.zeros(side), 0.3 * np.arange(side))
    path.write_text(grid(f"xllcorner 0\nyllcorner 0\ncellsize {cell_m}", rows.tolist()))
    west, east = ground(path, (-200, 0), (200, 0), area_m=area_m)
    assert east - west == pytest.approx(0.3 * 400 / cell_m, abs=0.05)


def degrees(east_m: float, north_m: float) -> tuple[float, float]:
    place = to_geodetic(Enu(east_m, north_m, 0.0), PARIS)
    return place.lat_deg, place.lon_deg


def test_an_ascii_grid_in_degrees_lies_where_it_belongs(tmp_path: Path) -> None:
    """As OpenTopography delivers it: cells of one arc second."""
    cell, side = 1 / 3600, 121
    south, west = round(PARIS.lat_deg, 2) - 60 * cell, round(PARIS.lon_deg, 2) - 60 * cell
    rows = [[100 + column + 2 * (side - 1 - row) for column in range(side)] for row in range(side)]
    path = tmp_path / "hill.asc"
    path.write_text(grid(f"xllcenter {west}\nyllcenter {south}\ncellsize {cell}", rows))
    at = [(0.0, 0.0), (400.0, 0.0), (-300.0, 450.0)]
    places = [degrees(*each) for each in at]
    wanted = [(lon - west) / cell + 2 * (lat - south) / cell for lat, lon in places]
    found = ground(path, *at, area_m=1000, origin_deg=PARIS[:2])
    assert np.subtract(found, found[0]) == pytest.approx(np.subtract(wanted, wanted[0]), abs=0.1)
    unset = config.build({"world": {"heightmap": str(path), "area_m": 1000}})
    assert unset.world.origin_deg == pytest.approx((south + 60 * cell, west + 60 * cell))
    with pytest.raises(ConfigError, match=r"does not cover .* = \[10, 10\]; .* is \[48\.86000, 2\.35"):
        ground(path, (0, 0), origin_deg=(10, 10))


def test_a_grid_that_may_be_in_degrees_or_not_is_refused_with_the_way_to_make_it_clear(tmp_path: Path) -> None:
    path = tmp_path / "world.asc"
    path.write_text(grid("xllcorner 2\nyllcorner 48\ncellsize 0.25", hill()))
    with pytest.raises(ConfigError, match=r"covers 2\.75 m to the east, .*; if its cells are degrees: gdalwarp"):
        ground(path, (0, 0))


@pytest.mark.parametrize(("cells", "covers"), [(26, "780"), (27, "")])
def test_the_cells_of_a_grid_in_metres_must_cover_the_area(tmp_path: Path, cells: int, covers: str) -> None:
    path = tmp_path / "world.asc"
    path.write_text(f"ncols {cells}\nnrows {cells}\ncellsize 30\n" + ("7 " * cells + "\n") * cells)
    refused = pytest.raises(ConfigError, match=rf"covers {covers} m to the east, which must be >= world.area_m = 800")
    with refused if covers else contextlib.nullcontext():
        heightmap.read(path, origin_deg=(0.0, 0.0), area_m=800.0)


def test_a_tile_of_srtm_lies_where_its_name_says_and_its_voids_are_refused(tmp_path: Path) -> None:
    side = 1201
    lat, lon = np.meshgrid(np.linspace(49, 48, side), np.linspace(2, 3, side), indexing="ij")
    heights = np.round(1000 * (lat - 48) + 500 * (lon - 2)).astype(">i2")
    heights[100, 100] = -32768
    path = tmp_path / "N48E002.hgt"
    path.write_bytes(heights.tobytes())
    at = [(0.0, 0.0), (2000.0, -2000.0)]
    wanted = [1000 * (lat - 48) + 500 * (lon - 2) for lat, lon in (degrees(*each) for each in at)]
    found = ground(path, *at, area_m=5000, origin_deg=PARIS[:2])
    assert found[1] - found[0] == pytest.approx(wanted[1] - wanted[0], abs=1.5)
    with pytest.raises(ConfigError, match="1 cell within"):
        ground(path, (0, 0), area_m=900, origin_deg=(49 - 100 / 1200, 2 + 100 / 1200))
    with pytest.raises(ConfigError, match=r"does not cover .*; the middle of the file is \[48\.50000, 2\.50000\]"):
        ground(path, (0, 0))
    path.rename(tmp_path / "paris.hgt")
    with pytest.raises(ConfigError, match=r"the name of a \.hgt file says where it lies"):
        ground(tmp_path / "paris.hgt", (0, 0))


@pytest.mark.parametrize(("crs", "compress"), [("EPSG:32631", "lzw"), ("EPSG:4326", "deflate"), ("EPSG:2154", "none")])
def test_a_geotiff_of_any_reference_system_lies_where_it_belongs(tmp_path: Path, crs: str, compress: str) -> None:
    rasterio = pytest.importorskip("rasterio")
    transform = pytest.importorskip("rasterio.warp").transform
    (x,), (y,) = transform("EPSG:4326", crs, [PARIS.lon_deg], [PARIS.lat_deg])
    cell = 1 / 3600 if crs == "EPSG:4326" else 10.0
    side = 201
    rows = np.add.outer(2.0 * np.arange(side)[::-1], np.arange(side)).astype("float32")
    rows[0, 0] = -9999
    path = tmp_path / "hill.tif"
    place = rasterio.Affine(cell, 0, x - side * cell / 2 + 3 * cell, 0, -cell, y + side * cell / 2)
    shape = {"width": side, "height": side, "count": 1, "dtype": "float32", "nodata": -9999}
    with rasterio.open(path, "w", "GTiff", crs=crs, transform=place, compress=compress, **shape) as file:
        file.write(rows, 1)
    at = [(0.0, 0.0), (300.0, 0.0), (0.0, 400.0)]
    (xs, ys) = transform("EPSG:4326", crs, *zip(*(degrees(*each)[::-1] for each in at), strict=True))
    wanted = [(px - x) / cell + 2 * (py - y) / cell for px, py in zip(xs, ys, strict=True)]
    found = ground(path, *at, area_m=1000, origin_deg=PARIS[:2])
    assert np.subtract(found, found[0]) == pytest.approx(wanted, abs=0.1)
    with pytest.raises(ConfigError, match=r"does not cover .*; the middle of the file is \[48\.85"):
        ground(path, (0, 0))


def tiff(path: Path, rows: Any, crs: str = "EPSG:32631", **keys: Any) -> Path:
    """Cells of 10 m about Paris, in all bands alike."""
    rasterio = pytest.importorskip("rasterio")
    (x,), (y,) = pytest.importorskip("rasterio.warp").transform("EPSG:4326", crs, [PARIS.lon_deg], [PARIS.lat_deg])
    side = len(rows)
    place = rasterio.Affine(10, 0, x - 5 * side, 0, -10, y + 5 * side)
    shape = {"width": side, "height": side, "dtype": rows.dtype, "count": 1}
    with rasterio.open(path, "w", "GTiff", crs=crs, transform=place, **{**shape, **keys}) as file:
        for band in file.indexes:
            file.write(rows, band)
    return path


def test_a_geotiff_whose_reference_system_has_heights_in_feet_is_read_in_metres(tmp_path: Path) -> None:
    rows = np.add.outer(np.zeros(21), 2.0 * np.arange(21))
    for crs, unit_m in (("EPSG:32631+6360", 1200 / 3937), ("EPSG:32631+5773", 1.0)):  # NAVD 88 in feet, EGM96 in metres
        west, east = ground(tiff(tmp_path / "hill.tif", rows, crs), (-50, 0), (50, 0), origin_deg=PARIS[:2])
        assert east - west == pytest.approx(20 * unit_m, abs=0.1)


def test_a_geotiff_across_180_degrees_lies_where_it_belongs(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    path, rows = tmp_path / "hill.tif", np.add.outer(np.zeros(41), np.arange(41.0))
    place = rasterio.Affine(1e-3, 0, 180 - 20.5e-3, 0, -1e-3, 10 + 20.5e-3)
    shape = {"width": 41, "height": 41, "dtype": rows.dtype, "count": 1}
    with rasterio.open(path, "w", "GTiff", crs="EPSG:4326", transform=place, **shape) as file:
        file.write(rows, 1)
    for lon in (179.999, -179.999):
        west, east = ground(path, (-100, 0), (100, 0), origin_deg=[10, lon], area_m=400)
        assert east - west == pytest.approx(200 / 109.6, abs=0.05)


def test_a_geotiff_whose_scale_makes_all_alike_is_refused(tmp_path: Path) -> None:
    path = tiff(tmp_path / "hill.tif", np.ones((21, 21)))
    with pytest.importorskip("rasterio").open(path, "r+") as file:
        file.scales = (0.0,)
    with pytest.raises(ConfigError, match="its first band has scale = 0"):
        ground(path, (0, 0), origin_deg=PARIS[:2])


def test_a_geotiff_of_colors_is_no_map_of_heights(tmp_path: Path) -> None:
    path = tiff(tmp_path / "photo.tif", np.full((21, 21), 90, "uint8"), count=3, photometric="rgb")
    with pytest.raises(ConfigError, match="its first band holds red of uint8, and no heights"):
        ground(path, (0, 0), origin_deg=PARIS[:2])


def test_a_broken_geotiff_is_refused_in_one_sentence_whatever_gdal_raises(tmp_path: Path) -> None:
    """Some errors of GDAL pass through rasterio as they are, and its warnings are not for users."""
    path = tiff(tmp_path / "hill.tif", np.zeros((21, 21), "float32"))
    data, random, read = path.read_bytes(), Random("tiff"), 0
    for _ in range(100):
        changed = bytearray(data)
        for _ in range(random.randrange(1, 6)):
            changed[random.randrange(600)] = random.randrange(256)
        path.write_bytes(changed)
        with contextlib.suppress(ConfigError):
            ground(path, (0, 0), origin_deg=PARIS[:2])
            read += 1
    assert 10 < read < 90
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ConfigError, match=r"GDAL cannot read it: [^-]*$"):  # by no name of ours in memory
        ground(path, (0, 0), origin_deg=PARIS[:2])


def test_a_geotiff_without_the_extra_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("rasterio", "rasterio.io", "rasterio.errors", "rasterio.warp"):
        monkeypatch.setitem(sys.modules, name, None)
    path = tmp_path / "hill.tif"
    path.write_bytes(b"II*\0" + struct.pack("<I", 8) + bytes(64))
    with pytest.raises(ConfigError, match=r"needs rasterio: pip install 'fanet-mw\[maps\]'"):
        ground(path, (0, 0))


# --- buildings --------------------------------------------------------------------------------------------------------


def geojson(path: Path, *buildings: tuple[list[tuple[float, float]], dict[str, Any]], origin: Geodetic = PARIS) -> Path:
    """Buildings by their corners in metres about an origin."""
    features = []
    for corners, tags in buildings:
        ring = [to_geodetic(Enu(east, north, 0.0), origin) for east, north in (*corners, corners[0])]
        polygon = {"type": "Polygon", "coordinates": [[[g.lon_deg, g.lat_deg] for g in ring]]}
        features.append({"type": "Feature", "properties": tags, "geometry": polygon})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def town(path: Path, origin: Geodetic = PARIS) -> footprints.Town:
    return footprints.read(path, origin_deg=origin[:2], height_m=19.0, area_m=1000.0)


@pytest.mark.parametrize(
    ("tags", "height_m", "guessed"),
    [
        ({"height": "40 ft"}, 12.192, False),
        ({"height": "40'"}, 12.192, False),
        ({"height": "5'6\""}, 1.6764, False),
        ({"height": "1'234"}, 19.0, True),
        ({"height": "9" * 5000, "levels": 2}, 6.0, True),
        ({"height": "12,5"}, 12.5, False),
        ({"height": "12.5m"}, 12.5, False),
        ({"height": "12 metres"}, 12.0, False),
        ({"height": 12}, 12.0, False),
        ({"height": "~15"}, 15.0, False),
        ({"height": "10-12 m"}, 12.0, True),
        ({"height": "yes", "building:levels": "3"}, 9.0, True),
        ({"height": "-5", "building:levels": 2}, 6.0, True),
        ({"height": "99999"}, 19.0, True),
        ({"height": None, "building:levels": "2;3"}, 9.0, True),
        ({"building:levels": "3-4"}, 12.0, True),
        ({"building:levels": "0", "roof:levels": "1"}, 19.0, True),
        ({"building:levels": "0", "levels": "2"}, 6.0, True),
        ({"building:levels": "2,5"}, 7.5, False),
        ({"building:levels": "4 floors"}, 12.0, False),
        ({"building:levels": "5."}, 15.0, False),
        ({"height": "+12."}, 12.0, False),
        ({"height": "12 (estimated)"}, 12.0, False),
        ({"height": "3 mtr approx."}, 3.0, False),
        ({"height": "12 \u043c\u0435\u0442\u0440\u043e\u0432"}, 12.0, False),
        ({"height": "12 m; yes"}, 12.0, True),
        ({"height": "1,200"}, 19.0, True),
        ({"levels": "many"}, 19.0, True),
        ({"building": "yes"}, 19.0, False),
        ({"tags": {"height": "30"}}, 30.0, False),
        ({"tags": '{"height": "30"}'}, 30.0, False),
        ({"HEIGHT": 30}, 30.0, False),
        ({"height": "40\u2019"}, 12.192, False),
        ({"height": "5\u20196\u201d"}, 1.6764, False),
        ({"other_tags": '"height"=>"30 ft","name"=>"a"'}, 9.144, False),
    ],
)
def test_a_height_is_what_its_tag_says_or_is_guessed_and_named(
    tmp_path: Path, tags: dict[str, Any], height_m: float, guessed: bool
) -> None:
    square = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    found = town(geojson(tmp_path / "a.geojson", (square, {"@id": "way/42", **tags})))
    assert [box.height for box in found.boxes] == pytest.approx([height_m])
    assert [text.partition(":")[0] for text in found.guessed] == (["way/42"] if guessed else [])
    assert all(len(text) < 200 for text in found.guessed)


def test_outlines_that_enclose_nothing_are_passed_over_and_named_and_parks_are_no_buildings(tmp_path: Path) -> None:
    path = geojson(
        tmp_path / "a.geojson",
        ([(0, 0), (10, 0), (10, 10)], {"height": 5}),
        ([(0, 0), (30, 10), (60, 20)], {"height": 5}),
        ([(0, 0), (90, 0), (90, 90)], {"leisure": "park"}),
        ([(0, 0), (90, 0), (90, 90)], {"building": "no"}),
    )
    tree = json.loads(path.read_text())
    for ring in ([], [[]], [[[2.35, 48.85]]], [[[2.35, 48.85], [None, 48.85]]], None, "x"):
        tree["features"].append(
            {"type": "Feature", "id": 7, "properties": None, "geometry": {"type": "Polygon", "coordinates": ring}}
        )
    tree["features"] += [{"type": "Feature", "properties": {}, "geometry": None}, None]
    path.write_text(json.dumps(tree))
    found = town(path)
    assert (len(found.boxes), len(found.broken), found.buildings) == (1, 7, 2)
    assert found.broken[0].startswith("7: ")
    assert found.broken[-1].endswith("its corners lie on a line")


def test_one_feature_a_line_is_read_as_a_collection(tmp_path: Path) -> None:
    whole = json.loads(geojson(tmp_path / "a.geojson", *[(TEE, {"height": 5})] * 3).read_text())
    path = tmp_path / "lines.geojson"
    path.write_text("\ufeff" + "\n".join("\x1e" + json.dumps(feature) for feature in whole["features"]) + "\n")
    assert town(path).buildings == 3


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
def test_a_closed_line_of_a_building_is_its_outline_in_any_unicode(tmp_path: Path, encoding: str) -> None:
    line = [[0.0, 0.0], [0.0001, 0.0], [0.0001, 0.0001], [0.0, 0.0001], [0.0, 0.0]]
    features = [
        {"type": "Feature", "properties": tags, "geometry": {"type": "LineString", "coordinates": points}}
        for tags, points in (({"building": "yes", "height": 8}, line), ({"building": "yes"}, line[:-1]), ({}, line))
    ]
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding=encoding)
    assert [box.height for box in town(path, Geodetic(0.0, 0.0, 0.0)).boxes] == [8.0]


def test_a_list_of_features_is_a_town_without_what_is_underground(tmp_path: Path) -> None:
    ring = [[0.0, 0.0], [0.0001, 0.0], [0.0001, 0.0001], [0.0, 0.0001], [0.0, 0.0]]
    features = [
        {"type": "Feature", "properties": tags, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for tags in ({"building": "yes", "height": 8}, {"building": "parking", "location": "underground"})
    ]
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(features))
    assert [box.height for box in town(path, Geodetic(0.0, 0.0, 0.0)).boxes] == [8.0]


def test_a_town_across_180_degrees_is_one_town(tmp_path: Path) -> None:
    taveuni = Geodetic(-16.8, 180.0, 0.0)
    square = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    path = geojson(
        tmp_path / "a.geojson",
        *(([(east + x, y) for x, y in square], {}) for east in (-105, -5, 95)),
        origin=taveuni,
    )
    assert any(lon < 0 for lon in longitudes(path))
    assert any(lon > 0 for lon in longitudes(path))
    scenario = config.build({"world": {"buildings_geojson": str(path), "area_m": 1000}})
    lat, lon = scenario.world.origin_deg
    assert (lat, abs(lon)) == pytest.approx((-16.8, 180), abs=1e-4)
    found = town(path, Geodetic(lat, lon, 0.0))
    assert sorted(box.east for box in found.boxes) == pytest.approx([-100, 0, 100], abs=0.1)


def longitudes(path: Path) -> list[float]:
    tree = json.loads(path.read_text())
    return [lon for f in tree["features"] for lon, _ in f["geometry"]["coordinates"][0]]


ELL = [(0.0, 0.0), (40.0, 0.0), (40.0, 10.0), (10.0, 10.0), (10.0, 40.0), (0.0, 40.0)]
TEE = [(0.0, 30.0), (0.0, 40.0), (50.0, 40.0), (50.0, 30.0), (30.0, 30.0), (30.0, 0.0), (20.0, 0.0), (20.0, 30.0)]
YARD = [(0.0, 0.0), (60.0, 0.0), (60.0, 50.0), (50.0, 50.0), (50.0, 10.0), (10.0, 10.0), (10.0, 50.0), (0.0, 50.0)]
STAR = [
    ((30 if i % 2 else 12) * math.cos(math.pi * i / 5), (30 if i % 2 else 12) * math.sin(math.pi * i / 5))
    for i in range(10)
]


@pytest.mark.parametrize(("corners", "most"), [(ELL, 1.02), (TEE, 1.02), (YARD, 1.02), (STAR, 1.7)], ids="LTUS")
@pytest.mark.parametrize("yaw_deg", [0, 27, 80])
def test_a_concave_outline_becomes_boxes_that_cover_it_and_little_else(
    tmp_path: Path, corners: list[tuple[float, float]], most: float, yaw_deg: float
) -> None:
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    turned = [(cos * x - sin * y, sin * x + cos * y) for x, y in corners]
    boxes = town(geojson(tmp_path / "a.geojson", (turned, {"height": 9}))).boxes
    area = abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(turned, turned[1:] + turned[:1], strict=True))) / 2
    assert area - 1 < sum(box.width * box.depth for box in boxes) <= most * area
    random = np.random.default_rng(1)
    for east, north in random.uniform(-70, 70, (4000, 2)).tolist():
        if inside(turned, east, north):
            assert any(covers(box, east, north) for box in boxes)


def inside(corners: list[tuple[float, float]], x: float, y: float) -> bool:
    """By the number of sides that a ray to the east crosses."""
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    return (
        sum((a[1] > y) != (b[1] > y) and x < a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) for a, b in sides) % 2
        == 1
    )


def covers(box: footprints.Footprint, east: float, north: float) -> bool:
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    x, y = east - box.east, north - box.north
    return abs(cos * x + sin * y) < box.width / 2 + 0.05 and abs(cos * y - sin * x) < box.depth / 2 + 0.05


def test_a_round_outline_of_thousands_of_corners_takes_no_minute(tmp_path: Path) -> None:
    corners = [(20 * math.cos(i / 3000 * math.tau), 20 * math.sin(i / 3000 * math.tau)) for i in range(3000)]
    began_s = time.perf_counter()
    (box,) = town(geojson(tmp_path / "round.geojson", (corners, {"building": "yes"}))).boxes
    assert time.perf_counter() - began_s < 1.0
    assert (box.width, box.depth) == pytest.approx((40, 40), abs=0.01)


def test_the_smallest_rectangle_may_lie_along_a_side_of_the_hull_alone(tmp_path: Path) -> None:
    """A star of five points: none of its sides lies along the smallest rectangle."""
    box = footprints._rectangle(np.array([*STAR, STAR[0]]), 1.0)
    hull_angles = np.linspace(0, math.pi / 2, 2000)
    least = min(
        np.ptp(turned[:, 0]) * np.ptp(turned[:, 1])
        for turned in (np.array(STAR) @ footprints._turn(yaw) for yaw in hull_angles)
    )
    assert box.width * box.depth == pytest.approx(least, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"elements": []}', "JSON of Overpass; export it as GeoJSON"),
        ('{"type": "Polygon", "coordinates": [[[448000, 5411000], [448010, 5411000], [448010, 5411010]]]}', "ogr2ogr"),
        ('{"type": "FeatureCollection"}', "features are no list"),
        ('\ufeff<?xml version="1.0"?><osm/>', "it is XML or HTML: export it"),
        (f'{{"type": {"1" * 5000}}}', r"4300 digits\) .* has 5000 digits$"),
        ("PK\x03\x04", "it is a ZIP archive: unpack it"),
        ('{"type": "Polygon", "crs": {"properties": {"name": "EPSG:3857"}}}', "its crs is EPSG:3857; convert the file"),
        ("SQLite format 3\0", "a GeoPackage or another SQLite database"),
    ],
)
def test_a_file_of_another_kind_is_refused_with_the_way_to_convert_it(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(text)
    with pytest.raises(ConfigError, match=why):
        town(path)


# --- their place on earth ---------------------------------------------------------------------------------------------


def test_the_origin_is_the_scenarios_or_its_maps_or_the_documented_one(tmp_path: Path) -> None:
    path = str(geojson(tmp_path / "a.geojson", (ELL, {})))
    middle = (PARIS.lat_deg + 20 / 111_200, PARIS.lon_deg + 20 / 73_300)
    assert config.build({"world": {"buildings_geojson": path}}).world.origin_deg == pytest.approx(middle, abs=1e-5)
    named = config.build({"world": {"buildings_geojson": path, "origin_deg": (1.0, 2.0)}})
    assert named.world.origin_deg == (1.0, 2.0)
    assert World().origin_deg == (37.5665, 126.978)


def test_heights_without_a_place_take_the_middle_of_the_buildings(tmp_path: Path) -> None:
    (tmp_path / "hill.asc").write_text(grid(CORNER, hill()))
    world = {"heightmap": str(tmp_path / "hill.asc"), "area_m": 100}
    assert config.build({"world": world}).world.origin_deg == World().origin_deg
    buildings = str(geojson(tmp_path / "a.geojson", (ELL, {})))
    both = config.build({"world": {**world, "buildings_geojson": buildings}})
    assert both.world.origin_deg[0] == pytest.approx(48.8568, abs=1e-4)
    assert heightmap.read(
        tmp_path / "hill.asc", origin_deg=both.world.origin_deg, area_m=100
    ).metres.max() == pytest.approx(10)
