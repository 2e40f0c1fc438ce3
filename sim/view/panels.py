"""The panel beside the scene: figures of the swarm, one UAV, what to draw, events, and things to do.

Callbacks of the browser come on other threads: each only puts a function in a queue, and the loop that draws calls it.
"""

import html
import math
import queue
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import viser
from viser import uplot

from fanet_mw.bus.messages import CameraImage
from fanet_mw.mavlink import common
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire.survivors import called
from sim.figures import colors
from sim.observation.swarm_state import LATELY_NS, SwarmState, UavNow
from sim.recording.drawing import FALLEN_COLOR, HOMEWARD_COLOR, MODE_COLORS, STATUS_COLORS
from sim.view.actions import PAUSED, Actions
from sim.view.air import AirSource, air_text, drawn_ns
from sim.view.scene import HOP_COLORS, Scene

_MOST_POINTS: Final = 300
"""Of the charts, one a second."""
_EVENTS: Final = 14
_OWN_EVENTS: Final = 5
_OWN_MESSAGES: Final = 8
_STYLE: Final = "font-size:13px;line-height:1.45;padding:2px 10px;font-variant-numeric:tabular-nums"
Job = Callable[[], None]


class Panels:
    """The panel of one server."""

    def __init__(
        self, server: viser.ViserServer, scene: Scene, *, actions: Actions | None, air: AirSource | None = None
    ) -> None:
        """Without `actions` there is nothing to do, because the swarm flew some time ago; `air`: who sends when."""
        self.jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._server, self._scene, self.state = server, scene, scene.state
        self._air, self._watches_air = air, False
        self._second = -1
        self._shown_image: CameraImage | None = None
        self._t_ns = 0
        self._history: dict[str, list[tuple[float, ...]]] = {}
        self._follows = False
        self._said = ""
        self.texts: dict[str, str] = {}
        """What each part of the panel says, as HTML."""
        gui = server.gui
        gui.set_panel_label(f"{scene.state.scenario.name}")
        self._clock = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Swarm"):
            self._figures = gui.add_html("")
            self._delivered = self._chart("delivered lately [%]", top=105.0)
            self._delays = self._chart("delay of 95 of 100 packets [s]")
            self._bounds = self._chart("delays with a bound: longest, bound [s]", second="bound", visible=False)
            self._spread = gui.add_html("")
        with tabs.add_tab("UAV"):
            nodes = [str(node) for node in scene.state.scenario.node_ids]
            self._choice = gui.add_dropdown("UAV", ["none", *nodes], initial_value="none")
            follow = gui.add_checkbox("follow it", initial_value=False)
            self._uav = gui.add_html(_box("Click a UAV."))
            self._image = gui.add_image(np.zeros((1, 1, 3), np.uint8), label="its camera", visible=False)
            if actions is not None:
                self._add_uav_actions(nodes, actions)
        if actions is not None:
            with tabs.add_tab("Act"):
                self._add_actions(actions)
        if air is not None:
            with tabs.add_tab("Air"):
                watch = gui.add_checkbox("watch the air", initial_value=False)
                self._frames = gui.add_html(_box("Who sends when, and why."))
                watch.on_update(self.later(lambda: self._watch_air(watch.value)))
        with tabs.add_tab("Events"):
            self._events = gui.add_html("")
        with tabs.add_tab("Show"):
            self._add_switches()
        self._choice.on_update(self.later(lambda: self.select(_number(self._choice.value), from_list=True)))
        follow.on_update(self.later(lambda: self._follow(follow.value)))

    # --- for the loop that draws ----------------------------------------------------------------------------------

    def run_jobs(self) -> None:
        while not self.jobs.empty():
            job = self.jobs.get()
            job()

    def refresh(self, t_ns: int, *, note: str = "", all_of_it: bool = False) -> None:
        """Write the figures of an instant; those that need no hurry once a second."""
        self._t_ns = t_ns
        self._write_clock(t_ns, note)
        if self._follows and self._scene.selected in self.state.uavs:
            self._look_at_selected()
        if not all_of_it and t_ns // S == self._second:
            return
        self._second = t_ns // S
        metrics = self.state.metrics()
        self._write("_figures", _figures(self.state, metrics))
        self._write("_events", self._event_list())
        self._write("_spread", self._spread_text(t_ns))
        self._write("_uav", self._uav_text())
        self._write_air()
        self._plot(t_ns, metrics)

    def show_image(self, image: CameraImage | None) -> None:
        """Show what the camera of the selected UAV sees; None: it has none."""
        if image is self._shown_image:
            return
        self._shown_image = image
        self._image.visible = image is not None
        if image is not None:
            self._image.image = np.frombuffer(image.rgb, np.uint8).reshape(image.height, image.width, 3)

    def select(self, node: int, *, from_list: bool = False) -> None:
        """Select a UAV; 0: none."""
        self._scene.selected = node
        if not from_list:
            self._choice.value = str(node) if node else "none"
        self._write("_uav", self._uav_text())

    def clear_charts(self) -> None:
        self._history.clear()

    def say(self, text: str) -> None:
        self._said = text

    # --- parts ----------------------------------------------------------------------------------------------------

    def later(self, job: Job) -> Callable[[Any], None]:
        """A callback of the browser that lets the loop do this."""

        def on_event(event: Any) -> None:  # noqa: ANN401  (viser's events)
            if getattr(event, "client", None) is not None:  # not a change that was made here
                self.jobs.put(job)

        return on_event

    def _button(self, label: str, job: Callable[[], str], *, color: str | None = None) -> None:
        def act() -> None:
            self.say(job())

        self._server.gui.add_button(label, color=color).on_click(self.later(act))

    def _add_uav_actions(self, nodes: Sequence[str], actions: Actions) -> None:
        gui = self._server.gui

        def chosen(act: Callable[[int], str], *, flies: bool = True) -> Callable[[], str]:
            return lambda: self._on_chosen(act, flies=flies)

        self._button("cut its radio", chosen(actions.cut, flies=False), color="orange")
        self._button("let it crash", chosen(actions.crash), color="red")
        with gui.add_folder("its link to another", expand_by_default=False):
            other = gui.add_dropdown("other", nodes)
            loss = gui.add_slider("frames lost [%]", min=0, max=100, step=5, initial_value=100)
            self._button(
                "degrade the link",
                chosen(lambda node: actions.degrade(node, int(other.value), loss_share=loss.value / 100), flies=False),
            )
        with gui.add_folder("send it", expand_by_default=False):
            by = "The post on the ground orders it, over the air." if actions.has_post else (
                "By MAVLink, as a ground station does.")  # fmt: skip
            gui.add_html(_box(f"Click the map, then send. {by}"))
            self._button("send it to the mark", chosen(lambda node: self._sent(actions, node)))
            self._button("call it home", chosen(actions.recall))
            self._button("release it", chosen(actions.release))

    def _on_chosen(self, act: Callable[[int], str], *, flies: bool = False) -> str:
        """Do something to the selected UAV or, unless it takes one that `flies`, to the post."""
        node = self._scene.selected
        if flies and node == self.state.scenario.post:
            return "the post on the ground does not fly"
        return act(node) if node else "choose a UAV first"

    def _sent(self, actions: Actions, node: int) -> str:
        target = self._scene.target
        return "click the map first" if target is None else actions.send(node, *target)

    def _add_actions(self, actions: Actions) -> None:
        gui, state = self._server.gui, self.state
        pace = gui.add_slider("clock: swarm s per s", min=0.05, max=2.0, step=0.05, initial_value=1.0)
        pace.on_update(self.later(lambda: self.say(actions.pace(pace.value))))
        group = gui.add_button_group("clock", ("pause", "slow", "run"))

        def turn() -> None:
            scale = {"pause": PAUSED, "slow": 0.1}.get(group.value, state.scenario.time_scale)
            self.say(actions.pace(scale))

        group.on_click(self.later(turn))
        if self._scene.clustered:
            self._button("cut a head's radio", lambda: self._on_a_head(actions.cut), color="orange")
            self._button("let a head crash", lambda: self._on_a_head(actions.crash), color="red")
        else:
            self._button("cut the radio that most others hear", lambda: self._on_a_hub(actions.cut), color="orange")
            self._button("let that UAV crash", lambda: self._on_a_hub(actions.crash, flies=True), color="red")
        radius = gui.add_slider("jam: radius [m]", min=20, max=500, step=10, initial_value=150)
        self._button("jam at the mark, or about the UAV", lambda: self._jam(actions, radius.value), color="red")
        self._button("end all faults", actions.restore, color="green")
        gui.add_html(_box("Click the map to set the mark."))

    def _on_a_head(self, act: Callable[[int], str]) -> str:
        heads = self.state.heads()
        selected = self.state.uavs.get(self._scene.selected)
        if selected is not None and selected.head:
            return act(selected.head)
        return act(max(heads, key=lambda head: len(heads[head]))) if heads else "there is no head now"

    def _on_a_hub(self, act: Callable[[int], str], *, flies: bool = False) -> str:
        """Do something to the node with the most neighbors, of those whose radio works; `flies`: not to the post."""
        but = {fault.node for fault in self.state.faults.values()} | ({self.state.scenario.post} if flies else set())
        near = {node: len(others) for node, others in self.state.neighbors().items() if others and node not in but}
        return act(max(near, key=lambda node: near[node])) if near else "nobody hears anybody now"

    def _jam(self, actions: Actions, radius: float) -> str:
        uav = self.state.uavs.get(self._scene.selected)
        place = self._scene.target
        if place is None and uav is not None:
            place = (uav.position.east, uav.position.north)
        if place is None:
            return "click the map or a UAV first"
        label = f"jam-{len(self._scene.jams) + 1}"
        self._scene.jams[label] = (*place, radius)
        return actions.jam(label, *place, radius)

    def _add_switches(self) -> None:
        gui, scene = self._server.gui, self._scene
        texts = {
            "links": "links, by what they delivered", "clusters": "clusters: member to head", "trails": "trails",
            "coverage": "area covered", "names": "names", "turns": "whose turn it is",
            "spreading": "a packet that spreads", "survivors": "survivors, estimates",
        }  # fmt: skip
        if not scene.clustered:
            del texts["clusters"]
        for name, text in texts.items():
            box = gui.add_checkbox(text, initial_value=getattr(scene.shown, name))

            def switch(name: str = name, box: Any = box) -> None:  # noqa: ANN401  (viser's handles)
                scene.shown = scene.shown._replace(**{name: box.value})

            box.on_update(self.later(switch))
        size = gui.add_slider("size of UAVs [m]", min=1, max=60, step=1, initial_value=round(scene.size_m))

        def resize() -> None:
            scene.size_m = float(size.value)

        size.on_update(self.later(resize))
        gui.add_html(_box(legend(by_cluster=scene.clustered, links_known=not scene.by_range)))

    def _follow(self, wanted: bool) -> None:
        self._follows = wanted

    def _look_at_selected(self) -> None:
        at = np.array(self.state.uavs[self._scene.selected].position)
        for client in self._server.get_clients().values():
            moved = at - client.camera.look_at
            if float(np.abs(moved).max()) > 0.1:
                client.camera.position = client.camera.position + moved
                client.camera.look_at = at

    def _watch_air(self, wanted: bool) -> None:
        self._watches_air = wanted
        if self._air is None:
            return
        if wanted:
            self._write_air()  # time may stand
        else:
            self._air.rest()

    def _write_air(self) -> None:
        if self._air is None or not self._watches_air:
            return
        state = self.state
        length_ns = drawn_ns(0 if state.turns is None else state.turns.period_ns)
        nodes = state.scenario.node_ids
        text = air_text(
            self._air, nodes, self._t_ns, length_ns=length_ns, losses=state.losses(), selected=self._scene.selected
        )
        self._write("_frames", _box(text))

    def _write(self, name: str, text: str) -> None:
        """Write text into a part of the panel, if it has changed."""
        if self.texts.get(name) != text:
            self.texts[name] = text
            getattr(self, name).content = text

    def _write_clock(self, t_ns: int, note: str) -> None:
        state = self.state
        pace = "" if math.isclose(state.time_scale, 1.0) else f" at {state.time_scale:.3g} of real time"
        if state.time_scale <= PAUSED:
            pace = ", paused"
        now = f"<b style='font-size:17px'>{t_ns / S:.1f} s</b>"
        lines = [f"{now} of {state.scenario.duration_s:g} s{pace}"]
        lines += [f"<span style='color:#b04a00'>{html.escape(text)}</span>" for text in (note, self._said) if text]
        self._write("_clock", _box("<br>".join(lines)))

    def _event_list(self) -> str:
        events = self.state.latest_events(_EVENTS)
        rows = "".join(
            f"<tr><td style='white-space:nowrap'>{e.t_ns / S:.1f} s</td><td>{html.escape(e.text)}</td></tr>"
            for e in reversed(events)
        )
        return _box(f"<table>{rows}</table>" if rows else "Nothing yet.")

    def _spread_text(self, t_ns: int) -> str:
        found = self._scene.spreading()
        turn = self.state.turns
        lines = []
        if turn is not None:
            shown_ns = self._scene.turn_ns(t_ns)
            owners = self.state.owners(shown_ns)
            free = f"nobody ({turn.window_called})" if turn.in_window(shown_ns) else "nobody"
            who = ", ".join(map(str, owners)) if owners else free
            lines.append(f"<b>{turn.called}</b> of {_dot(colors.GREEN)} {who}, one of "
                         f"{len(turn.own)} in {turn.period_ns / MS:.0f} ms")  # fmt: skip
        if found is not None:
            (origin, seq), packet = found
            have, own_ns = self._scene.shown_spread(t_ns)
            dots = " ".join(f"{_dot(color)}{hops}" for hops, color in enumerate(HOP_COLORS[:5]))
            lines.append(f"<b>packet {seq} of UAV {origin}</b>: {have} of {packet.targets} have it {own_ns / MS:,.0f} "
                         f"ms after it was handed over{_paced(self._scene.packet_pace())}; by hops {dots}")  # fmt: skip
        return _box("<br>".join(lines)) if lines else ""

    def _uav_text(self) -> str:
        node, state = self._scene.selected, self.state
        uav = state.uavs.get(node)
        if uav is None:
            return _box("Click a UAV, or choose one.")
        report = state.reports.get(node, {})
        at, flies = uav.position, math.hypot(*uav.velocity)
        since_s = (state.t_ns - uav.heard_ns) / S
        rows = [
            *([("role", f"{uav.role or 'none yet'}{f', cluster {uav.cluster}, head {uav.head}' if uav.head else ''}")]
              if self._scene.clustered or uav.role else []),
            ("mode", f"{uav.flight or '-'}; mission {uav.mission or '-'}"
                     f"{f', {called(uav.survivor)}' if uav.survivor else ''}"),
            ("place", f"{at.east:.0f} m E, {at.north:.0f} m N, {at.up:.0f} m up; {flies:.1f} m/s"),
            ("battery", "not told" if uav.charge_percent is None else f"{uav.charge_percent} %"),
            ("neighbors", ", ".join(map(str, state.neighbors().get(NodeId(node), ()))) or self._no_neighbor()),
            ("queue", f"{report['waiting']} packets wait" if "waiting" in report else "not known"),
            ("packets", f"{uav.sent} sent, {uav.delivered} received"),
            ("dropped", ", ".join(f"{html.escape(str(k))} {v}" for k, v in sorted(uav.drops.items())) or "none"),
            ("last heard", f"{max(0.0, since_s):.1f} s ago"),
        ]  # fmt: skip
        if messages := _messages(uav):
            rows.append(("MAVLink", messages))
        said = [one for one in state.events if one.node == node][-_OWN_EVENTS:]
        lately = "<br>".join(f"{one.t_ns / S:.1f} s {html.escape(one.text)}" for one in reversed(said))
        return _box(f"<b>UAV {node}</b>{_table(rows)}{lately}")

    def _no_neighbor(self) -> str:
        return "not known: no recording" if self._scene.by_range else "none"

    def _chart(self, title: str, *, top: float | None = None, second: str = "", visible: bool = True) -> Any:  # noqa: ANN401
        """A chart of one figure, or of a `second` one, dashed, beside it."""
        scales = {"x": uplot.Scale(time=False)}
        if top is not None:
            scales["y"] = uplot.Scale(range=(0.0, top))
        series = [uplot.Series(label="swarm s"), uplot.Series(label=title, stroke=colors.BLUE, width=2)]
        if second:
            series.append(uplot.Series(label=second, stroke=colors.RED, width=2, dash=(6, 4)))
        return self._server.gui.add_uplot(
            tuple(np.zeros(1) for _ in series), series, title=title, scales=scales, aspect=2.6, visible=visible,
            legend=uplot.Legend(show=False), padding=(14, 8, 0, 0),
        )  # fmt: skip

    def _plot(self, t_ns: int, metrics: dict[str, float | None]) -> None:
        """Add a point to each chart whose figure is known; a chart without any figure is not shown."""
        for chart, names, scale in (
            (self._delivered, ("delivered_share",), 100.0),
            (self._delays, ("delay_p95_ms",), 1e-3),
            (self._bounds, ("bounded_max_ms", "bound_max_ms"), 1e-3),
        ):
            values, points = [metrics[name] for name in names], self._history.setdefault(names[0], [])
            if None not in values:
                points.append((t_ns / S, *(value * scale for value in values if value is not None)))
                del points[:-_MOST_POINTS]
                chart.data = tuple(np.array(points).T)
                if not chart.visible:
                    chart.visible = True


