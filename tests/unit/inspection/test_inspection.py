"""The inspector counts, decodes and follows what a swarm says, and shows it."""

import contextlib
import os
import pty
import shutil
import subprocess
import sys
import time
from array import array
from pathlib import Path

import pytest
from textual.widgets import Input, Static, TabbedContent

from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError
from fanet_mw.flavors import Mode
from fanet_mw.mavlink import Encoder
from fanet_mw.scenario import config
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Dropped, Generated, LetOut
from fanet_mw.units import MS, US, Enu, NodeId, S
from sim.inspection.inspection import Inspection, of_folder
from sim.inspection.messages import Messages, fields_of, name_of
from sim.inspection.packets import Packets
from sim.inspection.rows import Rows
from sim.inspection.screen import Inspector, recorded, turn_lines
from sim.inspection.topics import Heard, bandwidth, decoded, plain, rate
from sim.observation.turns import Span, Turns
from sim.results.files import finish
from sim.results.run_folder import RunFolder
from sim.run.virtual import simulate
from sim.scenarios import catalog

HERE = Enu(1.0, 2.0, 3.0)


def heartbeat(node: int = 1) -> bytes:
    return Encoder(NodeId(node), component=1).vehicle_heartbeat(Mode.HOLD, armed=True)


# --- messages -----------------------------------------------------------------------------------------------------


def test_rates_and_bytes_are_those_of_the_last_seconds() -> None:
    seen = Messages()
    for tenth in range(100):
        seen.take(3, "tap", tenth * 100 * MS, heartbeat(3))
        if tenth % 5 == 0:
            seen.take(3, "air", tenth * 100 * MS, heartbeat(3) * 2)
    by_way = {key.where: seen.streams[key] for key in seen.found()}
    assert by_way["tap"].rates(10 * S) == (10.0, 210.0)
    assert by_way["air"].rates(10 * S) == (4.0, 84.0)
    assert by_way["tap"].rates(30 * S) == (0.0, 0.0)
    assert by_way["tap"].count == 100


def test_a_filter_needs_all_its_words() -> None:
    seen = Messages()
    encoder = Encoder(NodeId(1), component=1)
    for node in (1, 12):
        seen.take(node, "tap", S, heartbeat(node) + encoder.attitude((0.1, 0.2, 0.3), now_ns=S))  # type: ignore[arg-type]
    assert [(key.node, name_of(key.message_id)) for key in seen.found("1 heart")] == [(1, "HEARTBEAT")]
    assert [key.node for key in seen.found("attitude")] == [1, 12]
    assert not seen.found("13")


def test_a_message_is_shown_with_units_and_the_names_of_its_values() -> None:
    fields = {field.name: field for field in fields_of(heartbeat())}
    assert fields["autopilot"].meaning == "PX4"
    assert fields["type"].meaning == "QUADROTOR"
    assert fields["base_mode"].meaning.split(" | ") == [
        "CUSTOM_MODE_ENABLED", "AUTO_ENABLED", "GUIDED_ENABLED", "STABILIZE_ENABLED", "SAFETY_ARMED",
    ]  # fmt: skip
    position = Encoder(NodeId(1), component=1).global_position(HERE, HERE, yaw=0.5, now_ns=S)
    assert {field.name: field.unit for field in fields_of(position)}["alt"] == "mm"


def test_noise_is_counted_and_shown_as_nothing() -> None:
    seen = Messages()
    seen.take(1, "air", 0, b"noise")
    assert (seen.count, seen.malformed) == (0, 1)
    assert fields_of(b"\xfd\x00") == []


