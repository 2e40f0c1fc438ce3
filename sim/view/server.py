"""The server of a view: on the loopback interface only, with nothing that asks anybody else for anything."""

import contextlib
import io
import math
import socket
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
import viser

from fanet_mw.errors import ConfigError
from sim.view.scene import Scene
from sim.view.shapes import Rows

HOST: Final = "127.0.0.1"
DEFAULT_PORT: Final = 8080
_TRIED_PORTS: Final = 20
_PHONE: Final = (
    "<style>@media (max-width: 576px) {"
    "div[style*='width: 20em'] {width: 100% !important}"
    "div[style*='max-height: 60%'] {max-height: 46% !important}"
    "}</style>"
)
"""On a phone viser has a sheet of fixed width in a corner; this lets it take the lower part of the screen."""
EYE: Final = (-0.2, -2.0, 1.5)
"""The place of the first camera, in units of half the side of the area."""
GOAL: Final = (0.04, -0.1, 0.0)
"""What it looks at, in the same units."""
_SKY: Final = np.full((2, 2, 3), (236, 240, 245), np.uint8)


@contextlib.contextmanager
def served(port: int | None) -> Iterator[viser.ViserServer]:
    """A server on this port, or on the first free one from the default on; raises ConfigError when it is taken."""
    chosen = _free_port() if port is None else port
    if not 1 <= chosen <= 65_535:
        raise ConfigError(f"--port {chosen}: must be in [1, 65535]")
    if not _is_free(chosen):
        raise ConfigError(f"--port {chosen}: is in use")
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a box of its own
        server = viser.ViserServer(host=HOST, port=chosen, verbose=False)
    server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
    server.gui.main_panel.dock_right()
    server.gui.add_html(_PHONE)
    server.scene.set_up_direction("+z")
    server.scene.world_axes.visible = False
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/light/ambient", intensity=0.6)
    server.scene.add_light_directional("/light/sun", intensity=1.9, position=(0.5, -0.8, 1.0), cast_shadow=False)
    server.scene.configure_default_lights(enabled=False)
    server.scene.set_background_image(_SKY)
    try:
        yield server
    finally:
        with contextlib.suppress(RuntimeError), contextlib.redirect_stdout(io.StringIO()):
            server.stop()


class Sight(NamedTuple):
    """Where a camera is, and what it looks at [m]."""

    eye: Rows
    goal: Rows
    reach: float

    def eye_for(self, aspect: float) -> Rows:
        """The place from which the whole area is seen on a screen of this width over height."""
        return self.eye if aspect >= 1 else self.goal + (self.eye - self.goal) / max(0.4, aspect)


def sight(scene: Scene) -> Sight:
    """From the south on the whole area."""
    uavs = [uav.position for uav in scene.state.uavs.values()]
    reach = max([scene.around.half_m, *(abs(value) for at in uavs for value in at[:2])])
    eye, goal = (np.array(at, np.float32) * reach for at in (EYE, GOAL))
    return Sight(eye, goal, reach)


def look_over(server: viser.ViserServer, scene: Scene) -> None:
    """Let the camera see the whole area, from the south, far enough for kilometres."""
    seen = sight(scene)
    eye, goal, reach = seen
    camera = server.initial_camera
    camera.position = eye
    camera.look_at = goal
    camera.up = (0.0, 0.0, 1.0)
    camera.far = 30.0 * reach
    camera.near = reach / 1000
    camera.fov = math.radians(45)

    def step_back(client: viser.ClientHandle) -> None:
        """On a narrow screen, a phone's, see the whole area from farther away, in its upper part."""
        if client.camera.aspect < 1:
            client.camera.position = seen.eye_for(client.camera.aspect)
            below = np.array((0.0, 0.0, 0.25 * math.dist(eye, goal) / client.camera.aspect))
            client.camera.look_at = goal - below  # the panel covers the lower part of such a screen

    server.on_client_connect(step_back)


def _free_port() -> int:
    for port in range(DEFAULT_PORT, DEFAULT_PORT + _TRIED_PORTS):
        if _is_free(port):
            return port
    raise ConfigError(f"--port: none of {DEFAULT_PORT} to {DEFAULT_PORT + _TRIED_PORTS - 1} is free")


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
    return True
