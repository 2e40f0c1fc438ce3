"""Notes on a scenario, for its author: what it asks for and will not come about, what it makes risky, and what had to
be guessed. No run is refused because of a note.
"""

import math
import re
from collections.abc import Iterator
from typing import Final, get_args

from fanet_mw.errors import ConfigError
from fanet_mw.graph.topology import levels, within_range
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.faults import AnyFault, BatteryFault, CrashFault, RestoreFault, StopFault
from fanet_mw.scenario.tables.radio import CHANNELS, Radio
from fanet_mw.scenario.tables.routing import PROTOCOLS
from fanet_mw.scenario.tables.sections import Section, meanings
from fanet_mw.scenario.tables.world import FASTEST_AIR_M_S
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_plan import MOST_PLACES

_NAMED: Final = 3
"""A note names at most this many things, and gives the number of the others."""
_ONLY_WITH: Final = re.compile(r"`\w+`(?:(?:, | and |, and )`\w+`)*: ")
"""How the documentation of a key begins that has an effect with some keys, or choices of a key, only: `spiral`: ..."""
_BUT: Final = re.compile(r"(?:all|every) (\w+?)s? but `(\w+)`", re.IGNORECASE)
"""How the documentation of a key excludes one choice of another key: all models but `static`."""
_WORDS: Final = re.compile(r"`(\w+)`")
_OFF: Final = ("none", "", False, None)
"""The values with which a key switches something off."""
_BETWEEN_BANDS_MHZ: Final = 3700.0
"""A lower frequency is of the band at 2.4 GHz, a higher one of that at 5 GHz."""
_CLUSTERED: Final = frozenset({"clustered"})
"""The protocols that read the table `clusters`."""
_LEVEL_M: Final = 3.0
"""The heights of UAVs that cannot know of each other should be at least so far apart."""
_SIGMAS: Final = 2.0
"""Pads should be so far apart that two receivers may differ by so many standard deviations of their difference."""


def notes(scenario: Scenario) -> list[str]:
    """All notes on a scenario, one sentence each; empty if there are none."""
    kinds = (
        _after_the_end, _crossed_faults, _without_effect, _without_place, _too_long, _still_waves, _beyond_the_vehicle,
        _close_pads, _low_ceiling, _high_roofs, _empty_batteries, _out_of_reach, _outside_the_area, _odd_band,
        _wide_formation, _keeping_clear_of_nobody, _guessed,
    )  # fmt: skip
    return [note for kind in kinds for note in kind(scenario)]


def _after_the_end(scenario: Scenario) -> Iterator[str]:
    """Faults, orders, jumps of clocks and packets whose instants are after the end of the run."""
    instants = {f"faults.{index}.at_s": fault.at_s for index, fault in enumerate(scenario.faults)}
    instants |= {f"orders.{index}.at_s": order.at_s for index, order in enumerate(scenario.orders)}
    instants |= {f"clock.jumps.{index}.1": at_s for index, (_, at_s, _) in enumerate(scenario.clock.jumps)}
    for key, at_s in instants.items():
        if at_s >= scenario.duration_s:
            yield f"{key} = {at_s:g}: after the end, duration_s = {scenario.duration_s:g}"
    begins_s, ends_s = (instant / S for instant in scenario.traffic_window_ns)
    for name, traffic in scenario.traffic_classes.items():
        start_s = begins_s if traffic.start_s is None else traffic.start_s
        if traffic.arrivals != "none" and start_s >= ends_s:
            yield f"{name}: start_s = {start_s:g}, after the last packet, duration_s - drain_s = {ends_s:g}"
        elif late := [at_s for at_s, _ in traffic.packets if start_s + at_s >= ends_s]:
            yield (
                f"{name}: {len(late)} of {len(traffic.packets)} packets come too late to be sent, from "
                f"{start_s + min(late):g} s on; duration_s - drain_s = {ends_s:g}"
            )


