"""Checks that span several tables of a scenario; each table checks itself (`tables/sections.py`).

All problems are found, not only the first; each is a sentence with the keys, their values and the bound.
"""

from __future__ import annotations  # `Scenario` imports this module: to it, the name is a type only

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from fanet_mw.bus.radio_control import EVERY, Degrade, Mishap, MishapKind, Partition, Restore, nodes_of
from fanet_mw.orders import wrong
from fanet_mw.scenario.tables.world import NO_AID_S
from fanet_mw.units import MAX_NODES, MS

if TYPE_CHECKING:
    from fanet_mw.scenario import Scenario, Traffic

MESSAGE_BYTES: Final = {
    "FANET_ROUTE": 36, "positions": 61, "COLLISION": 31, "FANET_BEACON": 33, "FANET_SCHEDULE": 266,
    "FANET_SURVIVOR": 43, "FANET_DIGEST": 255, "FANET_PLACES": 189, "FANET_LINKS": 240,
    "FANET_LOADS": 126,
}  # fmt: skip
"""The lengths of messages on the air, their MAVLink frame included (docs/reference/air-format.md); `positions` are
HEARTBEAT and GLOBAL_POSITION_INT, with which every hello begins. The air format itself is not known here: the emulator
reads scenarios too, and to it frames are bytes."""
_SCHEDULE_PLACES: Final = 2
"""The number of FANET_PLACES messages that go with one full FANET_SCHEDULE."""
_TAKEN: Final = frozenset(("report", "warning", "telemetry", "receipt", "joined", "formation"))
"""The names that other applications have in a trace, which traffic classes may not use."""
_FARTHEST_BASE: Final = 2.0
"""The greatest distance of the base from the middle of the area, along each axis, in widths of the area."""
_FARTHEST_POST: Final = 10.0
"""The greatest distance of the post on the ground from the middle of the area, likewise."""
_RIVALS: Final = ("aodv", "olsr", "dsdv", "geographic")
_MOST_CLUSTERS_ABREAST: Final = 7
"""The greatest number of clusters side by side: a circle around one head has room for six more heads."""
_MOVING_MODELS: Final = ("formation", "random_waypoint", "crossing")
"""The mobility models of the world by which UAVs move without being commanded."""
_LINKS: Final = 36
_MOST_LINKS_MESSAGES: Final = 4
_MOST_IN_ROUNDS: Final = 488
"""The nodes about which one FANET_HEARD can tell (64 bytes, of which 3 for node and epoch)."""
_HELLO_IN_TURN: Final = 36 + 61 + 255
"""A hello with positions and one message of its digest."""
_RIVAL_FRAME_BYTES: Final = 256
"""Control messages of a fixed length must fit a frame of this length; longer ones are divided."""


def disagreements(scenario: Scenario) -> Sequence[str]:
    """One sentence for each problem; empty if the tables agree."""
    found = []
    count = scenario.nodes.count
    if scenario.warmup_s + scenario.drain_s >= scenario.duration_s:
        found.append(
            f"warmup_s + drain_s = {scenario.warmup_s + scenario.drain_s:g} "
            f"must be < duration_s = {scenario.duration_s:g}"
        )
    classes = (scenario.traffic, *scenario.further_traffic)
    for index, traffic in enumerate(classes):
        found += _impossible_traffic(scenario, traffic, f"traffic.{index}" if len(classes) > 1 else "traffic")
    names = [*scenario.traffic_classes]
    if len(names) <= len(scenario.further_traffic) or _TAKEN & set(names):
        found.append(f"traffic.name: {', '.join(names)} must be different, and none of {', '.join(sorted(_TAKEN))}")
    if scenario.clock.sync == "beacons" and not scenario.routing.hello_interval_s:
        found.append('clock.sync = "beacons" needs hellos: routing.hello_interval_s > 0')
    strangers = sorted(node for node in scenario.sensors.image_nodes if node > count)
    if strangers:
        found.append(f"sensors.image_nodes: {', '.join(map(str, strangers))} must be <= nodes.count = {count}")
    found += [
        f"clock.jumps names node {node}, which must be <= nodes.count = {count}"
        for node, _, _ in scenario.clock.jumps
        if node > count
    ]
    found += _too_frequent_readings(scenario)
    found += _too_rare_fixes(scenario)
    found += _too_small_frames(scenario)
    found += _unkept_deadline(scenario)
    found += _blind_warnings(scenario)
    found += _deaf_search(scenario)
    found += _impossible_formation(scenario)
    found += _motionless_search(scenario)
    found += _too_high_search(scenario)
    found += _unasked_return(scenario)
    found += _never_taking_off(scenario)
    found += _impossible_faults(scenario)
    found += [
        f"applications.{index}.nodes names node {node}, which must be <= {scenario.last_id}"
        for index, entry in enumerate(scenario.applications)
        for node in (() if entry.nodes == "all" else entry.nodes)
        if node > scenario.node_count
    ]
    found += _impossible_places(scenario)
    found += _impossible_orders(scenario)
    found += _wrong_for_rivals(scenario)
    found += _impossible_rounds(scenario)
    if scenario.routing.protocol == "clustered":
        clusters = scenario.clusters
        if not scenario.routing.hello_interval_s:
            found.append('routing.protocol = "clustered" needs hellos: routing.hello_interval_s > 0')
        if clusters.count >= max(2, count):
            found.append(f"clusters.count = {clusters.count} must be < nodes.count = {count}")
        if clusters.guard_ms != "auto" and clusters.guard_ms * MS >= clusters.slot_ns:
            found.append(
                f"clusters.guard_ms = {clusters.guard_ms:g} must be < the slot, flooding_period_s / count = "
                f"{clusters.slot_ns / MS:g} ms"
            )
    return found


