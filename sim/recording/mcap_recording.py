"""Writes what is observed of a swarm as MCAP, in Foxglove's schemas, so that Foxglove and PlotJuggler draw it.

What is on which topic is in docs/how-to/recordings.md. Instants are unix time: that of swarm instant 0 plus swarm time.
"""

import contextlib
import json
import math
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final, Self

from foxglove_schemas_protobuf import (
    FrameTransforms_pb2,
    LinePrimitive_pb2,
    LocationFix_pb2,
    Log_pb2,
    PosesInFrame_pb2,
    SceneEntity_pb2,
    SceneUpdate_pb2,
)
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer

from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.geodesy import Geodetic, to_geodetic
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record, RoleChanged
from fanet_mw.units import Enu, S
from fanet_mw.whole_file import keep_alone, require_in_place, writing
from sim.figures import colors
from sim.observation.observer import Observer
from sim.observation.surroundings import Surroundings, surroundings
from sim.observation.swarm_state import SwarmState, UavNow
from sim.recording.drawing import STATUS_COLORS, attitude, link_color, mode_color

FRAME: Final = "map"
_CHUNK_BYTES: Final = 1 << 20
_METRICS: Final = (
    "delivered_share", "delay_p50_ms", "delay_p95_ms", "delay_max_ms", "bounded_p95_ms", "bounded_max_ms",
    "bound_max_ms", "bounds_broken",
    "airtime_share", "airtime_lately_share", "late_share", "late_p99_ms", "time_scale", "confirmed", "survivors",
    "coverage_share", "waiting_packets",
)  # fmt: skip
_STATE: Final = (
    "east_m", "north_m", "up_m", "speed_m_s", "charge_percent", "cluster", "head", "waiting_packets", "delivered",
    "sent", "dropped",
)  # fmt: skip
_STATE_TEXTS: Final = ("role", "flight_mode", "mission_mode")
_LINK: Final = ("src", "dst", "copies", "received")
_REPORTED: Final = ("waiting", "slots", "turns", "air", "late")
"""What is kept of a report, as JSON."""


def _messages() -> tuple[Any, Any, Any, Any]:
    """The classes of the messages of this project: flat numbers, which plot by themselves."""
    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="fanet.proto", package="fanet", syntax="proto3")

    def add(name: str, fields: Iterable[tuple[str, int]]) -> Any:  # noqa: ANN401  (protobuf's types are made at run time)
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields, 1):
            message.field.add(name=field, number=number, type=kind, label=kinds.LABEL_OPTIONAL)
        return message

    add("Metrics", ((name, kinds.TYPE_DOUBLE) for name in _METRICS))
    state = [(name, kinds.TYPE_DOUBLE) for name in _STATE] + [(name, kinds.TYPE_STRING) for name in _STATE_TEXTS]
    add("UavState", state)
    add("Link", ((name, kinds.TYPE_UINT32) for name in _LINK))
    links = add("Links", (("span_s", kinds.TYPE_DOUBLE),))
    links.field.add(
        name="links", number=2, type=kinds.TYPE_MESSAGE, label=kinds.LABEL_REPEATED, type_name=".fanet.Link"
    )
    add("Report", (("name", kinds.TYPE_STRING), ("json", kinds.TYPE_STRING)))
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    metrics, uav, several, report = (
        message_factory.GetMessageClass(pool.FindMessageTypeByName(f"fanet.{name}"))
        for name in ("Metrics", "UavState", "Links", "Report")
    )
    return metrics, uav, several, report


_Metrics, _UavState, _Links, _Report = _messages()