def _crossed_faults(scenario: Scenario) -> Iterator[str]:
    """Faults that end another one because neither was given a label, ends of faults that are none, and lasting ones."""
    standing: dict[str, tuple[int, AnyFault, float]] = {}
    for index, fault in sorted(enumerate(scenario.faults), key=lambda entry: entry[1].at_s):
        label = fault.control().label
        if isinstance(fault, RestoreFault):
            if label and label not in standing:
                known = sorted({each.control().label for each in scenario.faults if each.kind != "restore"})
                yield f"faults.{index}.label = {label!r}: ends no fault, whose labels are {', '.join(known) or 'none'}"
            standing = {each: kept for each, kept in standing.items() if label and each != label}
            continue
        if isinstance(fault, CrashFault | BatteryFault) and fault.for_s:
            yield f"faults.{index}.for_s = {fault.for_s:g}: no effect; a {fault.kind} is for good"
        ends_s = fault.at_s + fault.for_s if fault.for_s else math.inf
        earlier, other, until_s = standing.get(label, (index, fault, 0.0))
        if (
            until_s > fault.at_s
            and not (other.label and fault.label)
            and (until_s > ends_s or not _alike(other, fault))
        ):
            yield (
                f"faults.{index} ends faults.{earlier} at {fault.at_s:g} s: both have the label {label}; "
                "give one of them a label of its own"
            )
        standing.pop(label, None)
        if not isinstance(fault, CrashFault | BatteryFault | StopFault):  # these end by no other
            standing[label] = index, fault, ends_s


def _alike(one: AnyFault, other: AnyFault) -> bool:
    """True for two faults of one kind of which the later may be meant to take the place of the earlier."""
    return one.kind == other.kind and (one.kind not in ("jam", "partition") or one.at_s != other.at_s)


def _without_effect(scenario: Scenario) -> Iterator[str]:
    """Keys that were set and have no effect with what other keys choose, as the documentation of each key says."""
    protocol = scenario.routing.protocol
    if protocol in PROTOCOLS and protocol not in _CLUSTERED and scenario.mission.formation == "none":
        unused = list(_changed(scenario.clusters))
        if unused:
            yield f"clusters.{', clusters.'.join(unused)}: no effect with routing.protocol = {protocol!r}"
    if protocol in PROTOCOLS and protocol != "rounds" and (unused := list(_changed(scenario.rounds))):
        yield f"rounds.{', rounds.'.join(unused)}: no effect with routing.protocol = {protocol!r}"
    for table in ("nodes", "routing", "clusters", "radio", "mobility", "clock", "world", "traffic", "mission"):
        section = getattr(scenario, table)
        unused_by: dict[str, list[str]] = {}
        for key in _changed(section):
            for other in _prevented_by(section, key):
                if _is_given(section, key):
                    unused_by.setdefault(other, []).append(f"{table}.{key}")
        for other, keys in unused_by.items():
            yield f"{', '.join(keys)}: no effect with {table}.{other} = {getattr(section, other)!r}"


def _prevented_by(section: Section, key: str) -> Iterator[str]:
    """The keys of the table whose values leave this one without an effect."""
    fields, documentation = type(section).model_fields, meanings(type(section)).get(key, "")
    said = _ONLY_WITH.match(documentation)
    wanted = set(_WORDS.findall(said[0])) if said else set()
    if wanted and wanted <= fields.keys() and all(getattr(section, other) in _OFF for other in wanted):
        yield from sorted(wanted)
    if (but := _BUT.search(documentation)) and getattr(section, but[1], None) == but[2]:
        yield but[1]
    for other, choice in fields.items():
        known = {*get_args(choice.annotation), *(n for m in choice.metadata for n in getattr(m, "ours", ()))}
        value = getattr(section, other)
        if other != key and wanted and wanted <= known and value in known and value not in wanted:
            yield other


def _is_given(section: Section, key: str) -> bool:
    """False for a value that follows from other keys of the table."""
    others = {name: getattr(section, name) for name in _changed(section) if name != key}
    try:
        return bool(getattr(type(section)(**others), key) != getattr(section, key))
    except ValueError:  # without it the others are not allowed
        return True