def test_5000_messages_a_second_are_taken_in_far_less_than_a_second() -> None:
    seen, frames = Messages(), [heartbeat(node) for node in range(1, 46)]
    began_s = time.process_time()
    for number in range(5000):
        seen.take(number % 45 + 1, "air", number * MS // 5, frames[number % 45])
    assert time.process_time() - began_s < 0.5
    assert seen.count == 5000


# --- packets ------------------------------------------------------------------------------------------------------


def test_a_packet_is_followed_from_hop_to_hop_to_its_ends() -> None:
    packets = Packets()
    packets.take([
        Generated(S, 4, 7, "traffic", 300), LetOut(S + 5 * MS, 4, 7), Delivered(S + 8 * MS, 2, 4, 7, 8 * MS, 1),
        Delivered(S + 20 * MS, 9, 4, 7, 20 * MS, 2), Dropped(S + 21 * MS, 5, "hop_limit", 4, 7),
        Delivered(S, 1, 4, 8, MS, 1),
    ])  # fmt: skip
    assert packets.ways[4, 7].lines() == [
        "packet 7 of node 4: traffic, 300 bytes, handed over at 1.000 s",
        "  first frame announced 5.000 ms later",
        "  hop 1: 2 (8.0 ms)",
        "  hop 2: 9 (20.0 ms)",
        "  ended in node 5 at 1.021 s: hop_limit",
    ]


def test_for_whom_a_bound_does_not_hold_stands_beside_it() -> None:
    packets = Packets()
    packets.take([BoundStated(S, 4, 7, 50 * MS), BoundExcludes(S, 4, 7, 9), BoundExcludes(S, 4, 7, 2)])
    assert packets.ways[4, 7].lines()[1] == "  stated to arrive within 50.000 ms, but not at 2, 9, gone"


def test_the_oldest_packets_are_forgotten_and_counted() -> None:
    packets = Packets(most=10)
    packets.take(Generated(S, 1, seq, "traffic", 1) for seq in range(25))
    assert len(packets.ways) == 10
    assert packets.forgotten == 15
    assert (1, 24) in packets.ways


def test_whose_turn_it_is_stands_below_the_superframe() -> None:
    shown = turn_lines(Turns(0, 100 * MS, [Span(1, 0, 20 * MS), Span(2, 50 * MS, 50 * MS)], "turn"), 260 * MS)
    lines = shown.plain.splitlines()
    assert lines[0].startswith("superframe 2 of 100 ms, 60.0 ms into it; now: turn of 2")
    assert lines[2] == "    1 " + "#" * 20 + "." * 80
    assert lines[3] == "    2 " + "." * 50 + "#" * 50
    assert lines[4].index("^") == 66


# --- the screen ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run")
    finish(
        simulate(
            catalog.find("quick", ["duration_s=6", "warmup_s=2", "drain_s=1", "nodes.count=4", "clusters.count=1"])
        ),
        out=out,
    )
    return out


def test_the_messages_of_a_folder_have_instants_of_the_swarm(folder: Path) -> None:
    """They counted from the first one, and rates of all the time were too high."""
    run = RunFolder(folder)
    (first_us, _), *_ = run.telemetry()
    since = min(stream.first_ns for stream in of_folder(run).messages.streams.values())
    assert since == first_us * US - run.summary["epoch_unix_ns"] > 0


def test_a_log_that_is_no_file_is_not_waited_for(folder: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "run"))
    log = copy / "mavlink.tlog"
    whole = log.read_bytes()
    log.write_bytes(whole[:-1])
    cut = of_folder(RunFolder(copy)).messages
    assert (cut.malformed, cut.count) == (1, of_folder(RunFolder(folder)).messages.count - 1)
    log.unlink()
    os.mkfifo(log)
    assert of_folder(RunFolder(copy)).messages.count == 0


def test_links_that_carry_nothing_any_more_are_shown_no_more() -> None:
    seen = Inspection(config.build({}))
    seen.take_links(LinkStats(1 * S, S, array("H", [1, 2]), array("I", [1] * COUNTS), array("q", [0])))
    shown = []
    for t_ns in (2 * S, 4 * S):
        seen.take_poses(Poses(t_ns, array("H"), array("d")))
        shown.append(len(seen.links))
    assert shown == [1, 0]


def test_a_folder_is_looked_at_as_of_the_end_of_its_run(folder: Path) -> None:
    assert of_folder(RunFolder(folder)).now_ns == 6 * S


async def test_the_screens_show_a_recording(folder: Path) -> None:
    inspection = of_folder(RunFolder(folder))
    app = Inspector(inspection, title="a run", pump=lambda _: "nothing skipped", live=False)
    async with app.run_test(size=(150, 40)) as pilot:
        await pilot.pause()
        streams = app.query_one("#streams", Rows)
        assert streams.count == len(inspection.messages.streams) > 20
        app.query_one("#filter", Input).value = "2 heartbeat"
        await pilot.pause()
        app.refresh_all()
        assert streams.row(0)[:3] == ["2", "tap", "HEARTBEAT"]
        assert streams.count == 1
        app.query_one("#filter", Input).value = ""
        await pilot.press("escape", "2")
        await pilot.pause()
        assert app.query_one(TabbedContent).active == "packets"
        assert app.query_one("#ways", Rows).count > 3
        await pilot.press("down")
        await pilot.pause()
        assert "packet" in str(app.query_one("#way", Static).render())
        await pilot.press("4")
        await pilot.pause()
        assert app.query_one("#pairs", Rows).count == len(inspection.links) > 3
        assert "messages" in str(app.query_one("#status", Static).render())


