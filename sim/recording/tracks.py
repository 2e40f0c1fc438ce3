"""The tracks of UAVs and the finds of survivors for maps: GPX 1.1, a file per UAV, and KML 2.2, one file for all.

Places are WGS84 about the scenario's origin; heights are those of the world, in KML above the ground below; instants
are unix time, in UTC.
"""

from collections import defaultdict
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as Xml

from fanet_mw.errors import ConfigError
from fanet_mw.geodesy import Geodetic, to_geodetic
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, PlacedAmong, PlacedInside, Posed
from fanet_mw.units import Enu, S
from fanet_mw.whole_file import replacing, writing
from sim.records.record_kinds import records_of
from sim.results.outcome import Outcome
from sim.world.environment.obstacles import terrain

_GPX: Final = "http://www.topografix.com/GPX/1/1"
_KML: Final = "http://www.opengis.net/kml/2.2"
_GX: Final = "http://www.google.com/kml/ext/2.2"


def write_gpx(outcome: Outcome, out: Path) -> dict[Path, int]:
    """Write uav-N.gpx for each UAV, with its confirmations as way points; returns the points of each track."""
    tracks, finds = _tracks(outcome), _finds(outcome)
    written = {}
    for node, track in sorted(tracks.items()):
        root = Xml.Element("gpx", {"version": "1.1", "creator": "fanet-mw", "xmlns": _GPX})
        metadata = Xml.SubElement(root, "metadata")
        _text(metadata, "name", f"{outcome.scenario.name}, seed {outcome.scenario.seed}, UAV {node}")
        _text(metadata, "time", _instant(outcome, 0))
        for record in finds:
            if record.node == node:
                point = Xml.SubElement(root, "wpt", _degrees(outcome.scenario, record.east_m, record.north_m))
                _text(point, "time", _instant(outcome, record.t_ns))
                _text(point, "name", _said(record))
        path = Xml.SubElement(root, "trk")
        _text(path, "name", f"UAV {node}")
        segment = Xml.SubElement(path, "trkseg")
        for one in track:
            point = Xml.SubElement(segment, "trkpt", _degrees(outcome.scenario, one.east_m, one.north_m))
            _text(point, "ele", f"{one.up_m:.2f}")
            _text(point, "time", _instant(outcome, one.t_ns))
        written[out / f"uav-{node}.gpx"] = len(track)
        _write(root, out / f"uav-{node}.gpx")
    return written


def write_kml(outcome: Outcome, path: Path) -> int:
    """Write all tracks, the area, and all finds to one file; returns the number of points of all tracks."""
    scenario = outcome.scenario
    root = Xml.Element("kml", {"xmlns": _KML, "xmlns:gx": _GX})
    document = Xml.SubElement(root, "Document")
    _text(document, "name", f"{scenario.name}, seed {scenario.seed}")
    half = scenario.world.area_m / 2
    area = _placemark(document, "area")
    corners = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    _text(Xml.SubElement(area, "LineString"), "coordinates", " ".join(_coordinate(scenario, *at) for at in corners))
    for record in _finds(outcome):
        mark = _placemark(document, _said(record))
        _text(mark, "description", f"by UAV {record.node} at {record.t_ns / S:.1f} s")
        _text(Xml.SubElement(mark, "TimeStamp"), "when", _instant(outcome, record.t_ns))
        _text(Xml.SubElement(mark, "Point"), "coordinates", _coordinate(scenario, record.east_m, record.north_m))
    count, ground_m = 0, _ground(scenario)
    for node, track in sorted(_tracks(outcome).items()):
        flown = Xml.SubElement(_placemark(document, f"UAV {node}"), "gx:Track")
        _text(flown, "altitudeMode", "relativeToGround")
        for one in track:
            _text(flown, "when", _instant(outcome, one.t_ns))
        for one in track:
            above_m = one.up_m - ground_m(one.east_m, one.north_m)
            _text(flown, "gx:coord", _coordinate(scenario, one.east_m, one.north_m, above_m).replace(",", " "))
        count += len(track)
    _write(root, path)
    return count


def _ground(scenario: Scenario) -> Callable[[float, float], float]:
    """The height of the ground at a place; that of flat ground if the map is gone."""
    try:
        hills = terrain(scenario)
    except ConfigError:
        hills = None
    return (lambda _east_m, _north_m: 0.0) if hills is None else hills.height_m


def _tracks(outcome: Outcome) -> dict[int, list[Posed]]:
    found: dict[int, list[Posed]] = defaultdict(list)
    for record in records_of(outcome.records, Posed):
        found[record.node].append(record)
    return found


def _finds(outcome: Outcome) -> list[Confirmed | PlacedInside | PlacedAmong]:
    return list(records_of(outcome.records, Confirmed, PlacedInside, PlacedAmong))


def _said(record: Confirmed | PlacedInside | PlacedAmong) -> str:
    where = ""
    if not isinstance(record, Confirmed):
        where = ", inside a building" if isinstance(record, PlacedInside) else ", among people there"
    return f"survivor {record.survivor}{where}"


def _on_earth(scenario: Scenario, east_m: float, north_m: float) -> Geodetic:
    return to_geodetic(Enu(east_m, north_m, 0.0), Geodetic(*scenario.world.origin_deg, 0.0))


def _degrees(scenario: Scenario, east_m: float, north_m: float) -> dict[str, str]:
    at = _on_earth(scenario, east_m, north_m)
    return {"lat": f"{at.lat_deg:.7f}", "lon": f"{at.lon_deg:.7f}"}


def _coordinate(scenario: Scenario, east_m: float, north_m: float, up_m: float = 0.0) -> str:
    at = _on_earth(scenario, east_m, north_m)
    return f"{at.lon_deg:.7f},{at.lat_deg:.7f},{up_m:.2f}"


def _instant(outcome: Outcome, t_ns: int) -> str:
    seconds, rest_ns = divmod(outcome.epoch_unix_ns + t_ns, S)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest_ns // 1_000_000:03d}Z"


def _placemark(parent: Xml.Element, name: str) -> Xml.Element:
    mark = Xml.SubElement(parent, "Placemark")
    _text(mark, "name", name)
    return mark


def _text(parent: Xml.Element, name: str, text: str) -> None:
    Xml.SubElement(parent, name).text = text


def _write(root: Xml.Element, path: Path) -> None:
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            Xml.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)