def _too_rare_fixes(scenario: Scenario) -> Iterator[str]:
    """A flight controller that knows of no fix for `NO_AID_S` lands."""
    world, least_hz = scenario.world, 1 / NO_AID_S
    by_fixes = world.navigation == "estimated" and not scenario.sensors.inertial_hz
    if by_fixes and scenario.mobility.model == "onboard" and world.gps_hz < least_hz:
        yield (
            f"world.gps_hz = {world.gps_hz:g} must be >= {least_hz:g}: a flight controller without any fix for "
            f'{NO_AID_S:g} s lands; world.navigation = "perfect" or optical flow (sensors.inertial_hz) needs none'
        )


def _too_frequent_readings(scenario: Scenario) -> Iterator[str]:
    most_hz = 1000 / scenario.world.tick_ms
    rates = {f"sensors.{key}": value for key, value in scenario.sensors if key.endswith("_hz")}
    for key, rate_hz in {"world.gps_hz": scenario.world.gps_hz, **rates}.items():
        if rate_hz > most_hz * (1 + 1e-9):
            yield (
                f"{key} = {rate_hz:g} must be <= {most_hz:g}: one reading for each world.tick_ms = "
                f"{scenario.world.tick_ms:g}"
            )
    scan_s, tick_s = scenario.mission.scan_interval_s, scenario.world.tick_ms / 1000
    if scenario.mission.survivors and scan_s < tick_s * (1 - 1e-9):
        yield f"mission.scan_interval_s = {scan_s:g} must be >= world.tick_ms, {tick_s:g} s"


def _impossible_rounds(scenario: Scenario) -> Iterator[str]:
    """Rounds without hellos, of too many nodes, or with turns too short for what must go in them."""
    count, turn_bytes = scenario.node_count, scenario.rounds.turn_bytes
    if scenario.routing.protocol != "rounds":
        return
    if not scenario.routing.hello_interval_s:
        yield 'routing.protocol = "rounds" needs hellos: routing.hello_interval_s > 0'
    if count > _MOST_IN_ROUNDS:
        yield f'routing.protocol = "rounds" has turns for at most {_MOST_IN_ROUNDS} nodes, and there are {count}'
    in_turns = (each for each in scenario.traffic_classes.values() if each.priority != "bulk")
    every = in_turns if scenario.rounds.bulk_share else scenario.traffic_classes.values()
    reports = [scenario.mission.report_bytes] if scenario.mission.survivors else []
    least = max(_HELLO_IN_TURN, *reports, *(each.longest_bytes for each in every), 0)
    if turn_bytes < least:
        yield (
            f"rounds.turn_bytes = {turn_bytes} must be >= {least}: hellos, reports and all packets that are not bulk "
            "must fit a turn (with rounds.bulk_share = 0 bulk, too)"
        )