class McapRecording(Observer):
    """A recording that is being written; a context manager, which closes the file. An earlier one in this file is lost
    when the swarm's time passes, not when a run begins which may fail at its start.
    """

    def __init__(self, path: Path, scenario: Scenario, *, epoch_unix_ns: int, file: BinaryIO | None = None) -> None:
        """Raises ConfigError when the file cannot be opened. With `file` whatever hinders it is raised."""
        self.state = SwarmState(scenario)
        self.path = path
        self.epoch_unix_ns = epoch_unix_ns
        self._around = surroundings(scenario)
        self._origin = Geodetic(*scenario.world.origin_deg, 0.0)
        self._looks: dict[int, str] = {}
        """The color in which each UAV is shown."""
        self._second = -1
        self.count = 0
        """Messages that were written."""
        self.failure: str | None = None
        """Why the file ends early; the swarm flies on."""
        self._events = 0
        self._gives_up = file is None
        with writing(f"--record {path}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: BinaryIO = file or opened_alone(path)
        self._writer: Writer | None = None
        self._held: list[tuple[str, Any]] = []
        """What was observed at instant 0, while there is no writer."""
        self._put("/scene/world", _world(scenario, self._around, self.state.places, self._stamp(0)), 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None and self._writer is None:
            self._leave_earlier()
        else:
            self.close()

    def close(self) -> None:
        """Write the index; without it readers must search the file."""
        if self.failure is None:
            try:
                self._begun().finish()
                if self._gives_up:
                    require_in_place(self._file, self.path)
                    self._file.close()
            except OSError as error:
                self._give_up(error)

    def _begun(self) -> Writer:
        """The writer; the first call empties the file."""
        if self._writer is None:
            if self._gives_up:
                self._file.truncate(0)
                self._file.seek(0)  # from where the index counts
            self._writer = Writer(self._file, chunk_size=_CHUNK_BYTES)
            for topic, message in self._held:
                self._write(topic, message, 0)
            self._held.clear()
        return self._writer

    def _leave_earlier(self) -> None:
        """Close the file as it was found: the run has failed before the swarm's time passed."""
        if self._gives_up:
            with contextlib.suppress(OSError):
                if not os.fstat(self._file.fileno()).st_size:
                    require_in_place(self._file, self.path)
                    self.path.unlink()
                self._file.close()

    def _give_up(self, error: OSError) -> None:
        if not self._gives_up:
            raise error
        with contextlib.suppress(OSError):
            self._file.close()
        self.failure = error.strerror or str(error)
        sys.stderr.write(f"{self.path}: the recording ends here: {self.failure}\n")

    # --- what is observed -----------------------------------------------------------------------------------------

    def take_poses(self, poses: Poses) -> None:
        self.state.take_poses(poses)
        transforms, together = FrameTransforms_pb2.FrameTransforms(), PosesInFrame_pb2.PosesInFrame(frame_id=FRAME)
        stamp = self._stamp(poses.t_ns)
        together.timestamp.CopyFrom(stamp)
        for node in poses.ids:
            uav = self.state.uavs[node]
            one = transforms.transforms.add(parent_frame_id=FRAME, child_frame_id=f"uav-{node}")
            one.timestamp.CopyFrom(stamp)
            _place(one.translation, uav.position)
            _turn(one.rotation, attitude(uav))
            pose = together.poses.add()
            _place(pose.position, uav.position)
            _turn(pose.orientation, attitude(uav))
        self._put("/tf", transforms, poses.t_ns)
        self._put("/poses", together, poses.t_ns)
        self._each_second(poses.t_ns)

    def take_records(self, records: Iterable[Record]) -> None:
        known = list(records)
        self.state.take_records(known)
        for record in known:
            if type(record) is RoleChanged:
                self._show_uav(record.node, record.t_ns)
        for event in self.state.latest_events(self.state.told - self._events):
            message = Log_pb2.Log(level=Log_pb2.Log.INFO, message=f"{event.t_ns / S:.1f} s: {event.text}")
            message.name = f"uav-{event.node}" if event.node else "swarm"
            message.timestamp.CopyFrom(self._stamp(event.t_ns))
            self._put("/log", message, event.t_ns)
        self._events = self.state.told

    def take_links(self, stats: LinkStats) -> None:
        self.state.take_links(stats)
        message = _Links(span_s=stats.span_ns / S)
        for row in stats.rows():
            message.links.add(src=row.src, dst=row.dst, copies=row.copies, received=row.received)
        self._put("/links", message, stats.t_ns)

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None:
        self.state.take_report(name, content, t_ns=t_ns)
        kept = {key: content[key] for key in _REPORTED if content.get(key) is not None}
        self._put("/reports", _Report(name=name, json=json.dumps(kept)), t_ns)

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        self.state.take_tap(node, t_ns, data)

    # --- parts ----------------------------------------------------------------------------------------------------

    def _each_second(self, t_ns: int) -> None:
        if t_ns // S <= self._second:
            return
        self._second = t_ns // S
        metrics = _Metrics()
        for name, value in self.state.metrics().items():
            setattr(metrics, name, math.nan if value is None else value)
        self._put("/metrics", metrics, t_ns)
        for node, uav in sorted(self.state.uavs.items()):
            if self._look(uav) != self._looks.get(node):
                self._show_uav(node, t_ns)
            self._put_uav(node, uav, t_ns)
        self._put("/scene/links", self._links_scene(t_ns), t_ns)
        self._put("/scene/finds", self._finds_scene(t_ns), t_ns)

    def _put_uav(self, node: int, uav: UavNow, t_ns: int) -> None:
        state = _UavState(
            east_m=uav.position.east, north_m=uav.position.north, up_m=uav.position.up,
            speed_m_s=math.hypot(*uav.velocity),
            charge_percent=math.nan if uav.charge_percent is None else uav.charge_percent,
            cluster=uav.cluster, head=uav.head, delivered=uav.delivered, sent=uav.sent, dropped=uav.drops.total(),
            waiting_packets=self.state.reports.get(node, {}).get("waiting", 0),
            role=uav.role, flight_mode=uav.flight, mission_mode=uav.mission,
        )  # fmt: skip
        self._put(f"/uav/{node}/state", state, t_ns)
        at = to_geodetic(uav.position, self._origin)
        fix = LocationFix_pb2.LocationFix(
            frame_id=f"uav-{node}", latitude=at.lat_deg, longitude=at.lon_deg, altitude=at.alt_m
        )
        fix.timestamp.CopyFrom(self._stamp(t_ns))
        self._put(f"/uav/{node}/fix", fix, t_ns)

    def _show_uav(self, node: int, t_ns: int) -> None:
        uav = self.state.uavs[node]
        look = self._looks[node] = self._look(uav)
        entity = self._entity(f"uav-{node}", t_ns, frame=f"uav-{node}")
        entity.frame_locked = True
        body = entity.cubes.add()
        _size(body.size, 8.0, 8.0, 2.5)
        body.pose.orientation.w = 1.0
        _paint(body.color, look)
        text = entity.texts.add(text=str(node), font_size=12, scale_invariant=True, billboard=True)
        text.pose.position.z = 8.0
        text.pose.orientation.w = 1.0
        _paint(text.color, colors.DARK)
        self._put("/scene/uavs", SceneUpdate_pb2.SceneUpdate(entities=[entity]), t_ns)

    @staticmethod
    def _look(uav: UavNow) -> str:
        return (colors.ORANGE if uav.role == "head" else colors.BLUE) if uav.role else mode_color(uav)

    def _links_scene(self, t_ns: int) -> SceneUpdate_pb2.SceneUpdate:
        entity = self._entity("links", t_ns)
        lines = entity.lines.add(type=LinePrimitive_pb2.LinePrimitive.LINE_LIST, thickness=1.5, scale_invariant=True)
        lines.pose.orientation.w = 1.0
        for src, dst, copies, received in self.state.link_rows():
            if src in self.state.uavs and dst in self.state.uavs and received:
                for node in (src, dst):
                    _place(lines.points.add(), self.state.uavs[node].position)
                    _paint(lines.colors.add(), link_color(received / copies), alpha=0.6)
        return SceneUpdate_pb2.SceneUpdate(entities=[entity])

    def _finds_scene(self, t_ns: int) -> SceneUpdate_pb2.SceneUpdate:
        entity = self._entity("finds", t_ns)
        for survivor, state in self.state.survivors.now.items():
            at = self.state.places[survivor - 1]
            ball = entity.spheres.add()
            _place(ball.pose.position, self._around.on_ground(at))
            ball.pose.orientation.w = 1.0
            _size(ball.size, 10.0, 10.0, 10.0)
            _paint(ball.color, STATUS_COLORS[state.status])
        for one in self.state.estimates.values():
            disk = entity.cylinders.add(top_scale=1.0, bottom_scale=1.0)
            at = self._around.on_ground(Enu(one.east_m, one.north_m, 0.0), above_m=0.5)
            _place(disk.pose.position, at)
            disk.pose.orientation.w = 1.0
            width = 2 * max(1.0, one.sigma_m)
            _size(disk.size, width, width, 1.0)
            _paint(disk.color, colors.PINK, alpha=0.4)
        return SceneUpdate_pb2.SceneUpdate(entities=[entity])

    def _entity(self, name: str, t_ns: int, *, frame: str = FRAME) -> SceneEntity_pb2.SceneEntity:
        entity = SceneEntity_pb2.SceneEntity(frame_id=frame, id=name)
        entity.timestamp.CopyFrom(self._stamp(t_ns))
        return entity

    def _stamp(self, t_ns: int) -> Timestamp:
        seconds, nanos = divmod(self.epoch_unix_ns + t_ns, S)
        return Timestamp(seconds=seconds, nanos=nanos)

    def _put(self, topic: str, message: Any, t_ns: int) -> None:  # noqa: ANN401  (protobuf's types are made at run time)
        if self.failure is not None:
            return
        self.count += 1
        if self._writer is None and not t_ns:
            self._held.append((topic, message))
            return
        try:
            self._begun()
            self._write(topic, message, t_ns)
        except OSError as error:
            self._give_up(error)

    def _write(self, topic: str, message: Any, t_ns: int) -> None:  # noqa: ANN401
        assert self._writer is not None, "what is observed before is held"
        unix_ns = self.epoch_unix_ns + t_ns
        self._writer.write_message(topic, message, log_time=unix_ns, publish_time=unix_ns)


def opened_alone(path: Path) -> BinaryIO:
    """A file, left as it is, that no other recording is written to, where files can be locked; raises ConfigError."""
    file = path.open("ab")
    try:
        keep_alone(file.fileno(), f"--record {path}: another run records there now; choose another file")
    except BaseException:
        file.close()
        raise
    return file


def _world(
    scenario: Scenario, around: Surroundings, places: Sequence[Enu], stamp: Timestamp
) -> SceneUpdate_pb2.SceneUpdate:
    entity = SceneEntity_pb2.SceneEntity(frame_id=FRAME, id="world")
    entity.timestamp.CopyFrom(stamp)
    ground = entity.triangles.add()
    ground.pose.orientation.w = 1.0
    _paint(ground.color, "#d9dccf")
    for corner in around.corners:
        _place(ground.points.add(), Enu(*corner.tolist()))
    ground.indices.extend(around.triangles.ravel().tolist())
    for box in around.boxes:
        cube = entity.cubes.add()
        _place(cube.pose.position, Enu(box.east, box.north, box.roof / 2))
        cube.pose.orientation.z, cube.pose.orientation.w = math.sin(box.yaw / 2), math.cos(box.yaw / 2)
        _size(cube.size, box.width, box.depth, box.roof)
        _paint(cube.color, "#b0a99f")
    for outline in around.no_fly:
        lines = entity.lines.add(type=LinePrimitive_pb2.LinePrimitive.LINE_LOOP, thickness=2.0, scale_invariant=True)
        lines.pose.orientation.w = 1.0
        _paint(lines.color, colors.RED)
        for east, north in outline:
            _place(lines.points.add(), around.on_ground(Enu(east, north, 0.0), above_m=2.0))
    for number, at in enumerate(places, 1):
        text = entity.texts.add(text=f"S{number}", font_size=11, scale_invariant=True, billboard=True)
        _place(text.pose.position, around.on_ground(at, above_m=10.0))
        text.pose.orientation.w = 1.0
        _paint(text.color, colors.DARK)
    return SceneUpdate_pb2.SceneUpdate(entities=[entity])


def _place(vector: Any, at: Enu) -> None:  # noqa: ANN401  (protobuf's types are made at run time)
    vector.x, vector.y, vector.z = at


def _turn(quaternion: Any, wxyz: tuple[float, float, float, float]) -> None:  # noqa: ANN401
    quaternion.w, quaternion.x, quaternion.y, quaternion.z = wxyz


def _size(vector: Any, x: float, y: float, z: float) -> None:  # noqa: ANN401
    vector.x, vector.y, vector.z = x, y, z


def _paint(color: Any, web: str, *, alpha: float = 1.0) -> None:  # noqa: ANN401
    color.r, color.g, color.b = (int(web[at : at + 2], 16) / 255 for at in (1, 3, 5))
    color.a = alpha