def _figures(state: SwarmState, metrics: dict[str, float | None]) -> str:
    def percent(name: str, digits: int = 1) -> str:
        value = metrics[name]
        return "-" if value is None else f"{100 * value:.{digits}f} %"

    def ms(name: str) -> str:
        value = metrics[name]
        return "-" if value is None else f"{value:,.0f} ms"

    since_s, until_s = state.settling_ns / S, (state.settling_ns + LATELY_NS) / S
    rows = [
        ("delivered lately", f"<b>{percent('delivered_share')}</b> of packets {since_s:.0f} to {until_s:.0f} s old"),
        ("delay median, longest", f"{ms('delay_p50_ms')}, {ms('delay_max_ms')}"),
    ]
    if metrics["bound_max_ms"] is not None or metrics["bounds_broken"]:
        kept = f"{ms('bounded_p95_ms')}, {ms('bounded_max_ms')}; bound {ms('bound_max_ms')}"
        rows.append(("with a bound: 95 %, longest", f"{kept}, broken {metrics['bounds_broken']:.0f}"))
    if metrics["airtime_share"] is not None:
        rows.append(("air busy", f"{percent('airtime_lately_share')} lately, {percent('airtime_share')} on average"))
    if metrics["late_share"] is not None:
        rows.append(("frames late", f"{percent('late_share', 2)}, 99 of 100 below {ms('late_p99_ms')}"))
    if state.scenario.mission.survivors or state.scenario.mission.search != "none":
        rows.append(("confirmed", f"<b>{metrics['confirmed']:.0f} of {metrics['survivors']:.0f}</b>"))
        rows.append(("area covered", percent("coverage_share")))
    flown, heads, parts = len(state.uavs) - (state.scenario.post in state.uavs), len(state.heads()), state.parts()
    rows.append(("UAVs, clusters", f"{flown}, {heads}") if heads else ("UAVs", f"{flown}"))
    if parts is not None:
        rows.append(("parts that hear each other", f"{len(parts)}" if len(parts) == 1 else f"<b>{len(parts)}</b>"))
    return _box(_table(rows))