def _impossible_traffic(scenario: Scenario, traffic: Traffic, key: str) -> Iterator[str]:
    """Nodes that do not exist, packets that are too long, and classes for which a timetable has no room."""
    count, most = scenario.nodes.count, scenario.radio.max_frame_bytes
    if traffic.destination != "all" and traffic.destination > scenario.node_count:
        yield f"{key}.destination = {traffic.destination} must be <= {scenario.last_id}"
    if isinstance(traffic.sources, int) and traffic.sources > count:
        yield f"{key}.sources = {traffic.sources} must be <= nodes.count = {count}"
    elif traffic.sources == count and traffic.destination in scenario.uav_ids:
        yield (
            f"{key}.sources = {count} must be <= {count - 1}, the nodes that are not {key}.destination = "
            f"{traffic.destination}"
        )
    for name, ids in (("sources", traffic.sources), ("targets", traffic.targets)):
        if isinstance(ids, tuple) and any(i > scenario.node_count for i in ids):
            yield f"{key}.{name} = {list(ids)} must be node ids <= {scenario.last_id}"
    if isinstance(traffic.sources, tuple) and traffic.destination in traffic.sources:
        yield (
            f"{key}.sources = {list(traffic.sources)} must not name {key}.destination = {traffic.destination}: "
            "no node sends to itself"
        )
    longest = traffic.longest_bytes
    if longest > most:
        yield f"{key}.payload_bytes = {longest} must be <= radio.max_frame_bytes = {most}"
    if (scenario.routing.protocol, scenario.clusters.relay) == ("clustered", "scheduled"):
        room = scenario.traffic.payload_bytes
        if longest > room or traffic.priority != "bulk":
            yield (
                f"{key}.payload_bytes = {longest}, priority = {traffic.priority}: a timetable "
                f'(clusters.relay = "scheduled") has room for bulk of the first class, {room} bytes'
            )


