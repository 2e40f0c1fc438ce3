"""Draws a `SwarmState` in a viser scene. What moves is one batch per kind, so that 45 UAVs cost two messages a frame.

every frame        UAVs with attitude, whose turn it is, the packet that spreads, the selected UAV
twice a second     links by what they delivered, clusters, names
once a second      trails, area covered, survivors, estimates with their uncertainty, faults
"""

import contextlib
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
import viser

from emulator.channel.link_budget import heard_m
from fanet_mw.units import MS, Enu, S
from sim.figures import colors
from sim.observation.surroundings import Surroundings, surroundings
from sim.observation.swarm_state import PacketNow, SwarmState, UavNow
from sim.recording.drawing import FALLEN_COLOR, STATUS_COLORS, attitude, link_color, mode_color
from sim.view import shapes
from sim.view.shapes import Rows, linear, rgb

CLUSTER_COLORS: Final = ("#0072B2", "#CC79A7", "#009E73", "#E69F00", "#56B4E9", "#7b4fb5", "#a0522d", "#5f9ea0")
"""Colors of clusters, in turn; the color-blind can tell the first five apart."""
_NO_CLUSTER: Final = "#888888"
_GROUND: Final = (214, 218, 205)
_COVERED: Final = (164, 196, 158)
_BUILDING: Final = (176, 169, 159)
_FENCE_M: Final = 80.0
_SHOWN_NS: Final = 2 * S
"""The spreading of a packet is stretched, or shortened, to this much swarm time."""
_MOST_THICK: Final = 150.0
"""More links than this are drawn thinner, so that they do not hide the UAVs."""
_SEEN_NS: Final = 150 * MS
"""Turns shorter than this cannot be followed by eye, and are shown at the pace of the packet that spreads."""
_HOLDS_NS: Final = S
_HILLS_EVERY_S: Final = 5
"""The area covered of hills is a mesh of a quarter of a megabyte, and so is drawn more rarely."""
HOP_COLORS: Final = ("#222222", "#D55E00", "#E69F00", "#F0E442", "#CC79A7", "#ffffff")
"""The origin of a packet, then its receivers by hops."""


class Shown(NamedTuple):
    """What of a scene is drawn."""

    links: bool = True
    clusters: bool = True
    trails: bool = True
    coverage: bool = True
    names: bool = True
    turns: bool = True
    spreading: bool = True
    survivors: bool = True