def _without_place(scenario: Scenario) -> Iterator[str]:
    """UAVs beyond those that the plan of a search can name."""
    more = scenario.nodes.count - MOST_PLACES
    if scenario.mission.search != "none" and more > 0:
        yield (
            f"nodes.count = {scenario.nodes.count}: the plan of a search has {MOST_PLACES} places; {more} of the UAVs "
            "will get none, wait where they start, and fly to survivors only"
        )


def _too_long(scenario: Scenario) -> Iterator[str]:
    """A formation in which packets have more hops to make than they may."""
    if scenario.mission.search == "none":
        return
    from agents.mission.searcher import formation  # other scenarios are checked without UAVs' programs

    limit, count = scenario.routing.hop_limit, scenario.nodes.count
    pattern = formation(scenario, count)
    if pattern is not None:
        tied = {place: pattern.tethers(place, 0.0) for place in range(pattern.places)}
        hops = max(max(levels(tied, place).values()) for place in tied)
        if hops > limit:
            yield (
                f"routing.hop_limit = {limit}: the formation of {count} UAVs is up to {hops} hops long, so packets "
                "of one end do not reach the other one"
            )


def _still_waves(scenario: Scenario) -> Iterator[str]:
    """Fading that never changes."""
    radio = scenario.radio
    if radio.fading != "none" and not radio.scatterer_speed_m_s and scenario.mobility.model == "static":
        yield (
            f"radio.fading = {radio.fading!r}: nothing moves, so each link keeps one gain for the whole run; "
            "radio.scatterer_speed_m_s lets them change"
        )


def _beyond_the_vehicle(scenario: Scenario) -> Iterator[str]:
    """A speed that the vehicle cannot fly, or not against the wind."""
    world, asked_m_s = scenario.world, scenario.mobility.speed_m_s
    airspeed_m_s, most_m_s = asked_m_s + math.hypot(*world.wind_m_s), FASTEST_AIR_M_S[world.vehicle]
    if world.engine == "rotors" and scenario.mobility.model != "static" and airspeed_m_s > most_m_s:
        against = " against the wind" if any(world.wind_m_s) else ""
        yield (
            f"mobility.speed_m_s = {asked_m_s:g}: world.vehicle = {world.vehicle} flies at most "
            f"{most_m_s:g} m/s through the air, and needs {airspeed_m_s:g}{against}"
        )


def _out_of_reach(scenario: Scenario) -> Iterator[str]:
    """Nodes that hear nobody where they start: any if they rest, otherwise only all of them together."""
    radio, count = scenario.radio, scenario.node_count
    if radio.channel not in CHANNELS or count < 2:
        return
    from sim.world.environment.layout import positions

    range_m = radio.range_m if radio.channel == "range" else _heard_m(radio)
    places = {NodeId(node): at for node, at in enumerate(positions(scenario), 1)}
    alone = [node for node, near in within_range(places, range_m=range_m, reaches=scenario.reaches).items() if not near]
    if alone and (len(alone) == count or scenario.mobility.model == "static"):
        said = (
            f"radio.range_m = {range_m:g}"
            if radio.channel == "range"
            else f"radio.channel = {radio.channel!r} reaches {round(range_m, 1):g} m"
        )
        yield f"{said}: {len(alone)} of {count} nodes hear nobody where they start"


def _heard_m(radio: Radio) -> float:
    """How far a lucky frame is heard: with two standard deviations of shadowing and a gain of fading that is rare."""
    from emulator.channel.fading import lift
    from emulator.channel.link_budget import heard_m

    return heard_m(radio, gain_dbi=_SIGMAS * radio.shadowing_db + 10 * math.log10(lift(radio)))


def _outside_the_area(scenario: Scenario) -> Iterator[str]:
    """Most UAVs start beyond the area in which they are to fly, and not from a base beside it."""
    world = scenario.world
    if scenario.mobility.model == "static" or any(world.base_m):
        return
    from sim.world.environment.layout import positions

    starts = positions(scenario)[: scenario.nodes.count]
    beyond = [at for at in starts if max(abs(at.east), abs(at.north)) > world.area_m / 2]
    if 2 * len(beyond) > scenario.nodes.count:
        yield f"world.area_m = {world.area_m:g}: {len(beyond)} of {scenario.nodes.count} nodes start outside the area"