def _table(rows: Sequence[tuple[str, str]]) -> str:
    cells = "".join(f"<tr><td style='color:#666;padding-right:10px'>{k}</td><td>{v}</td></tr>" for k, v in rows)
    return f"<table>{cells}</table>"


def _box(content: str) -> str:
    return f"<div style='{_STYLE}'>{content}</div>"


def _number(text: str) -> int:
    return int(text) if text.isdigit() else 0


def _paced(pace: float) -> str:
    """How much faster or more slowly than it was something is shown."""
    if 0.8 < pace < 1.25:
        return ""
    return f", shown {pace:.0f} times as fast" if pace > 1 else f", slowed down {1 / pace:.0f} times"


def _messages(uav: UavNow) -> str:
    """The MAVLink on a UAV's tap: the kinds that came last, how many of each, and how often."""
    latest = sorted(uav.said.items(), key=lambda item: -item[1].last_ns)
    lines = []
    for kind, said in latest[:_OWN_MESSAGES]:
        span_s = (said.last_ns - said.first_ns) / S
        rate = f", {(said.number - 1) / span_s:.1f}/s" if span_s > 1 else ""
        known = common.mavlink_map.get(kind)
        lines.append(f"{known.msgname if known is not None else kind} {said.number}{rate}")
    more = len(latest) - len(lines)
    return "<br>".join([*lines, *([f"and {more} kinds more"] if more > 0 else [])])