class Scene:
    """The drawing of one swarm in one server."""

    def __init__(self, server: viser.ViserServer, state: SwarmState, *, on_select: Callable[[int], None]) -> None:
        self._server, self.state = server, state
        self._api = server.scene
        self.around: Surroundings = surroundings(state.scenario)
        mission = state.scenario.mission
        self.shown = Shown(coverage=mission.survivors > 0 or mission.search != "none")
        self.clustered = state.scenario.routing.protocol == "clustered"
        """True: UAVs are colored by cluster; otherwise by what they do."""
        self.by_range = False
        """True: links are not known; pairs in the radio's reach are drawn instead."""
        self.selected = 0
        self.jams: dict[str, tuple[float, float, float]] = {}
        """East, north and radius of the areas that were jammed from here."""
        self.target: tuple[float, float] | None = None
        """The place on the map that was clicked."""
        self._chosen: tuple[object, ...] = ()
        """What was chosen to be drawn when it was drawn last."""
        self._nodes: list[int] = []
        self._reach_m = heard_m(state.scenario.radio)
        self._handles: dict[str, Any] = {}
        self._names: dict[str, Any] = {}
        self._covered = -1
        self._half_second = self._second = -1
        self._packet: tuple[tuple[int, int], PacketNow] | None = None
        self._packet_ns = 0
        self._on_select = on_select
        self.size_m = max(6.0, min(40.0, self.around.half_m / 28))
        self._draw_surroundings()

    # --- frames ---------------------------------------------------------------------------------------------------

    def draw(self, t_ns: int, *, all_of_it: bool = False) -> None:
        """Draw the state at an instant; `all_of_it`: also what is otherwise drawn seldom."""
        jams = self.jams.keys() & self.state.faults.keys()
        chosen = (self.shown, self.size_m, self.target, jams)
        all_of_it |= chosen != self._chosen  # time may stand
        self._chosen = chosen
        with self._server.atomic():
            self._draw_uavs()
            self._draw_spreading(t_ns)
            self._draw_turn(t_ns)
            if all_of_it or t_ns * 2 // S != self._half_second:
                self._half_second = t_ns * 2 // S
                self._draw_links()
                self._draw_clusters()
                self._draw_names()
            if all_of_it or t_ns // S != self._second:
                self._second = t_ns // S
                self._draw_trails()
                self._draw_coverage()
                self._draw_survivors()
                self._draw_jams()

    def spreading(self) -> tuple[tuple[int, int], PacketNow] | None:
        return self._packet

    def shown_spread(self, t_ns: int) -> tuple[int, int]:
        """How many have the packet at the instant of its own time that is shown, and that time [ns]."""
        if self._packet is None:
            return 0, 0
        own_ns = self._own_time_ns(t_ns)
        return sum(copy.delay_ns <= own_ns for copy in self._packet[1].copies().values()), own_ns

    def turn_ns(self, t_ns: int) -> int:
        """The instant whose turn is shown: where turns are too short to be seen, that of the packet which spreads."""
        turns = self.state.turns
        short = turns is not None and min((span.length_ns for span in turns.own), default=_SEEN_NS) < _SEEN_NS
        if not short or self._packet is None or not self.shown.spreading:
            return t_ns
        return self._packet[1].born_ns + self._own_time_ns(t_ns)

    # --- what stays -----------------------------------------------------------------------------------------------

    def _draw_surroundings(self) -> None:
        around, half = self.around, self.around.half_m
        if around.hills is None:
            far = half * 1.6
            corners = np.array([(x, y, -0.6) for y in (-far, far) for x in (-far, far)], np.float32)
            self._api.add_mesh_simple(
                "/world/ground", corners, np.array([[0, 1, 3], [0, 3, 2]]), color=_GROUND, receive_shadow=False
            )
            lines = [
                ((at, -half, 0.0), (at, half, 0.0)) if along else ((-half, at, 0.0), (half, at, 0.0))
                for along in (True, False)
                for at in np.arange(-half, half + 1e-6, _step_m(half))
            ]
            self._api.add_line_segments(
                "/world/grid", np.array(lines, np.float32), (190, 194, 182), thickness=1.0, thickness_units="screen"
            )
        else:
            self._api.add_mesh_simple(
                "/world/ground", around.corners.astype(np.float32), around.triangles, color=_GROUND, flat_shading=True
            )
        for text, east, north in (("N", 0.0, half * 1.05), (f"{2 * half:g} m", half, -half * 1.05)):
            self._api.add_label(f"/world/label-{text}", text, position=around.on_ground(Enu(east, north, 0.0)))
        if around.boxes:
            vertices, faces = shapes.box()
            self._api.add_batched_meshes_simple(
                "/world/buildings", vertices, faces,
                np.array([(math.cos(b.yaw / 2), 0, 0, math.sin(b.yaw / 2)) for b in around.boxes], np.float32),
                np.array([(b.east, b.north, b.roof / 2) for b in around.boxes], np.float32),
                batched_scales=np.array([(b.width, b.depth, b.roof) for b in around.boxes], np.float32),
                batched_colors=linear(_BUILDING), flat_shading=True,
            )  # fmt: skip
        for number, outline in enumerate(around.no_fly):
            low = np.array([around.on_ground(Enu(*corner, 0.0), above_m=2.0) for corner in outline], np.float32)
            high = low + np.array([0, 0, _FENCE_M], np.float32)
            around_it = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in (low, high)]
            segments = np.concatenate([*around_it, np.stack([low, high], axis=1)])
            self._api.add_line_segments(
                f"/world/no-fly-{number}", segments, rgb(colors.RED), thickness=2.0, thickness_units="screen"
            )

    # --- every frame ----------------------------------------------------------------------------------------------

    def _draw_uavs(self) -> None:
        uavs = self.state.uavs
        nodes = sorted(uavs)
        if not nodes:
            return
        places = np.array([uavs[node].position for node in nodes], np.float32)
        turned = np.array([attitude(uavs[node]) for node in nodes], np.float32)
        post = self.state.scenario.post
        tints = linear([rgb(FALLEN_COLOR) if node == post else self._tint(uavs[node]) for node in nodes])
        sizes = np.array([self.size_m * (1.7 if uavs[node].role == "head" else 1.0) for node in nodes], np.float32)
        handle = self._handles.get("uavs")
        if handle is None or nodes != self._nodes:
            self._nodes = nodes
            vertices, faces = shapes.quadrotor()
            handle = self._handles["uavs"] = self._api.add_batched_meshes_simple(
                "/uavs", vertices, faces, turned, places, batched_scales=sizes, batched_colors=tints, side="double",
                lod="off", cast_shadow=False,
            )  # fmt: skip
            handle.on_click(self._clicked)
        else:
            handle.batched_positions = places
            handle.batched_wxyzs = turned
            _set(handle, batched_colors=tints, batched_scales=sizes)
        faulty = sorted({fault.node for fault in self.state.faults.values() if fault.node in uavs})
        self._rings("faulty", [uavs[node].position for node in faulty], [rgb(colors.RED)] * len(faulty), 1.9)
        selected = [uavs[self.selected].position] if self.selected in uavs else []
        self._rings("selected", selected, [(255, 255, 255)] * len(selected), 1.5)

    def _tint(self, uav: UavNow) -> tuple[int, int, int]:
        if uav.flight == "fallen":
            return rgb(FALLEN_COLOR)
        if uav.cluster >= 0:
            return rgb(CLUSTER_COLORS[uav.cluster % len(CLUSTER_COLORS)])
        return rgb(_NO_CLUSTER if self.clustered else mode_color(uav))

    def _draw_turn(self, t_ns: int) -> None:
        owners = self.state.owners(self.turn_ns(t_ns)) if self.shown.turns else []
        uavs = self.state.uavs
        places = [uavs[node].position for node in owners if node in uavs]
        self._rings("turn", places, [rgb(colors.GREEN)] * len(places), 1.15)

    def _draw_spreading(self, t_ns: int) -> None:
        over = self._packet is None or not 0 <= t_ns - self._packet_ns < _SHOWN_NS + _HOLDS_NS
        if self.shown.spreading and over:
            self._packet, self._packet_ns = self.state.newest(by_ns=t_ns - 3 * S), t_ns
        if not self.shown.spreading or self._packet is None:
            self._rings("spread", [], [], 0.85)
            return
        (origin, _), packet = self._packet
        own_ns, uavs = self._own_time_ns(t_ns), self.state.uavs
        having = {node: copy.hops for node, copy in packet.got.items() if copy.delay_ns <= own_ns and node in uavs}
        if origin in uavs:
            having[origin] = 0
        tints = [rgb(HOP_COLORS[min(hops, len(HOP_COLORS) - 1)]) for hops in having.values()]
        self._rings("spread", [uavs[node].position for node in having], tints, 0.85)

    def _own_time_ns(self, t_ns: int) -> int:
        """The time since the packet was handed over that is shown now."""
        assert self._packet is not None, "a packet is shown"
        longest = max(copy.delay_ns for copy in self._packet[1].got.values())
        return min(longest, round(longest * (t_ns - self._packet_ns) / _SHOWN_NS))

    def packet_pace(self) -> float:
        """How many times as fast as it was the spreading of the packet is shown."""
        assert self._packet is not None, "a packet is shown"
        return max(1, max(copy.delay_ns for copy in self._packet[1].got.values())) / _SHOWN_NS

    def _rings(self, name: str, places: list[Enu], tints: list[tuple[int, int, int]], radius: float) -> None:
        """Level rings about places, in one batch; its size changes with their number."""
        handle = self._handles.get(name)
        if not places:
            if handle is not None:
                _set(handle, visible=False)
            return
        at = np.array(places, np.float32)
        paints, sizes = linear(tints), np.full(len(places), self.size_m, np.float32)
        if handle is None or len(handle.batched_positions) != len(places):
            vertices, faces = shapes.ring(radius, 0.22)
            upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(places), 1))
            self._handles[name] = self._api.add_batched_meshes_simple(
                f"/{name}", vertices, faces, upright, at, batched_scales=sizes, batched_colors=paints, lod="off",
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            return
        handle.batched_positions = at
        _set(handle, batched_scales=sizes, batched_colors=paints, visible=True)

    # --- twice a second -------------------------------------------------------------------------------------------

    def _draw_links(self) -> None:
        uavs = self.state.uavs
        segments: list[Any] = []
        tints: list[Any] = []
        if self.shown.links and self.by_range:
            segments, tints = self._in_reach()
        elif self.shown.links:
            best: dict[tuple[int, int], float] = {}
            for src, dst, copies, received in self.state.link_rows():
                if received and src in uavs and dst in uavs:
                    pair = (min(src, dst), max(src, dst))
                    best[pair] = min(best.get(pair, 1.0), received / copies)
            for (a, b), share in best.items():
                segments.append((uavs[a].position, uavs[b].position))
                tints.append(rgb(link_color(share)))
        self._lines("links", segments, tints, round(max(0.5, min(1.5, _MOST_THICK / max(1, len(segments)))), 1))

    def _in_reach(self) -> tuple[list[Any], list[Any]]:
        at = np.array([uav.position for _, uav in sorted(self.state.uavs.items())])
        apart = np.linalg.norm(at[:, None] - at[None], axis=2)
        pairs = np.argwhere(np.triu(apart <= self._reach_m, k=1))
        return [(at[a], at[b]) for a, b in pairs], [(150, 150, 150)] * len(pairs)

    def write_time(self, t_ns: int) -> None:
        """Write the swarm's time into the scene, where there is no panel."""
        north = self.around.on_ground(Enu(0.0, self.around.half_m * 1.2, 0.0))
        found = self.state.survivors.count("confirmed")
        people = f", confirmed {found} of {len(self.state.survivors.now)}" if self.state.survivors.now else ""
        self._name("time", f"{t_ns / S:.0f} s{people}", north, shown=True, above_m=0.0)

    def _draw_clusters(self) -> None:
        uavs = self.state.uavs
        segments, tints = [], []
        if self.shown.clusters:
            for head, members in self.state.heads().items():
                if head in uavs:
                    for node in members:
                        if node != head:
                            segments.append((uavs[node].position, uavs[head].position))
                            tints.append(self._tint(uavs[head]))
        self._lines("clusters", segments, tints, 3.0)

    def _draw_names(self) -> None:
        for node, uav in self.state.uavs.items():
            name = "post" if node == self.state.scenario.post else str(node)
            self._name(f"uav-{node}", name, uav.position, shown=self.shown.names, above_m=self.size_m * 0.7)

    def _name(self, key: str, text: str, at: Enu, *, shown: bool, above_m: float) -> None:
        handle = self._names.get(key)
        place = np.array([at.east, at.north, at.up + above_m])
        if handle is None:
            if shown:
                self._names[key] = self._api.add_label(
                    f"/names/{key}", text, position=place, anchor="bottom-center", font_screen_scale=0.75
                )
            return
        _set(handle, visible=shown)
        if shown and float(np.abs(handle.position - place).max()) > 0.5:
            handle.position = place
        _set(handle, text=text)

    # --- once a second --------------------------------------------------------------------------------------------

    def _draw_trails(self) -> None:
        segments, tints = [], []
        if self.shown.trails:
            for uav in self.state.uavs.values():
                trail = list(uav.trail)
                paint = np.array(self._tint(uav), float)
                for step, (a, b) in enumerate(pairwise(trail)):
                    fresh = (step + 1) / len(trail)
                    segments.append((a, b))
                    tints.append(tuple(int(v) for v in paint * fresh + np.array(_GROUND) * (1 - fresh)))
        self._lines("trails", segments, tints, 1.5)

    def _draw_coverage(self) -> None:
        cells = self.state.covered()
        count = int(cells.sum()) if self.shown.coverage else 0
        if count == self._covered or (self.around.hills is not None and self._second % _HILLS_EVERY_S and count):
            return
        self._covered = count
        half = self.around.half_m
        if self.around.hills is None:
            image = np.empty((*cells.shape, 3), np.uint8)
            image[:] = np.array(_GROUND, np.uint8)
            if self.shown.coverage:
                image[cells] = np.array(_COVERED, np.uint8)
            self._api.add_image(
                "/world/covered", image[::-1], 2 * half, 2 * half, format="png", position=(0.0, 0.0, -0.3),
                wxyz=(0.0, 1.0, 0.0, 0.0), cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            return
        count = cells.shape[0]
        axis = np.linspace(-half, half, count + 1)
        east, north = np.meshgrid(axis, axis)
        flat = np.stack([east.ravel(), north.ravel()], axis=1)
        corners = np.column_stack([flat, self.around.hills.at(flat) + 2.0]).astype(np.float32)
        row, column = np.nonzero(cells)
        first = row * (count + 1) + column
        quads = np.stack([first, first + 1, first + count + 2, first, first + count + 2, first + count + 1], axis=1)
        faces = quads.reshape(-1, 3) if self.shown.coverage and len(first) else np.zeros((1, 3), np.int64)
        self._api.add_mesh_simple(
            "/world/covered", corners, faces.astype(np.int32), color=_COVERED, opacity=0.55, side="double",
            cast_shadow=False,
        )  # fmt: skip

    def _draw_survivors(self) -> None:
        state = self.state
        places, tints = [], []
        if self.shown.survivors:
            for survivor, found in state.survivors.now.items():
                at = self.around.on_ground(state.places[survivor - 1], above_m=self.size_m * 0.4)
                places.append(at)
                tints.append(rgb(STATUS_COLORS[found.status]))
                self._name(f"survivor-{survivor}", f"S{survivor} {found.status}", at, shown=True, above_m=self.size_m)
        else:
            for key, handle in self._names.items():
                if key.startswith("survivor"):
                    _set(handle, visible=False)
        handle = self._handles.get("survivors")
        if handle is None and places:
            vertices, faces = shapes.ball()
            self._handles["survivors"] = self._api.add_batched_meshes_simple(
                "/survivors", vertices * 0.9 * self.size_m, faces,
                np.tile(np.array([1, 0, 0, 0], np.float32), (len(places), 1)), np.array(places, np.float32),
                batched_colors=linear(tints), lod="off", cast_shadow=False,
            )  # fmt: skip
        elif handle is not None:
            _set(handle, visible=bool(places))
            if places:
                _set(handle, batched_colors=linear(tints))
        rings, paints = [], []
        for one in state.estimates.values() if self.shown.survivors else ():
            at = self.around.on_ground(Enu(one.east_m, one.north_m, 0.0), above_m=1.0)
            circle = shapes.circle_segments(at.east, at.north, at.up, max(2.0, 2 * one.sigma_m))
            rings.extend(circle.tolist())
            paints.extend([rgb(colors.PINK if one.standing == "estimated" else colors.GREEN)] * len(circle))
        for uav in state.uavs.values():
            if uav.mission == "respond" and uav.survivor in state.estimates:
                one = state.estimates[uav.survivor]
                rings.append((uav.position, self.around.on_ground(Enu(one.east_m, one.north_m, 0.0))))
                paints.append(rgb(colors.PINK))
        self._lines("estimates", rings, paints, 2.5)

    def _draw_jams(self) -> None:
        segments: list[Any] = []
        for label, (east, north, radius) in self.jams.items():
            if label in self.state.faults:
                for up in (1.0, 60.0, 120.0):
                    segments.extend(shapes.circle_segments(east, north, up, radius).tolist())
        tints = [rgb(colors.RED)] * len(segments)
        if self.target is not None:
            at = self.around.on_ground(Enu(*self.target, 0.0), above_m=1.0)
            size = self.size_m
            segments.extend([
                (Enu(at.east - size, at.north, at.up), Enu(at.east + size, at.north, at.up)),
                (Enu(at.east, at.north - size, at.up), Enu(at.east, at.north + size, at.up)),
            ])  # fmt: skip
            tints += [rgb(colors.DARK)] * 2
        self._lines("marks", segments, tints, 3.0)

    # --- parts ----------------------------------------------------------------------------------------------------

    def _lines(self, name: str, segments: Any, tints: Any, thickness: float) -> None:  # noqa: ANN401  (nested sequences)
        handle = self._handles.get(name)
        if not len(segments):
            if handle is not None:
                _set(handle, visible=False)
            return
        if handle is not None and handle.thickness != thickness:
            _set(handle, thickness=thickness)
        points = np.array(segments, np.float32)
        paints = np.repeat(linear(tints)[:, None, :], 2, axis=1)
        if handle is None or handle.points.shape != points.shape:
            self._handles[name] = self._api.add_line_segments(
                f"/{name}", points, paints, thickness=thickness, thickness_units="screen"
            )
            return
        if not np.array_equal(handle.points, points):
            handle.points = points
        _set(handle, colors=paints, visible=True)

    def _clicked(self, event: Any) -> None:  # noqa: ANN401  (viser's events)
        """Select the UAV that was clicked, or the one nearest to the ray if the client does not say which it was."""
        index = getattr(event, "instance_index", None)
        nodes = list(self._nodes)
        if index is not None and 0 <= index < len(nodes):
            self._on_select(nodes[index])
            return
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        with contextlib.suppress(ValueError):
            self._on_select(min(nodes, key=lambda node: _off_ray(self.state.uavs[node].position, origin, direction)))

    def on_ground(self, origin: tuple[float, float, float], direction: tuple[float, float, float]) -> Enu | None:
        """Where a ray meets the level ground; None: above the horizon."""
        if direction[2] >= -1e-6:
            return None
        reach = -origin[2] / direction[2]
        return Enu(origin[0] + reach * direction[0], origin[1] + reach * direction[1], 0.0)


def _set(handle: Any, **values: Any) -> None:  # noqa: ANN401  (viser's handles)
    """Set properties only if they change, because each change is sent."""
    for name, value in values.items():
        if not np.array_equal(getattr(handle, name), value):
            setattr(handle, name, value)


def _off_ray(at: Enu, origin: Rows, direction: Rows) -> float:
    offset = np.array(at) - origin
    return float(np.linalg.norm(offset - direction * float(offset @ direction)))


def _step_m(half_m: float) -> float:
    """The step of the grid: a round number of metres that divides the area into five to twelve."""
    steps = (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
    return next((step for step in steps if 2 * half_m / step <= 12), half_m / 4)
