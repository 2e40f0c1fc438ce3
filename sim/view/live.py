"""`fanet view`: shows a running swarm until it is over or somebody ends the view."""

from collections.abc import Callable, Sequence
from typing import Any, Final

from fanet_mw.errors import BusError
from sim.observation.bus_feed import BusFeed, Paced
from sim.observation.swarm_state import SwarmState
from sim.view.actions import Actions
from sim.view.air import LiveAir
from sim.view.panels import Panels
from sim.view.scene import Scene
from sim.view.server import HOST, look_over, served

RATE_HZ: Final = 10.0


def view(
    feed: BusFeed, *, port: int | None, until_gone: bool, ended: Sequence[int], tell: Callable[[str], None]
) -> None:
    """Serve the view until `ended`; with `until_gone` also no longer than the swarm's router is there."""
    with served(port) as server:
        state = SwarmState(feed.scenario)
        panels: Panels
        scene = Scene(server, state, on_select=lambda node: panels.jobs.put(lambda: panels.select(node)))
        look_over(server, scene)
        actions = Actions(feed)
        panels = Panels(server, scene, actions=actions, air=LiveAir(feed))
        mark_clicks(server, scene, panels)
        tell(f"http://{HOST}:{server.get_port()} shows swarm {feed.names.swarm}")
        feed.listen(catches_up=True)
        paced = Paced(RATE_HZ)
        while not ended:
            note = ""
            try:
                feed.pump(state)
            except BusError:
                if until_gone:
                    return
                note = "the swarm has gone"
            if feed.over:
                note = "the swarm's time is over"
            elif feed.clock is None:
                note = "its clock does not run yet"
            if feed.lost:
                note = f"{note} {feed.lost} puts were lost".strip()
            state.time_scale = feed.time_scale
            panels.run_jobs()
            actions.stay_present()
            now_ns = feed.now_ns()
            scene.draw(now_ns)
            panels.refresh(now_ns, note=note)
            panels.show_image(feed.images.get(scene.selected))
            paced.wait()


def mark_clicks(server: Any, scene: Scene, panels: Panels) -> None:  # noqa: ANN401  (a server of viser)
    """Let a click on the ground set the mark."""

    def on_click(event: Any) -> None:  # noqa: ANN401  (viser's events)
        at = scene.on_ground(event.ray_origin, event.ray_direction)
        if at is not None and max(abs(at.east), abs(at.north)) <= 4 * scene.around.half_m:

            def mark() -> None:
                scene.target = (at.east, at.north)
                panels.say(f"mark at {at.east:.0f} m E, {at.north:.0f} m N")

            panels.jobs.put(mark)

    server.scene.on_click()(on_click)