def _odd_band(scenario: Scenario) -> Iterator[str]:
    """A frequency outside the band of the standard: DSSS, CCK and ERP are of 2.4 GHz (802.11-2020, 15, 16 and 18), and
    `a` is of 5 GHz (17).
    """
    radio = scenario.radio
    low = radio.frequency_mhz < _BETWEEN_BANDS_MHZ
    if radio.channel != "range" and (radio.standard == "a") == low:
        yield (
            f"radio.frequency_mhz = {radio.frequency_mhz:g}: IEEE 802.11{radio.standard} is sent at "
            f"{'5 GHz' if low else '2.4 GHz'}"
        )


def _close_pads(scenario: Scenario) -> Iterator[str]:
    """Pads so near to each other that UAVs that do not see them may land on each other. The error that all receivers
    have in common is left out, because it moves all landings alike.
    """
    nodes, search = scenario.nodes, scenario.mission.search
    if not nodes.on_ground or nodes.layout == "explicit" or search == "none" or scenario.sensors.pad_hz:
        return
    from agents.mission.flight.return_home import LANDS_WITHIN_M

    own_m = math.hypot(scenario.sensors.gps_bias_m, scenario.world.gps_sigma_m)
    least_m = 2 * LANDS_WITHIN_M + _SIGMAS * math.sqrt(2) * own_m
    if nodes.spacing_m < least_m:
        yield (
            f"nodes.spacing_m = {nodes.spacing_m:g}: pads nearer to each other than {least_m:.1f} m; UAVs that come "
            "home by such receivers may land on each other"
        )


def _low_ceiling(scenario: Scenario) -> Iterator[str]:
    """A ceiling too low for UAVs that cannot know of each other to have own heights, or for those that return."""
    mission, mobility, altitude_m = scenario.mission, scenario.mobility, scenario.nodes.altitude_m
    if mission.search == "none":
        return
    from agents.mission.flight.flight import CEILING_MARGIN_M
    from agents.mission.flight.return_home import HOME_HIGHER_M
    from agents.mission.search_formation.roll_call import MUTE_LEVELS

    least_m = altitude_m + HOME_HIGHER_M + MUTE_LEVELS * _LEVEL_M + CEILING_MARGIN_M
    if mission.ceiling_m < least_m:
        yield (
            f"mission.ceiling_m = {mission.ceiling_m:g}: UAVs that nobody hears need heights {_LEVEL_M:g} m apart "
            f"above those who fly home; over nodes.altitude_m = {altitude_m:g} that needs {least_m:g} m"
        )
    highest_m = mobility.return_height_m + (scenario.nodes.count - 1) * mobility.return_step_m
    if (mobility.return_after_s or mobility.geofence == "return") and highest_m > mission.ceiling_m:
        yield (
            f"mobility.return_height_m = {mobility.return_height_m:g}, return_step_m = {mobility.return_step_m:g}: UAV "
            f"{scenario.nodes.count} returns at {highest_m:g} m, above mission.ceiling_m = {mission.ceiling_m:g}"
        )


def _high_roofs(scenario: Scenario) -> Iterator[str]:
    """Buildings higher than UAVs fly: they cut links at once, which a bound that counts on distances does not
    foresee.
    """
    world, altitude_m = scenario.world, scenario.nodes.altitude_m
    protocol = scenario.routing.protocol
    promises = protocol == "rounds" or (protocol in _CLUSTERED and scenario.clusters.relay == "scheduled")
    if not promises or not scenario.buildings_cut_links or scenario.mobility.model == "static":
        return
    if protocol == "rounds" and scenario.mission.search != "none" and scenario.sensors.map_share == 1:
        return  # UAVs foresee by their maps whom a building will hide
    if world.buildings_geojson:
        from sim.world.environment.obstacles import town_of

        try:
            roofs_m = [footprint.height for footprint in town_of(world).boxes]
        except ConfigError:
            return  # whoever builds the world says what is wrong with the file
    elif isinstance(world.buildings, tuple):
        roofs_m = [building[4] for building in world.buildings]
    else:
        roofs_m = [world.building_height_m[1]] if world.buildings else []
    if (highest_m := max(roofs_m, default=0.0)) > altitude_m:
        yield (
            f"nodes.altitude_m = {altitude_m:g}: below the roofs of buildings, up to {highest_m:g} m high, which cut "
            'links (radio.channel = "range") without a warning: stated bounds may not hold, and such a run is not valid'
        )