def _dot(color: str) -> str:
    return f"<span style='color:{color}'>&#9679;</span>"


def legend(*, by_cluster: bool, links_known: bool) -> str:
    bars = ((colors.BLUE, "90 % received"), (colors.ORANGE, "half"), (colors.RED, "less"))
    links = ", ".join(f"<nobr><span style='color:{color}'>&#9644;</span> {said}</nobr>" for color, said in bars)
    modes = ((MODE_COLORS["search"], "search"), (MODE_COLORS["respond"], "respond"),
             (MODE_COLORS["deploy"], "on its way"), (MODE_COLORS["lost_link"], "hears nobody, or knows no place"),
             (HOMEWARD_COLOR, "homeward"))  # fmt: skip
    found = ("not heard", "detected", "approached", "reached", "inside", "among", "confirmed", "mistaken")
    people = ", ".join(f"<nobr>{_dot(STATUS_COLORS[status])} {status}</nobr>" for status in found)
    marks = ", ".join(f"<nobr>{_dot(color)} {said}</nobr>" for color, said in modes)
    uavs = "by cluster, heads larger" if by_cluster else marks
    lines = f"<b>Links</b> in the last 4 s: {links}." if links_known else "<b>Gray lines</b>: in each other's reach."
    return (
        f"{lines}<br><b>UAVs</b>: {uavs}; {_dot(FALLEN_COLOR)} fallen.<br><b>Survivors</b>: {people}; circles are "
        "estimates, two standard deviations wide."
    )