def _too_small_frames(scenario: Scenario) -> Iterator[str]:
    """Messages that cannot be divided and do not fit one frame."""
    most, relay = scenario.radio.max_frame_bytes, scenario.clusters.relay
    clustered = scenario.routing.protocol == "clustered"
    size, least = MESSAGE_BYTES, dict[str, int]()
    if scenario.routing.hello_interval_s:
        hello = size["positions"]
        if clustered:
            hello += size["FANET_BEACON"]
            hello += size["FANET_DIGEST"] if scenario.repair_ns else 0
        least["hellos"] = hello
    if clustered:
        places = _SCHEDULE_PLACES * size["FANET_PLACES"] if relay == "scheduled" else 0
        loads = size["FANET_LOADS"] if scenario.hears_load else 0
        least["schedules"] = size["FANET_SCHEDULE"] + places + loads
    if clustered and scenario.measures_links:
        pairs = scenario.node_count * (scenario.node_count - 1) // 2
        least["links of timetables"] = min(_MOST_LINKS_MESSAGES, -(-pairs // _LINKS)) * size["FANET_LINKS"]
    if scenario.mission.survivors:
        padded = scenario.mission.report_bytes - size["FANET_ROUTE"]
        least["survivor reports"] = max(size["FANET_SURVIVOR"], padded)
    if scenario.mission.collision_horizon_s:
        least["warnings"] = size["COLLISION"]
    for what, inner in least.items():
        whole = size["FANET_ROUTE"] + inner
        if whole > most:
            yield f"radio.max_frame_bytes = {most} must be >= {whole} for {what}"


def _deaf_search(scenario: Scenario) -> Iterator[str]:
    mission, hello_s = scenario.mission, scenario.routing.hello_interval_s
    if mission.lost_link_s and (not hello_s or mission.lost_link_s <= hello_s):
        yield (
            f"mission.lost_link_s = {mission.lost_link_s:g} needs hellos in shorter intervals, 0 < "
            f"routing.hello_interval_s = {hello_s:g} < {mission.lost_link_s:g}"
        )


def _impossible_formation(scenario: Scenario) -> Iterator[str]:
    """Missing preconditions of formation flight by clusters."""
    mission = scenario.mission
    if mission.formation == "none":
        return
    wanted = f"mission.formation = {mission.formation!r} needs"
    if scenario.mobility.model != "onboard":
        yield f'{wanted} mobility.model = "onboard", not {scenario.mobility.model!r}'
    if mission.search != "none":
        yield f'{wanted} mission.search = "none", not {mission.search!r}'
    if scenario.routing.protocol != "clustered":
        yield f'{wanted} routing.protocol = "clustered", which makes clusters'
    if scenario.clusters.count > _MOST_CLUSTERS_ABREAST:
        yield f"{wanted} clusters.count = {scenario.clusters.count} <= {_MOST_CLUSTERS_ABREAST}"
    if mission.formation_m >= scenario.radio.range_m:
        yield (
            f"mission.formation_m = {mission.formation_m:g}, at which members fly around their head, must be < "
            f"radio.range_m = {scenario.radio.range_m:g}: they would not hear it"
        )
    least_m_s, _ = mission.approach_speeds_m_s
    if scenario.mobility.speed_m_s >= least_m_s:
        yield (
            f"mobility.speed_m_s = {scenario.mobility.speed_m_s:g}, at which the leader flies, must be < "
            f"mission.approach_speed_m_s = {least_m_s:g}, the greatest speed of a UAV: nobody could catch up"
        )


def _too_high_search(scenario: Scenario) -> Iterator[str]:
    mission, altitude_m = scenario.mission, scenario.nodes.altitude_m
    if mission.search != "none" and altitude_m > mission.ceiling_m:
        yield f"nodes.altitude_m = {altitude_m:g} must be <= mission.ceiling_m = {mission.ceiling_m:g}"


def _motionless_search(scenario: Scenario) -> Iterator[str]:
    if scenario.mission.search == "none":
        return
    if not scenario.nodes.altitude_m:
        yield f'mission.search = "{scenario.mission.search}" needs nodes.altitude_m > 0'
    if not scenario.mobility.speed_m_s:
        yield f'mission.search = "{scenario.mission.search}" needs mobility.speed_m_s > 0'


def _unasked_return(scenario: Scenario) -> Iterator[str]:
    """A return of UAVs that follow a mobility model and need no setpoints."""
    mobility = scenario.mobility
    if mobility.model != "onboard" and (mobility.return_after_s or mobility.geofence == "return"):
        yield (
            f"mobility.return_after_s = {mobility.return_after_s:g}, geofence = {mobility.geofence!r}: a return needs "
            f'mobility.model = "onboard", not {mobility.model!r}'
        )


def _never_taking_off(scenario: Scenario) -> Iterator[str]:
    """UAVs that stand on the ground and follow a mobility model, which moves them at the height of their start."""
    model = scenario.mobility.model
    if scenario.nodes.on_ground and model in _MOVING_MODELS:
        yield (
            f"nodes.on_ground = true: UAVs that follow mobility.model = {model!r} do not take off; "
            'it needs "onboard", or "static" and an application that commands them'
        )


def _wrong_for_rivals(scenario: Scenario) -> Sequence[str]:
    """Settings that a hop-by-hop protocol needs or excludes."""
    found = []
    if scenario.routing.protocol in _RIVALS and scenario.radio.max_frame_bytes < _RIVAL_FRAME_BYTES:
        found.append(
            f"radio.max_frame_bytes = {scenario.radio.max_frame_bytes} must be >= {_RIVAL_FRAME_BYTES} for "
            f"routing.protocol = {scenario.routing.protocol}"
        )
    if scenario.routing.address_resolution != "none" and scenario.routing.protocol not in _RIVALS:
        found.append(
            f"routing.address_resolution = {scenario.routing.address_resolution} needs routing.protocol to be one of "
            f"{', '.join(_RIVALS)}, not {scenario.routing.protocol}"
        )
    return found


def _unkept_deadline(scenario: Scenario) -> Sequence[str]:
    """A deadline under a protocol that refuses no packet for it."""
    deadline_s, protocol = scenario.traffic.deadline_s, scenario.routing.protocol
    if deadline_s is None or (protocol, scenario.clusters.relay) == ("clustered", "scheduled"):
        return ()
    if protocol == "rounds" and scenario.rounds.bulk_share and scenario.traffic.priority == "bulk":
        return ()
    return (
        f"traffic.deadline_s = {deadline_s:g} needs a protocol that refuses what would be late: "
        'routing.protocol = "rounds" with bulk in slots (rounds.bulk_share, traffic.priority = "bulk"), or '
        '"clustered" with clusters.relay = "scheduled"',
    )


def _blind_warnings(scenario: Scenario) -> Iterator[str]:
    """Collision warnings without the data from which they are computed, or without room to avoid."""
    mission = scenario.mission
    if not mission.collision_horizon_s:
        return
    wanted = f"mission.collision_horizon_s = {mission.collision_horizon_s:g} needs"
    if not mission.collision_distance_m:
        yield f"{wanted} mission.collision_distance_m > 0"
    if not scenario.routing.hello_interval_s:
        yield f"{wanted} hellos: routing.hello_interval_s > 0"
    if scenario.nodes.altitude_m <= 2 * mission.collision_distance_m:
        yield (
            f"{wanted} room below to avoid: nodes.altitude_m = {scenario.nodes.altitude_m:g} must be > "
            f"2 x mission.collision_distance_m = {2 * mission.collision_distance_m:g}"
        )


def _impossible_places(scenario: Scenario) -> Iterator[str]:
    """A base far from the area, survivors outside of it, or in buildings that do not exist."""
    mission, world = scenario.mission, scenario.world
    farthest_m = _FARTHEST_BASE * world.area_m
    if max(map(abs, world.base_m)) > farthest_m:
        east, north = world.base_m
        yield (
            f"world.base_m = [{east:g}, {north:g}] must be within +-{_FARTHEST_BASE:g} x world.area_m = {farthest_m:g}"
        )
    if max(map(abs, scenario.ground.at_m), default=0.0) > _FARTHEST_POST * world.area_m:
        yield (
            f"ground.at_m = {list(scenario.ground.at_m)} must be within "
            f"+-{_FARTHEST_POST:g} x world.area_m = {_FARTHEST_POST * world.area_m:g}"
        )
    if scenario.ground.at_m and scenario.node_count > MAX_NODES:
        yield f"ground.at_m: nodes.count = {scenario.nodes.count} must be < {MAX_NODES} to leave an id for the post"
    for index, (east, north) in enumerate(mission.survivor_positions_m):
        if max(abs(east), abs(north)) > world.area_m / 2:
            yield (
                f"mission.survivor_positions_m.{index} = [{east:g}, {north:g}] must be within "
                f"+-world.area_m / 2 = {world.area_m / 2:g}"
            )
    if mission.survivors_in == "buildings" and not (world.buildings or world.buildings_geojson):
        yield 'mission.survivors_in = "buildings" needs world.buildings or world.buildings_geojson'
    if mission.survivors_in == "buildings" and mission.survivor_positions_m:
        yield 'mission.survivors_in = "buildings" and mission.survivor_positions_m exclude each other'


def _impossible_orders(scenario: Scenario) -> Iterator[str]:
    """Orders without a post, without a planned search, or to UAVs that do not exist."""
    if scenario.orders and not scenario.ground.at_m:
        yield "orders need a post on the ground that gives them: ground.at_m"
    if scenario.orders and scenario.mission.search == "none":
        yield 'orders need a planned search: mission.search other than "none"'
    for index, entry in enumerate(scenario.orders):
        if (why := wrong(entry.what, uavs=scenario.nodes.count)) is not None:
            yield f"orders.{index}: {why}"


def _impossible_faults(scenario: Scenario) -> Sequence[str]:
    """Faults of nodes that do not exist, and of links from a node to itself."""
    found = []
    count = scenario.nodes.count
    for index, (_, control) in enumerate(scenario.planned_faults):
        most = count if isinstance(control, Mishap) else scenario.node_count
        unknown = [] if isinstance(control, Restore) else [node for node in nodes_of(control) if node > most]
        if unknown:
            bound = f"<= nodes.count = {count}" if isinstance(control, Mishap) else f"<= {scenario.last_id}"
            found.append(f"faults.{index} names node {unknown[0]}, which must be {bound}")
        if isinstance(control, Degrade) and control.src == control.dst != EVERY:
            found.append(f"faults.{index}: src = dst = {control.src} is no link")
        if isinstance(control, Partition) and set(control.group) >= set(scenario.node_ids):
            found.append(
                f"faults.{index}: nodes names all {scenario.node_count} nodes, which leaves nobody on the other side"
            )
        if isinstance(control, Mishap) and control.what is MishapKind.BATTERY and not scenario.drains_batteries:
            found.append(f'faults.{index}: kind = "battery" needs sensors.battery_hz > 0')
    return found
