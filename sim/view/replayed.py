"""`fanet replay`: a finished run in the same scene, with time to go through, or as one file that needs no network."""

import html
import time
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, S
from fanet_mw.whole_file import replace_file, writing
from sim.observation.bus_feed import Paced
from sim.observation.timeline import Timeline
from sim.view.air import CapturedAir
from sim.view.panels import Panels, legend
from sim.view.scene import Scene
from sim.view.server import HOST, Sight, look_over, served, sight

_RATE_HZ: Final = 10.0
_SPEEDS: Final = ("0.1", "0.5", "1", "2", "5", "10", "30")
_MOST_LISTED: Final = 300
_FRAMES: Final = 600
"""The greatest number of frames of a file."""
FILE_SPEED: Final = 10.0
"""Swarm seconds per second in a file."""


class _Player:
    """What plays: the time that is shown, and how it goes on."""

    def __init__(self, server: Any, timeline: Timeline, panels: Panels, *, start_ns: int) -> None:  # noqa: ANN401
        self._timeline, self._panels = timeline, panels
        self.t_ns, self.speed, self.plays = start_ns, 1.0, True
        self._shown_ns = start_ns
        gui = server.gui
        end_s = round(timeline.end_ns / S, 1)
        with gui.add_folder("Time", order=-1.0):
            self._slider = gui.add_slider(
                "swarm time [s]", min=0.0, max=end_s, step=0.1, initial_value=round(start_ns / S, 1)
            )
            self._group = gui.add_button_group("event", ("play", "earlier", "later"))
            self._speed = gui.add_dropdown("speed", _SPEEDS, initial_value="1")
            names = told_apart([f"{e.t_ns / S:.1f} s  {e.text}" for e in timeline.events[:_MOST_LISTED]])
            self._list = gui.add_dropdown("jump to", ["choose an event", *names])
        later = panels.later
        self._slider.on_update(later(lambda: self.jump(round(self._slider.value * S))))
        self._speed.on_update(later(self._change_speed))
        self._group.on_click(later(self._press))
        self._list.on_update(later(lambda: self._jump_to(self._list.value, names)))

    def advance(self, elapsed_s: float) -> None:
        if self.plays:
            self.t_ns = min(self._timeline.end_ns, self.t_ns + round(elapsed_s * self.speed * S))
            if self.t_ns // (500 * MS) != self._shown_ns // (500 * MS):
                self._shown_ns = self.t_ns
                self._slider.value = round(self.t_ns / S, 1)

    def jump(self, t_ns: int) -> None:
        self.t_ns = min(max(0, t_ns), self._timeline.end_ns)
        self._panels.clear_charts()

    def _jump_to(self, chosen: str, names: Sequence[str]) -> None:
        if chosen in names:
            self._see(self._timeline.events[names.index(chosen)].t_ns)

    def _change_speed(self) -> None:
        self.speed = float(self._speed.value)

    def _press(self) -> None:
        instants = [event.t_ns for event in self._timeline.events]
        if self._group.value == "play":
            self.plays = not self.plays
        elif self._group.value == "later":
            after = bisect_right(instants, self.t_ns)
            if after < len(instants):
                self._see(instants[after])
        else:
            before = bisect_left(instants, self.t_ns) - 1
            if before >= 0:
                self._see(instants[before])

    def _see(self, t_ns: int) -> None:
        self.jump(t_ns)
        self._slider.value = round(self.t_ns / S, 1)


def told_apart(names: Sequence[str]) -> list[str]:
    """Names with a number behind each that was there before: of two alike, viser's page stays blank."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def serve(folder: Path, *, port: int | None, start_s: float, ended: Sequence[int], tell: Callable[[str], None]) -> None:
    """Show a run until somebody ends it; raises ConfigError for a folder that holds none."""
    timeline = Timeline(folder)
    start_ns = round(start_s * S)
    if start_ns > timeline.end_ns:
        raise ConfigError(f"--start {start_s:g}: must be within 0 and {timeline.end_ns / S:g}, the end of {folder}")
    with served(port) as server:
        panels: Panels
        state = timeline.at(start_ns)
        scene = Scene(server, state, on_select=lambda node: panels.jobs.put(lambda: panels.select(node)))
        scene.by_range = not timeline.has_links
        look_over(server, scene)
        air = CapturedAir(folder, timeline.scenario, epoch_unix_ns=timeline.epoch_unix_ns)
        panels = Panels(server, scene, actions=None, air=air)
        player = _Player(server, timeline, panels, start_ns=start_ns)
        tell(f"http://{HOST}:{server.get_port()} replays {folder}")
        paced, then_s, drawn_ns = Paced(_RATE_HZ), time.monotonic(), -1
        while not ended:
            panels.run_jobs()
            now_s = time.monotonic()
            player.advance(now_s - then_s)
            then_s = now_s
            jumped = abs(player.t_ns - drawn_ns) > 2 * S * player.speed
            scene.state = panels.state = timeline.at(player.t_ns)
            drawn_ns = player.t_ns
            scene.draw(player.t_ns, all_of_it=jumped)
            panels.refresh(player.t_ns, all_of_it=jumped)
            paced.wait()


def _step_back(seen: Sight) -> str:
    """A script for narrow screens: the page is opened again with a camera that is farther away."""
    eye = ",".join(f"{value:.0f}" for value in seen.eye_for(0.4))
    return f"if (innerWidth < innerHeight && !location.search) location.search = '?initialCameraPosition={eye}'"


def _caption(scenario: Scenario, scene: Scene) -> str:
    """What a file says beside its scene: whose run it is, how fast it plays, and what the colors mean."""
    said = legend(by_cluster=scene.clustered, links_known=not scene.by_range)
    return (
        "<details open style='position: fixed; top: 8px; left: 8px; max-width: min(31em, 90vw); padding: 6px 10px; "
        "background: #fffd; border-radius: 6px; font: 13px/1.45 sans-serif; z-index: 1'><summary>"
        f"<b>{html.escape(scenario.name)}</b>, seed {scenario.seed}, {len(scenario.node_ids)} nodes; "
        f"plays {FILE_SPEED:g} swarm seconds a second</summary>{said}</details>"
        "<script>if (innerWidth < 700) document.querySelector('details').open = false</script>"
    )


def write_html(folder: Path, path: Path, *, tell: Callable[[str], None]) -> None:
    """Write the scene of a run as one file that plays without a network; raises ConfigError."""
    timeline = Timeline(folder)
    with served(None) as server:
        scene = Scene(server, timeline.at(0), on_select=lambda _: None)
        scene.by_range = not timeline.has_links
        scene.shown = scene.shown._replace(turns=False, spreading=False)
        look_over(server, scene)
        step_ns = max(S, -(-timeline.end_ns // _FRAMES // S) * S)
        serializer = server.get_scene_serializer()
        for t_ns in range(0, timeline.end_ns + 1, step_ns):
            scene.state = timeline.at(t_ns)
            scene.draw(t_ns)
            scene.write_time(t_ns)
            server.flush()
            serializer.insert_sleep(step_ns / S / FILE_SPEED)
        page = serializer.as_html().replace("<head>", f"<head><script>{_step_back(sight(scene))}</script>", 1)
        caption = _caption(timeline.scenario, scene)
    content = page.replace('<div id="root"></div>', f'<div id="root"></div>{caption}', 1)
    with writing(path):
        replace_file(path, content.encode())
    tell(f"written to {path}, {path.stat().st_size / 1e6:.1f} MB; it plays {FILE_SPEED:g} swarm seconds per second")
