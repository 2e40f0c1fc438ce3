"""A file that a scenario names is read whole, unless it is absurdly large or not there: then the message says so."""

from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.named_files import content
from sim.world.environment import footprints


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    (tmp_path / "map").write_bytes(b"\x00heights")
    assert content(tmp_path / "map", key="world.heightmap") == b"\x00heights"


def test_a_file_that_is_too_large_is_called_that_and_not_a_wrong_format(tmp_path: Path) -> None:
    path = tmp_path / "town.geojson"
    with path.open("wb") as file:
        file.truncate(256 * 1024 * 1024 + 1)  # a hole: it takes no disk
    with pytest.raises(
        ConfigError,
        match=r"^world\.buildings_geojson: \S*town\.geojson: cannot be read: 268435457 bytes, at most 268435456$",
    ):
        footprints.read(path, origin_deg=(0.0, 0.0), height_m=10.0, area_m=1000.0)


def test_a_file_that_is_not_there_is_named_with_its_key(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^world\.heightmap: .*nowhere: cannot be read: No such file"):
        content(tmp_path / "nowhere", key="world.heightmap")