def _empty_batteries(scenario: Scenario) -> Iterator[str]:
    """Batteries that have no charge to spend for a search."""
    most, reserve = scenario.world.charge[1], scenario.mission.reserve_charge
    if scenario.mission.search != "none" and scenario.sensors.battery_hz and most <= reserve:
        yield (
            f"world.charge: at most {most:g}, not more than mission.reserve_charge = {reserve:g}, with which UAVs must "
            "come home: nobody searches"
        )


def _wide_formation(scenario: Scenario) -> Iterator[str]:
    """Waypoints of the leader at which others of the formation would be beyond the geofence."""
    mission = scenario.mission
    if mission.formation == "none" or not mission.route_m:
        return
    from agents.mission.formation_flight.flight_place import APART
    from sim.world.mobility.geofence import fence_of

    east_m, north_m = fence_of(scenario).reach_m
    wide_m = mission.formation_m * (1 + APART if scenario.clusters.count > 1 else 1)
    for index, (east, north) in enumerate(mission.route_m):
        if abs(east) + wide_m > east_m or abs(north) + wide_m > north_m:
            yield (
                f"mission.route_m.{index} = [{east:g}, {north:g}]: places of the formation are up to {wide_m:g} m from "
                f"the leader, some beyond the geofence at [+-{east_m:g}, +-{north_m:g}], where UAVs stop"
            )


def _keeping_clear_of_nobody(scenario: Scenario) -> Iterator[str]:
    """UAVs that fly to survivors by the paper's rule, and that nothing keeps clear of each other."""
    mission = scenario.mission
    by_rule = (mission.search, mission.formation, scenario.mobility.model) == ("none", "none", "onboard")
    if by_rule and mission.survivors and not mission.collision_horizon_s:
        yield (
            "mission.search = 'none': UAVs stay where they start until they fly to a survivor, all at one height, and "
            "with mobility.model = 'onboard' they keep clear of each other by mission.collision_horizon_s alone, "
            "which is 0"
        )


def _changed(section: Section) -> Iterator[str]:
    """The keys of a table with another value than by default."""
    for key, field in type(section).model_fields.items():
        if getattr(section, key) != field.get_default(call_default_factory=True):
            yield key


def _guessed(scenario: Scenario) -> Iterator[str]:
    """Heights that map files do not state, or state oddly."""
    world = scenario.world
    if not (world.buildings_geojson or world.heightmap):
        return
    from sim.world.environment.obstacles import heightmap_of, town_of  # they bring numpy

    try:
        if world.heightmap and (odd := heightmap_of(world).odd_low):
            yield f"world.heightmap: {odd}"
        if not world.buildings_geojson:
            return
        town = town_of(world)
    except ConfigError:
        return  # whoever builds the world says what is wrong with the file
    for one, several, found in (
        ("building of a height that was guessed", "buildings of heights that were guessed", town.guessed),
        ("outline that encloses nothing", "outlines that enclose nothing", town.broken),
    ):
        if found:
            others = f"; and {len(found) - _NAMED} others" if len(found) > _NAMED else ""
            what = one if len(found) == 1 else several
            yield f"world.buildings_geojson: {len(found)} {what}: {'; '.join(found[:_NAMED])}{others}"
    if town.untold:
        default_m = sum(world.building_height_m) / 2
        what = "building states" if town.untold == 1 else "buildings state"
        yield f"world.buildings_geojson: {town.untold} {what} no height: taken as {default_m:g} m"
