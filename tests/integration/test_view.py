"""The view shows the swarm as its trace tells it, again and live, and what is pressed in it happens."""

import errno
import json
import math
import os
import random
import re
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser
from kit import slow

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import CameraImage
from fanet_mw.errors import ConfigError
from fanet_mw.trace import FlightModeChanged, MissionModeChanged
from fanet_mw.units import S
from sim.cli.app import app
from sim.figures import colors
from sim.observation.swarm_state import SwarmState
from sim.observation.timeline import Timeline
from sim.results.result import Result
from sim.run.virtual import Observed, simulate
from sim.scenarios import catalog
from sim.view.actions import Actions
from sim.view.panels import Panels
from sim.view.replayed import told_apart, write_html
from sim.view.scene import CLUSTER_COLORS, Scene
from sim.view.server import served
from sim.view.shapes import linear, rgb


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine UAVs of which one is silent for five seconds, with a recording."""
    out = tmp_path_factory.mktemp("views") / "run"
    scenario = out.parent / "cut.toml"
    from sim.scenarios.catalog import text_of

    text = text_of("quick")
    scenario.write_text(f'{text}\n[[faults]]\nkind = "cut"\nnode = 4\nat_s = 12\nfor_s = 5\nlabel = "quiet"\n')
    words = ["simulate", str(scenario), "--out", str(out), "--record", str(out / "run.mcap"), "--json"]
    assert app(words, result_action="return_value") == 0
    return out


@pytest.fixture(scope="module")
def timeline(folder: Path) -> Timeline:
    return Timeline(folder)


def lines(folder: Path, kind: str) -> list[list[Any]]:
    found = (json.loads(line) for line in (folder / "trace.jsonl").read_text().splitlines())
    return [record[1:] for record in found if record[0] == kind]


def instants(seed: int) -> list[int]:
    """Whole seconds and instants between them, forwards and back."""
    draw = random.Random(seed)
    return [draw.randrange(1, 20) * S if draw.random() < 0.5 else draw.randrange(1, 20 * S) for _ in range(14)]


@pytest.mark.parametrize("seed", [1, *slow(2)])
def test_replayed_positions_are_those_of_the_trace(folder: Path, timeline: Timeline, seed: int) -> None:
    tracks: dict[int, list[tuple[int, tuple[float, ...]]]] = defaultdict(list)
    for t_ns, node, *at in lines(folder, "posed"):
        tracks[node].append((t_ns, tuple(at)))
    for t_ns in instants(seed):
        state = timeline.at(t_ns)
        assert sorted(state.uavs) == sorted(tracks)
        for node, track in tracks.items():
            index = bisect_right([one[0] for one in track], t_ns)
            (t0, a), (t1, b) = track[index - 1], track[min(index, len(track) - 1)]
            share = (t_ns - t0) / (t1 - t0) if t1 > t0 else 0.0
            flown = [x + share * (y - x) for x, y in zip(a, b, strict=True)]
            assert tuple(state.uavs[node].position) == pytest.approx(flown, abs=1e-6)


@pytest.mark.parametrize("seed", [3, *slow(4)])
def test_replayed_roles_drops_faults_and_packets_are_those_of_the_trace(
    folder: Path, timeline: Timeline, seed: int
) -> None:
    roles, drops = lines(folder, "role_changed"), lines(folder, "dropped")
    delivered, generated = lines(folder, "delivered"), lines(folder, "generated")
    for t_ns in instants(seed):
        state = timeline.at(t_ns)
        for node, uav in state.uavs.items():
            taken = [tuple(rest) for t, n, *rest in roles if n == node and t <= t_ns]
            assert (uav.role, uav.cluster, uav.head) == (taken[-1] if taken else ("", -1, 0))
            assert uav.drops == Counter(reason for t, n, reason, *_ in drops if n == node and t <= t_ns)
            assert uav.delivered == sum(n == node and t <= t_ns for t, n, *_ in delivered)
        assert set(state.faults) == ({"quiet"} if 12 * S <= t_ns < 17 * S else set())
        for _, origin, seq, *_ in (one for one in generated if t_ns - 15 * S <= one[0] <= t_ns):
            having = {n for t, n, o, s, *_ in delivered if (o, s) == (origin, seq) and t <= t_ns}
            assert set(state.packets[origin, seq].got) == having


def test_replayed_turns_are_those_in_which_heads_let_packets_out(folder: Path, timeline: Timeline) -> None:
    roles = lines(folder, "role_changed")
    inside = outside = packets = 0
    for t_ns, node, _ in lines(folder, "let_out"):
        taken = [role for t, n, role, *_ in roles if n == node and t <= t_ns]
        if taken[-1:] == ["head"] and t_ns > 7 * S:
            inside += node in timeline.at(t_ns).owners(t_ns)
            outside += node in timeline.at(t_ns).owners(t_ns + S // 2)
            packets += 1
    assert packets >= 20
    assert inside >= 0.95 * packets
    assert outside == 0


def test_a_jump_back_shows_what_was_shown_before(folder: Path) -> None:
    again = Timeline(folder)
    for t_s in (19, 5, 16, 2, 13):
        forward = Timeline(folder).at(t_s * S)
        back = again.at(t_s * S)
        for name in ("uavs", "packets", "estimates", "faults", "told", "broken"):
            assert getattr(back, name) == getattr(forward, name), name
        assert back.metrics() == forward.metrics()
        assert (back.covered() == forward.covered()).all()
        assert list(back.link_rows()) == list(forward.link_rows())


def test_links_of_a_replay_are_those_of_its_recording(folder: Path, timeline: Timeline) -> None:
    assert timeline.has_links
    rows = {(src, dst): (copies, received) for src, dst, copies, received in timeline.at(16 * S).link_rows()}
    assert len(rows) >= 40
    assert not any(received for (src, dst), (_, received) in rows.items() if 4 in (src, dst))
    assert any(received for (src, dst), (_, received) in rows.items() if {src, dst} == {1, 2})


def test_events_can_be_jumped_to_in_order(timeline: Timeline) -> None:
    texts = [event.text for event in timeline.events]
    assert any("radio fault cut quiet begins" in text for text in texts)
    assert any("becomes head" in text for text in texts)
    assert all(a.t_ns <= b.t_ns for a, b in pairwise(timeline.events))


def test_a_folder_without_a_run_cannot_be_replayed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"summary\.json"):
        Timeline(tmp_path)
    with pytest.raises(ConfigError, match="--start -1"):
        app(["replay", str(tmp_path), "--start", "-1"], result_action="return_value", exit_on_error=False)


# --- the scene ----------------------------------------------------------------------------------------------------


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    with served(None) as opened:
        yield opened


def test_the_server_is_on_the_loopback_interface_alone(server: viser.ViserServer) -> None:
    assert server.get_host() == "127.0.0.1"
    with pytest.raises(ConfigError, match=f"--port {server.get_port()}: is in use"), served(server.get_port()):
        pass
    with pytest.raises(ConfigError, match="--port 70000: must be in"), served(70_000):
        pass


def test_the_scene_shows_places_clusters_turns_links_and_survivors(
    server: viser.ViserServer, timeline: Timeline
) -> None:
    state = timeline.at(15 * S)
    scene = Scene(server, state, on_select=lambda _: None)
    t_ns = next(t for t in range(15 * S, 16 * S, S // 100) if state.owners(t))
    scene.draw(t_ns, all_of_it=True)

    def handle(name: str) -> Any:
        found = server.scene.get_handle_by_name(name)
        assert found is not None
        return found

    nodes = sorted(state.uavs)
    places = np.array([state.uavs[node].position for node in nodes])
    assert np.allclose(handle("/uavs").batched_positions, places, atol=1e-3)
    tints = [tuple(tint) for tint in handle("/uavs").batched_colors.tolist()]
    gray = (136, 136, 136)
    flown = [uav for _, uav in sorted(state.uavs.items())]
    shown = [rgb(CLUSTER_COLORS[uav.cluster]) if uav.cluster >= 0 else gray for uav in flown]
    assert tints == [tuple(linear(color).tolist()) for color in shown]
    owners = [state.uavs[node].position for node in state.owners(t_ns)]
    assert np.allclose(handle("/turn").batched_positions, owners, atol=1e-3)
    assert np.allclose(handle("/faulty").batched_positions, [state.uavs[4].position], atol=1e-3)
    members = sum(1 for uav in state.uavs.values() if uav.role == "member")
    assert handle("/clusters").points.shape == (members, 2, 3)
    pairs = {(min(a, b), max(a, b)) for a, b, _, received in state.link_rows() if received}
    assert len(handle("/links").points) == len(pairs)
    assert len(handle("/survivors").batched_positions) == 4
    east, north, *_ = handle("/world/covered").image.shape
    assert (east, north) == state.covered().shape
    north_row = handle("/world/covered").image[0, :, 0] == 164
    assert (north_row == state.covered()[-1]).all(), "the first row of the image is the northernmost"


def test_a_post_on_the_ground_is_no_uav_that_covers_anything(server: viser.ViserServer) -> None:
    scenario = catalog.find("quick", ["duration_s=12", "ground.at_m=[300,300]"])
    state = SwarmState(scenario)
    result = Result(simulate(scenario, observer=state))
    assert state.metrics()["coverage_share"] == pytest.approx(result.summary["mission"]["coverage"], abs=1e-6)
    assert scenario.post in state.uavs
    scene = Scene(server, state, on_select=lambda _: None)
    panels = Panels(server, scene, actions=None)
    scene.draw(state.t_ns, all_of_it=True)
    panels.refresh(state.t_ns)
    label = server.scene.get_handle_by_name(f"/names/uav-{scenario.post}")
    assert label is not None
    assert label.text == "post"
    assert "9, 2" in panels.texts["_figures"]


@pytest.mark.slow
def test_a_packets_spreading_ends_with_all_who_have_it(server: viser.ViserServer, timeline: Timeline) -> None:
    state = timeline.at(15 * S)
    scene = Scene(server, state, on_select=lambda _: None)
    scene.draw(15 * S)
    found = scene.spreading()
    assert found is not None
    (origin, _), packet = found
    counts = []
    for t_ns in range(15 * S, 15 * S + 5 * S // 2, S // 10):
        scene.draw(t_ns)
        counts.append(scene.shown_spread(t_ns)[0])
    assert counts[0] == 0
    assert counts[-1] == len(packet.got)
    assert counts == sorted(counts)
    rings = server.scene.get_handle_by_name("/spread")
    assert rings is not None
    assert len(rings.batched_positions) == len({*packet.got, origin})


def test_a_swarm_in_rounds_is_colored_by_what_uavs_do_and_its_turns_go_with_the_packet(
    server: viser.ViserServer,
) -> None:
    state = SwarmState(catalog.find("quick", ["routing.protocol=rounds", "duration_s=12"]))
    simulate(state.scenario, observer=state)
    state.take_records([
        MissionModeChanged(state.t_ns, 2, "respond", 1), MissionModeChanged(state.t_ns, 3, "return"),
        FlightModeChanged(state.t_ns, 4, "fallen"),
    ])  # fmt: skip
    scene = Scene(server, state, on_select=lambda _: None)
    panels = Panels(server, scene, actions=None)
    panels.select(2)
    scene.draw(10 * S, all_of_it=True)
    uavs = server.scene.get_handle_by_name("/uavs")
    assert uavs is not None
    wanted = [tuple(linear(rgb(color)).tolist()) for color in (colors.BLUE, colors.RED, colors.GRAY, colors.DARK)]
    assert [tuple(tint) for tint in uavs.batched_colors[:4].tolist()] == wanted
    found = scene.spreading()
    assert found is not None
    _, packet = found
    seen = set()
    for step in range(20):
        t_ns = 10 * S + step * S // 10
        scene.draw(t_ns)
        shown_ns = scene.turn_ns(t_ns)
        assert packet.born_ns <= shown_ns <= packet.born_ns + max(copy.delay_ns for copy in packet.got.values())
        seen.update(state.owners(shown_ns))
    assert len(seen) >= 3, "in slow motion several turns pass"
    panels.refresh(12 * S)
    texts = {name: re.sub(r"<[^>]+>", " ", text) for name, text in panels.texts.items()}
    assert "clusters" not in texts["_figures"]
    assert "parts that hear each other 1" in " ".join(texts["_figures"].split())
    assert "role" not in texts["_uav"]
    assert re.search(r"HEARTBEAT \d+, [\d.]+/s", texts["_uav"])
    assert re.search(r"queue\s+\d+ packets wait", texts["_uav"])
    assert "slowed down" in texts["_spread"]


class VirtualFeed:
    """What actions need of a feed, for a swarm in virtual time."""

    def __init__(self, observed: Observed) -> None:
        self.scenario, self.names, self.bus, self._host = observed.scenario, observed.names, self, observed.host

    def put(self, topic: str, payload: bytes, *, reliable: bool) -> None:
        assert reliable
        for message in codecs.decode(payload):
            self._host.put(topic, message)


@pytest.mark.slow
def test_a_uav_is_sent_to_the_mark_without_a_post_and_released_again() -> None:
    scenario = catalog.find("rescue", [
        "nodes.count=6", "nodes.spacing_m=60", "world.area_m=700", "mission.survivors=0", "duration_s=50",
        "traffic.arrivals=none",
    ])  # fmt: skip
    state = SwarmState(scenario)
    observed = Observed(scenario, observer=state)
    actions = Actions(VirtualFeed(observed), monotonic_s=lambda: observed.host.now_ns / S)  # type: ignore[arg-type]
    observed.host.start()

    def run(until_s: int) -> None:
        for t_ns in range(observed.host.now_ns, until_s * S, S // 2):
            actions.stay_present()
            observed.host.run(t_ns + S // 2)

    run(10)
    assert "sent to -120 m E, 90 m N" in actions.send(5, -120.0, 90.0)
    run(36)
    at = state.uavs[5].position
    assert math.hypot(at.east + 120, at.north - 90) < 15, "it is there, and stays although more than 10 s have passed"
    actions.release(5)
    run(48)
    at = state.uavs[5].position
    assert math.hypot(at.east + 120, at.north - 90) > 40, "it goes on with the search"
    actions.send(5, 5000.0, 0.0)
    run(50)
    assert any("does not do reposition: denied" in event.text for event in state.events if event.node == 5)


def test_what_is_switched_off_is_not_drawn(server: viser.ViserServer, timeline: Timeline) -> None:
    scene = Scene(server, timeline.at(15 * S), on_select=lambda _: None)
    scene.draw(15 * S, all_of_it=True)
    scene.shown = scene.shown._replace(links=False, clusters=False, trails=False, names=False, survivors=False)
    scene.draw(15 * S, all_of_it=True)
    for name in ("links", "clusters", "trails", "survivors", "names/uav-3", "names/survivor-1"):
        found = server.scene.get_handle_by_name(f"/{name}")
        assert found is not None
        assert not found.visible, name


def test_what_is_chosen_while_time_stands_is_drawn_at_once(server: viser.ViserServer, timeline: Timeline) -> None:
    scene = Scene(server, timeline.at(15 * S), on_select=lambda _: None)
    scene.selected = 1
    scene.draw(15 * S)
    scene.shown = scene.shown._replace(links=False, trails=False)
    scene.size_m, scene.target = 33.0, (10.0, 20.0)
    scene.draw(15 * S)
    links, trails, ring, mark = (
        server.scene.get_handle_by_name(f"/{name}") for name in ("links", "trails", "selected", "marks")
    )
    assert links is not None
    assert trails is not None
    assert not links.visible
    assert not trails.visible
    assert ring is not None
    assert list(ring.batched_scales) == [33.0], "rings are as large as the UAVs in them"
    assert mark is not None
    assert mark.visible


def test_a_jump_to_the_beginning_leaves_no_packet_on_the_screen(server: viser.ViserServer, folder: Path) -> None:
    timeline = Timeline(folder)
    scene = Scene(server, timeline.at(15 * S), on_select=lambda _: None)
    scene.draw(15 * S)
    spread = server.scene.get_handle_by_name("/spread")
    assert spread is not None
    assert spread.visible
    scene.state = timeline.at(S)
    scene.draw(S, all_of_it=True)
    assert scene.spreading() is None
    assert not spread.visible


def test_an_image_is_shown_again_once_its_uav_is_chosen_again(server: viser.ViserServer, timeline: Timeline) -> None:
    panels = Panels(server, Scene(server, timeline.at(S), on_select=lambda _: None), actions=None)
    one, other = (CameraImage(5 * S, 1, 1, bytes([shade] * 3)) for shade in (10, 200))
    for image in (one, None, one):
        panels.show_image(image)
        assert panels._image.visible == (image is not None)
    panels.show_image(other)
    assert panels._image.image.max() == 200, "of another UAV, of the same instant"


def test_the_post_on_the_ground_is_asked_for_nothing_that_only_a_uav_can_do(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = catalog.find("quick", ["ground.at_m=[0,0]"])
    post, state, observed = scenario.post, SwarmState(scenario), Observed(scenario)
    assert post is not None
    monkeypatch.setattr(state, "neighbors", lambda: {1: (post,), 2: (post,), post: (1, 2)})
    actions = Actions(VirtualFeed(observed))  # type: ignore[arg-type]
    panels = Panels(server, Scene(server, state, on_select=lambda _: None), actions=actions)
    observed.host.start()
    assert panels._on_a_hub(actions.cut) == f"UAV {post}: radio off"
    assert panels._on_a_hub(actions.crash, flies=True) == "UAV 1 crashes"
    panels.select(post)
    assert panels._on_chosen(actions.crash, flies=True) == "the post on the ground does not fly"
    assert panels._on_chosen(actions.cut) == f"UAV {post}: radio off"
    panels.select(3)
    assert panels._on_chosen(actions.crash, flies=True) == "UAV 3 crashes"
    panels.select(0)
    assert panels._on_chosen(actions.crash, flies=True) == "choose a UAV first"


def test_the_panel_says_what_the_state_knows(server: viser.ViserServer, timeline: Timeline) -> None:
    state = timeline.at(19 * S)
    scene = Scene(server, state, on_select=lambda _: None)
    panels = Panels(server, scene, actions=None)
    panels.select(4)
    scene.draw(19 * S)
    panels.refresh(19 * S)
    texts = {name: re.sub(r"<[^>]+>", " ", text) for name, text in panels.texts.items()}
    share = state.metrics()["delivered_share"]
    assert share is not None
    assert f"{100 * share:.1f} %" in texts["_figures"]
    assert 0.7 < share < 0.99, "one of nine is silent"
    assert "19.0 s" in texts["_clock"]
    assert "UAV 4" in texts["_uav"]
    assert f"cluster {state.uavs[4].cluster}" in texts["_uav"]
    assert "radio fault cut quiet begins" in texts["_events"]
    assert "slot" in texts["_spread"]


def test_one_file_holds_the_scene_and_asks_for_nothing(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.html"
    write_html(folder, path, tell=lambda _: None)
    page = path.read_text()
    assert len(page) > 500_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=[\"']?https?:", page)
    with pytest.raises(ConfigError, match="cannot be written"):
        write_html(folder, tmp_path / "no" / "such.html", tell=lambda _: None)


def test_a_server_that_does_not_start_is_no_fault_of_the_file(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_server(**_: object) -> viser.ViserServer:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(viser, "ViserServer", no_server)
    with pytest.raises(OSError, match=os.strerror(errno.EMFILE)):
        write_html(folder, tmp_path / "run.html", tell=lambda _: None)


def test_events_that_are_alike_are_told_apart() -> None:
    assert told_apart(["1.0 s  a", "1.0 s  b", "1.0 s  a", "1.0 s  a"]) == [
        "1.0 s  a", "1.0 s  b", "1.0 s  a (2)", "1.0 s  a (3)",
    ]  # fmt: skip
