"""Three hundred maps, grids and traces as people bring them are read as they were meant, or refused in one sentence."""

from collections.abc import Callable
from pathlib import Path
from random import Random

import maps
import numpy as np
import pytest
from maps import Sample

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import config
from sim.world.environment.obstacles import Obstacles, terrain, town_of
from sim.world.environment.solids import Solids

EACH = 100


def read_grid(path: Path) -> list[float]:
    scenario = config.build({"world": {"heightmap": str(path), "area_m": maps.AREA_M}})
    at = np.array([[0.0, 0.0], [3 * maps.CELL_M, 3 * maps.CELL_M]])
    return Solids(Obstacles(terrain(scenario), ())).ground_m(at).tolist()


def read_town(path: Path) -> list[float]:
    world = {"buildings_geojson": str(path), "area_m": 1000, "origin_deg": maps.PARIS}
    return sorted(box.height for box in town_of(config.build({"world": world}).world).boxes)


def read_trace(path: Path) -> list[list[float]]:
    text = f'duration_s = 100\n[traffic]\narrivals = "trace"\npackets_csv = "{path.name}"\n'
    made = config.parse(text, source="s.toml", name="s", folder=path.parent)
    return [list(packet) for packet in made.traffic.packets]


def attempt(read: Callable[[Path], object], path: Path) -> tuple[object, str]:
    """What is read, or why nothing is."""
    try:
        return read(path), ""
    except ConfigError as error:
        return None, str(error)


@pytest.mark.parametrize(
    ("name", "draw", "read"),
    [
        ("hill.asc", maps.grid, read_grid),
        ("town.geojson", maps.town, read_town),
        ("load.csv", maps.trace, read_trace),
    ],
    ids=["grids", "towns", "traces"],
)
def test_what_people_bring_is_read_as_it_was_meant_or_refused_in_one_sentence(
    tmp_path: Path, name: str, draw: Callable[[Random], Sample], read: Callable[[Path], object]
) -> None:
    path, read_rightly = tmp_path / name, 0
    for seed in range(EACH):
        data, meaning = draw(Random(f"{name}/{seed}"))
        path.write_bytes(data)
        shown = f"{name} of seed {seed}: {data[:400]!r}"
        found, why = attempt(read, path)
        if why:
            assert meaning is None, f"{shown} is refused: {why}"
            assert "\n" not in why, shown
            assert name in why, shown
            continue
        assert meaning is not None, f"{shown} is read as {found}"
        assert np.array(found) == pytest.approx(np.array(meaning), abs=1e-2), shown
        read_rightly += 1
    assert EACH / 2 < read_rightly < EACH, "both kinds are drawn"