async def test_on_a_terminal_of_80_columns_half_is_left_for_the_table(folder: Path) -> None:
    app = Inspector(of_folder(RunFolder(folder)), title="a run", pump=lambda _: "", live=False)
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        assert app.query_one("#streams", Rows).size.width >= 38


def test_without_a_terminal_it_says_what_serves_instead(folder: Path) -> None:
    with pytest.raises(ConfigError, match="fanet inspect: needs a terminal; fanet topic and fanet log"):
        recorded(folder)


async def test_a_frozen_screen_takes_nothing_in(folder: Path) -> None:
    pumps = []
    app = Inspector(Inspection(catalog.find("quick")), title="x", pump=lambda _: str(pumps.append(1)), live=True)
    async with app.run_test() as pilot:
        await pilot.pause()  # on a busy machine its widgets come later than its first key
        await pilot.press("f")
        count = len(pumps)
        app.refresh_all()
        assert len(pumps) == count
        assert "FROZEN" in str(app.query_one("#status", Static).render())
        await pilot.press("f")
        assert len(pumps) > count


async def test_a_tick_of_the_timer_after_the_widgets_have_gone_is_none(folder: Path) -> None:
    app = Inspector(of_folder(RunFolder(folder)), title="x", pump=lambda _: "", live=False)
    async with app.run_test() as pilot:
        await pilot.pause()
        await app.query("Screen > *").remove()
        app.tick()


@pytest.mark.slow
def test_sigterm_ends_it_at_once(folder: Path) -> None:
    ours, terminal = pty.openpty()
    command = [sys.executable, "-m", "fanet_mw", "inspect", str(folder)]
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    with subprocess.Popen(command, stdin=terminal, stdout=terminal, stderr=terminal, env=environment) as process:
        os.close(terminal)
        said = b""
        while b"HEARTBEAT" not in said:
            said += os.read(ours, 65_536)
        process.terminate()
        with contextlib.suppress(OSError):  # its end has closed the terminal
            while os.read(ours, 65_536):
                pass
        assert process.wait(20) == 0


def test_where_all_contend_is_drawn_above_the_turns() -> None:
    frame = Turns(0, 100 * MS, [Span(1, 0, 20 * MS), Span(2, 20 * MS, 20 * MS)], "turn", [(40 * MS, 60 * MS)])
    lines = turn_lines(frame, 150 * MS).plain.splitlines()
    assert lines[0].endswith("now: all contend")
    assert lines[2] == "  all " + "." * 40 + "~" * 60
    assert turn_lines(frame, 110 * MS).plain.splitlines()[0].endswith("now: turn of 1")


# --- topics -------------------------------------------------------------------------------------------------------


def test_rates_are_said_as_hands_that_know_ros_expect_them() -> None:
    window = [(number / 10, 50 + number) for number in range(11)]
    assert rate(window) == "average rate: 10.000  min: 0.100s max: 0.100s std dev: 0.00000s window: 11"
    assert bandwidth(window) == "555 B/s  mean: 55 B min: 50 B max: 60 B window: 11"
    assert rate(window[:1]) == "no rate yet: 1 puts"
    assert bandwidth([]) == "no bandwidth yet: 0 puts"


@pytest.mark.parametrize("name", ["a//b", "/a", "a/", "#", "a?b", "x*y", "a/***", ""])
def test_what_can_be_no_topic_is_refused_before_anything_is_joined(name: str) -> None:
    with pytest.raises(ConfigError, match=r"topic '.*': must be parts between slashes"):
        Heard("tcp/127.0.0.1:1", "quick", name, None)


def test_a_put_that_holds_no_messages_says_why() -> None:
    (one,) = decoded(b"garbage")
    assert type(one).__name__ == "Malformed"
    assert plain(one)["why"]


def test_a_message_becomes_json_with_its_mavlink_decoded() -> None:
    from fanet_mw.bus.messages import MavlinkTap, Poses

    said = plain(MavlinkTap(5, heartbeat(3)))
    assert said["t_ns"] == 5
    assert (said["data"][0]["message"], said["data"][0]["system"]) == ("HEARTBEAT", 3)
    assert plain(MavlinkTap(5, b"no frame"))["data"] == b"no frame".hex()
    from array import array

    assert plain(Poses(1, array("H", [1]), array("d", [0.5] * 6)))["ids"] == [1]
