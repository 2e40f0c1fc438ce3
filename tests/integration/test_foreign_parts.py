"""Parts of another package, installed beside ours, in virtual time and in every process: examples/swarm-parts."""

import json
import pickle
import sys
from pathlib import Path

import pytest
from installed import Installed

from fanet_mw import extensions
from fanet_mw.errors import ConfigError, LocalProtocolError
from fanet_mw.extensions import Options
from fanet_mw.scenario import config
from sim.cli.app import app
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "swarm-parts"


@pytest.mark.slow
def test_a_protocol_that_breaks_the_contract_is_told(installed: Installed, tmp_path: Path) -> None:
    """One that never ends a wake-up, and one that takes a packet and relays nothing."""
    (tmp_path / "broken.py").write_text(
        "from swarm_parts.gossip3 import Gossip3\n"
        "class Restless(Gossip3):\n"
        "    def next_wake_ns(self): return 1\n"
        "class Silent(Gossip3):\n"
        "    def receive(self, packet, reception, *, now_ns): pass\n"
    )
    (tmp_path / "test_broken.py").write_text(
        "from fanet_mw.testing.routing_contract import RoutingContract\n"
        "class TestRestless(RoutingContract): protocol = 'broken:Restless'\n"
        "class TestSilent(RoutingContract): protocol = 'broken:Silent'\n"
    )
    chosen = "wake_up or (Silent and nearly_all and all)"
    options = ["-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), "-k", chosen, "-o", "pythonpath=."]
    ended = installed.run(installed.python, "-m", "pytest", *options, "test_broken.py", cwd=tmp_path)
    assert "TestRestless::test_a_wake_up_that_has_come_is_done" in ended.stdout
    assert "TestSilent::test_a_connected_swarm_at_rest_gets_nearly_all[all]" in ended.stdout


def test_five_parts_of_another_package_serve_a_run(
    installed: Installed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(installed.site)
    extensions.load.cache_clear()
    scenario = config.load(EXAMPLE / "scenario.toml", ["nodes.count=9", "duration_s=14"])
    assert finish(simulate(scenario), out=tmp_path / "out")["pdr"] > 0.9
    reports = json.loads((tmp_path / "out" / "reports.json").read_text())
    assert len(reports["agent-1"]["applications"]["roll_call"]["heard"]) >= 7
    resolved = (tmp_path / "out" / "scenario.toml").read_text()
    assert "patience_ms = 50.0" in resolved, "the defaults of the package's own table are written out"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["routing.options.p=2"], "routing.options.p = 2: input should be less than or equal to 1"),
        (["routing.options.q=0.5"], "routing.options.q: unknown option; known: p, "),
        (["routing.protocol=gossip4"], "(installed: gossip3), nor MODULE:CLASS; did you mean gossip?"),
        (["mobility.model=orbt"], "did you mean orbit?"),
        (["routing.protocol=swarm_parts.gossip3:Gossip4"], "has no attribute 'Gossip4'"),
        (["routing.protocol=mine:Gossip"], "No module named 'mine'; install it, or put its folder on PYTHONPATH"),
        (
            ["applications.0.options.every_s=0"],
            "applications.options.every_s = 0: input should be greater than or equal to 0.1",
        ),
        (["applications.0.use=rolls"], "(installed: roll_call), nor MODULE:CLASS"),
        (["applications.0.nodes=[99]"], "applications.0.nodes names node 99, which must be <= nodes.count = 16"),
        (["mobility.model=static"], "mobility.options: model = 'static' is one of ours and has no options"),
    ],
)
def test_what_is_wrong_with_a_part_is_said_before_a_run(
    installed: Installed, monkeypatch: pytest.MonkeyPatch, changes: list[str], said: str
) -> None:
    monkeypatch.syspath_prepend(installed.site)
    extensions.load.cache_clear()
    with pytest.raises(ConfigError) as caught:
        config.load(EXAMPLE / "scenario.toml", changes)
    assert said in str(caught.value)


def test_clusters_may_be_made_by_another_package(installed: Installed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(installed.site)
    extensions.load.cache_clear()
    keys = ["clusters.method=cells", "clusters.options.cell_m=300", "duration_s=15", "warmup_s=8", "drain_s=3"]
    summary = finish(
        simulate(catalog.find("quick", [*keys, "world.engine=kinematic", "mission.survivors=0"])), out=None
    )
    assert summary["pdr"] > 0.9


@pytest.mark.parametrize("place", ["venv/lib/python3/site-packages", "usr/lib/python3/dist-packages"])
def test_a_part_is_its_sources_and_those_beside_it_without_libraries_of_any_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    (tmp_path / "part_of_one.py").write_text("import helper_of_one, library_of_one\n")
    libraries = tmp_path / place
    libraries.mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(libraries)

    def found(helper: str, library: str) -> str:
        (tmp_path / "helper_of_one.py").write_text(helper)
        (libraries / "library_of_one.py").write_text(library)
        extensions.digest.cache_clear()
        return extensions.digest("part_of_one")

    assert found("N = 1", "N = 1") == found("N = 1", "N = 2") != found("N = 2", "N = 2")


def test_a_scenario_with_options_is_a_key_of_a_cache_and_goes_to_other_processes_whole() -> None:
    options = Options({"fanout": 3})

    assert hash(options) == hash(Options({"fanout": 3})) != hash(Options({"fanout": 4}))
    assert pickle.loads(pickle.dumps(options)) == options
    with pytest.raises(TypeError, match="options do not change"):
        options["fanout"] = 4


PARTS = """
import math
import numpy as np
class Still:
    def __init__(self, starts, scenario): self.starts = starts
    def track(self, t_s): return self.starts, self.starts * 0
class Lost(Still):
    def track(self, t_s): return self.starts * math.nan, self.starts * 0
class Few(Still):
    def track(self, t_s): return self.starts[:1], self.starts[:1]
class Nowhere(Still):
    def track(self, t_s): return None
class Loss:
    def __init__(self, radio): pass
    def loss_db(self, distance_m, from_m, to_m): return 40 + 30 * np.log10(np.maximum(distance_m, 1))
    def reach_m(self, budget_db): return np.float32(1000)
class Unknown(Loss):
    def loss_db(self, distance_m, from_m, to_m): return distance_m * math.nan
class TwoLosses(Loss):
    def loss_db(self, distance_m, from_m, to_m): return np.zeros(2)
class Endless(Loss):
    def reach_m(self, budget_db): return math.nan
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("mobility.model=parts:Still", ""),
        (
            "mobility.model=parts:Lost",
            "'parts:Lost': track(0) must give the places and the velocities of 9 UAVs, three",
        ),
        ("mobility.model=parts:Few", "'parts:Few': track(0) must give the places"),
        ("mobility.model=parts:Nowhere", "three finite numbers each, not None"),
        ("radio.channel=parts:Loss", ""),
        ("radio.channel=parts:Unknown", "'parts:Unknown': loss_db() must give a number for each of 72 links, not"),
        ("radio.channel=parts:TwoLosses", "'parts:TwoLosses': loss_db() must give a number for each of "),
        ("radio.channel=parts:Endless", "reach_m(131) = nan must be > 0"),
    ],
)
def test_what_a_part_computes_is_checked_where_it_enters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str, said: str
) -> None:
    (tmp_path / "parts.py").write_text(PARTS)
    monkeypatch.syspath_prepend(tmp_path)
    scenario = catalog.find("quick", ["duration_s=3", "warmup_s=0", "drain_s=1", "mission.survivors=0", change])
    if not said:
        assert simulate(scenario).ended_ns is None
        return
    with pytest.raises(LocalProtocolError) as caught:
        simulate(scenario)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def named_by(key: str, name: str, *, source: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The change of a scenario that names a part, whose module is written anew and has not been imported."""
    module, _, _ = name.partition(":")
    (folder / f"{module}.py").write_text(source)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, module, raising=False)
    extensions.load.cache_clear()
    return f"applications=[{{use='{name}'}}]" if key == "applications.use" else f"{key}={name}"


UNMADE = """
import sys
from fanet_mw.application import Application
from fanet_mw.routing.flooding import Flooding
class Deaf(Flooding):
    def __init__(self): pass
class Broken(Flooding):
    def __init__(self, port):
        self.table = {}[port.node]
class Leaving(Flooding):
    def __init__(self, port): sys.exit(0)
class Kept(Flooding):
    def __init__(self, port): super().__init__(port, 7)
class Cells:
    def __init__(self, count): pass
    def divide(self, swarm): pass
class Track:
    def __init__(self, starts): pass
    def track(self, t_s): pass
class Loss:
    def __init__(self, radio, more): pass
    def loss_db(self, distance_m, from_m, to_m): pass
    def reach_m(self, budget_db): pass
class Finder(Application):
    name = "finder"
    def __init__(self, scenario, node): pass
"""


@pytest.mark.parametrize(
    ("key", "name", "said"),
    [
        (
            "routing.protocol",
            "parts:Deaf",
            "parts:Deaf cannot be made with (port): TypeError: Deaf.__init__() takes 1 ",
        ),
        ("routing.protocol", "parts:Broken", "parts:Broken has raised KeyError: 1, at {}:9, when it was made"),
        ("routing.protocol", "parts:Leaving", "parts:Leaving has raised SystemExit: 0, at {}:11, when it was made"),
        ("routing.protocol", "parts:Kept", "at {}:13, when it was made"),
        ("clusters.method", "parts:Cells", "parts:Cells cannot be made with (count=, range_m=, options=): TypeError: "),
        ("mobility.model", "parts:Track", "parts:Track cannot be made with (starts, scenario): TypeError: "),
        ("radio.channel", "parts:Loss", "parts:Loss cannot be made with (radio): TypeError: "),
        ("applications.use", "parts:Finder", "parts:Finder cannot be made with (scenario, node, options): TypeE"),
    ],
)
def test_a_part_that_cannot_be_made_is_named_with_its_class_and_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, name: str, said: str
) -> None:
    change = named_by(key, name, source=UNMADE, folder=tmp_path, monkeypatch=monkeypatch)
    scenario = catalog.find("quick", ["duration_s=3", "warmup_s=0", "drain_s=1", "mission.survivors=0", change])
    with pytest.raises(ConfigError) as caught:
        simulate(scenario)
    assert str(caught.value).startswith(f"{key} = {name!r}: ")
    assert said.format(tmp_path / "parts.py") in str(caught.value)
    words = ["check", "quick", "--set", "mission.survivors=0", change]
    with pytest.raises(ConfigError) as checked:
        app(words, result_action="return_value")
    assert str(checked.value) == str(caught.value), "a check says so before a run"


def test_a_part_that_cannot_be_made_is_named_by_its_entry_point(
    installed: Installed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(installed.site)
    extensions.load.cache_clear()
    with pytest.raises(ConfigError) as caught:
        extensions.make("routing.protocol", "gossip3")
    assert str(caught.value).startswith(
        "routing.protocol = 'gossip3': the entry point of fanet_mw.routing for swarm_parts.gossip3:Gossip3 cannot be "
        "made with (port): TypeError: "
    )


RAISING = """
import sys
from fanet_mw.application import Application
from fanet_mw.routing.flooding import Flooding
from sim.world.mobility.models import Formation as Static
class Finder(Application):
    name = "finder"
    def __init__(self, scenario, node, options): pass
    def next_wake_ns(self): return 2_600_000_000
    def wake(self, now_ns): self.look()
    def look(self): return {}[7]
class Leaver(Finder):
    def look(self): sys.exit(0)
class Quitter(Finder):
    def look(self):
        import os
        os._exit(0)
class Presser(Finder):
    def look(self): raise KeyboardInterrupt
class Canceller(Finder):
    def look(self):
        from asyncio import CancelledError
        raise CancelledError
class Mover(Finder):
    def look(self):
        import os
        os.chdir("/")
        os.umask(0o777)
        raise ValueError
class Proto(Flooding):
    def receive(self, packet, reception, *, now_ns):
        assert now_ns < 2_600_000_000, "what\\nis this"
        super().receive(packet, reception, now_ns=now_ns)
class Sender(Flooding):
    def receive(self, packet, reception, *, now_ns):
        for dst in (1, 2) if now_ns > 2_600_000_000 else ():
            self._port.transmit(packet.frame, dst, now_ns + 9_000_000)
        assert now_ns <= 2_600_000_000, "after it has sent"
        super().receive(packet, reception, now_ns=now_ns)
class Course(Static):
    def track(self, t_s): return super().track(t_s) if t_s < 2.6 else 1 / 0
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            'applications=[{use="raising:Finder",nodes=[3]}]',
            "raising:Finder.wake (agent-3, at 2.6 s) has raised KeyError: 7",
        ),
        ('applications=[{use="raising:Leaver",nodes=[3]}]', "has called sys.exit(0) at 2.6 s (agent-3, at 2.6 s)"),
        ('applications=[{use="raising:Quitter",nodes=[3]}]', "has called os._exit(0) (agent-3, at 2.6 s)"),
        ('applications=[{use="raising:Presser",nodes=[3]}]', "has raised KeyboardInterrupt at 2.6 s (agent-3, at 2.6"),
        ('applications=[{use="raising:Canceller",nodes=[3]}]', "has raised CancelledError at 2.6 s (agent-3, at 2.6"),
        (
            'applications=[{use="raising:Mover",nodes=[3]}]',
            "raising:Finder.wake (agent-3, at 2.6 s) has raised ValueE",
        ),
        ("routing.protocol=raising:Proto", " s) has raised AssertionError: what is this"),
        ("routing.protocol=raising:Sender", " s) has raised AssertionError: after it has sent"),
        ("mobility.model=raising:Course", "raising:Course.track (world, at 2.7 s) has raised ZeroDivisionError: div"),
    ],
)
def test_what_was_flown_until_a_part_raises_is_kept_and_said_to_have_been_ended_by_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], change: str, said: str
) -> None:
    (tmp_path / "raising.py").write_text(RAISING)
    monkeypatch.syspath_prepend(tmp_path)
    keys = ["warmup_s=1", "drain_s=1", "traffic.interval_s=0.2", "mission.survivors=0", change]
    monkeypatch.chdir(tmp_path)
    words = ["simulate", "quick", "--duration", "9", "--out", "out", "--record", "r.mcap", "--set", *keys]
    assert app(words, result_action="return_value", exit_on_error=False, print_error=False) == 1
    err = capsys.readouterr().err
    assert "ended early: " in err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    (why,) = summary["invalid_because"]
    assert why.startswith("partial result: ")
    assert said in why
    assert 2 < summary["simulated_s"] < 9
    assert summary["frames"]["delivered"] > 5
    assert summary["frames"]["closes"], summary["frames"]
    assert (tmp_path / "out" / "trace.jsonl").stat().st_size > 1000
    assert all(path.stat().st_mode & 0o600 == 0o600 for path in (tmp_path / "out").iterdir()), "they can be read"


MISFITS = """
from fanet_mw.application import Application
from fanet_mw.routing.flooding import Flooding
from fanet_mw.node.contract import RoutingProtocol
class Waiting(Application):
    async def on_message(self, message, now_ns): pass
class Yielding(Application):
    def wake(self, now_ns): yield
class Short(Application):
    def on_fix(self, fix): pass
class Longer(Application):
    def on_fix(self, fix, now_ns, more): pass
class Lenient(Application):
    def __init__(self, *given): pass
    def on_fix(self, *given, more=None): pass
class Positional(Flooding):
    def receive(self, packet, reception, now_ns, /): pass
class Untimed(Flooding):
    def hello_inner(self, room): return b""
class Partly:
    start = originate = receive = wake = next_wake_ns = report = lambda self, *given, **named: None
class Track:
    def track(self): pass
class Loss:
    def loss_db(self, distance_m): pass
    def reach_m(self, budget_db): pass
class Cells:
    def divide(self): pass
"""


@pytest.mark.parametrize(
    ("key", "name", "said"),
    [
        ("applications.use", "Waiting", "has a method on_message that is async, and would never be awaited"),
        ("applications.use", "Yielding", "has a method wake that is a generator, and would never run"),
        ("applications.use", "Short", "has a method on_fix that takes (fix), and is called with (fix, now_ns)"),
        ("applications.use", "Longer", "has a method on_fix that takes (fix, now_ns, more), and is called with (fix,"),
        ("applications.use", "Lenient", ""),
        ("routing.protocol", "Positional", "has a method receive that takes (packet, reception, now_ns), and is cal"),
        ("routing.protocol", "Untimed", "has a method hello_inner that takes (room), and is called with (room, *, now"),
        ("routing.protocol", "Partly", "lacks the method hello_inner(room, *, now_ns)"),
        ("mobility.model", "Track", "has a method track that takes (), and is called with (t_s)"),
        ("radio.channel", "Loss", "has a method loss_db that takes (distance_m), and is called with (distance_m, "),
        ("clusters.method", "Cells", "has a method divide that takes (), and is called with (swarm)"),
    ],
)
def test_a_method_that_cannot_be_called_as_its_contract_calls_it_is_named_when_the_scenario_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, name: str, said: str
) -> None:
    part = f"misfits:{name}"
    change = named_by(key, part, source=MISFITS, folder=tmp_path, monkeypatch=monkeypatch)
    if not said:
        catalog.find("quick", [change])
        return
    with pytest.raises(ConfigError) as caught:
        catalog.find("quick", [change])
    assert f"{part} {said}" in str(caught.value)


WRONG = """
import math
from fanet_mw.application import Application, Data
from fanet_mw.routing.clustered.clustering import Cluster, Promise
from fanet_mw.routing.flooding import Flooding
from fanet_mw.units import BROADCAST
class Fractional(Flooding):
    def originate(self, packet, *, due_ns, now_ns): self._port.transmit(packet.frame, BROADCAST, now_ns + 5e6)
class Bundled(Flooding):
    def originate(self, packet, *, due_ns, now_ns):
        self._port.transmit_together([packet], flags=1, at_ns=[now_ns + 5e6])
class Texting(Flooding):
    def originate(self, packet, *, due_ns, now_ns): self._port.transmit("hello", BROADCAST, due_ns)
class Odd(Flooding):
    def receive(self, packet, reception, *, now_ns): return [7]
class Talking(Flooding):
    def hello_inner(self, room, *, now_ns): return b"x" * (room + 1)
class Hurried(Flooding):
    def hello_share(self, *, now_ns): return math.nan
class Noting(Flooding):
    def originate(self, packet, *, due_ns, now_ns): self._port.record("sent")
class Lone:
    promise = Promise(dominating=False)
    def __init__(self, *, count, range_m, options): pass
    def divide(self, swarm): return [Cluster(1, (1,))]
class Remote(Lone):
    def divide(self, swarm): return [Cluster(99, tuple(sorted(swarm.positions)))]
class Undecided(Lone):
    promise = None
class Scribe(Application):
    name = "scribe"
    def __init__(self, scenario, node, options): pass
    def next_wake_ns(self): return 2_600_000_000
    def wake(self, now_ns): self.port.record("seen")
class Restless(Scribe):
    def wake(self, now_ns): pass
class Sleepless(Flooding):
    def next_wake_ns(self): return 2_600_000_000
class Tapper(Scribe):
    def wake(self, now_ns): self.port.tap(b"no frame")
class Patient(Scribe):
    def wake(self, now_ns): self.port.send(Data(7, b""), lifetime_ns=0.5)
class Far(Scribe):
    def wake(self, now_ns): self.port.send(Data(7, b""), destination=99)
class Greeter(Scribe):
    def hello_frames(self, now_ns): return b"no frame"
class Novelist(Scribe):
    def hello_frames(self, now_ns): return b"x" * 3000
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("routing.protocol=wrong:Fractional", "'wrong:Fractional' transmits with start_ns = "),
        ("routing.protocol=wrong:Bundled", "'wrong:Bundled' transmits with start_ns = "),
        ("routing.protocol=wrong:Texting", "'wrong:Texting' transmits 'hello', which must be bytes"),
        ("routing.protocol=wrong:Odd", "'wrong:Odd': receive() must give relays, not 7"),
        ("routing.protocol=wrong:Talking", "'wrong:Talking': hello_inner(2171) must give at most so many bytes, not 2"),
        ("routing.protocol=wrong:Hurried", "'wrong:Hurried': hello_share() = nan must be a number above 0"),
        ("routing.protocol=wrong:Noting", "'wrong:Noting': record() takes a record of fanet_mw.trace, not 'sent'"),
        ("clusters.method=wrong:Lone", "'wrong:Lone': divide() must give clusters with each of the nodes ["),
        ("clusters.method=wrong:Remote", "'wrong:Remote': divide() must give clusters with each of the nodes ["),
        ("clusters.method=wrong:Undecided", "'wrong:Undecided': promise = None must be a Promise"),
        (
            "applications=[{use='wrong:Scribe'}]",
            "application 'scribe' (wrong:Scribe): record() takes a record of fanet",
        ),
        (
            "applications=[{use='wrong:Restless',nodes=[3]}]",
            "at 2.6 s, agent-3 the last: application 'scribe' (wrong:R",
        ),
        ("routing.protocol=wrong:Sleepless", " the last: routing.protocol = 'wrong:Sleepless'"),
        ("applications=[{use='wrong:Tapper'}]", "application 'scribe' (wrong:Tapper): tap(): no MAVLink 2 frame at by"),
        ("applications=[{use='wrong:Patient'}]", "lifetime_ns = 0.5 must be a whole number of ns above 0"),
        ("applications=[{use='wrong:Greeter'}]", "application 'scribe' (wrong:Greeter): hello_frames(): no MAVLink 2"),
        ("applications=[{use='wrong:Novelist'}]", "(wrong:Novelist): hello_frames(): 3000 bytes must be <= 2"),
    ],
)
def test_what_a_part_asks_for_is_checked_before_another_actor_hears_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str, said: str
) -> None:
    (tmp_path / "wrong.py").write_text(WRONG)
    monkeypatch.syspath_prepend(tmp_path)
    scenario = catalog.find("quick", ["duration_s=8", "warmup_s=0", "drain_s=1", "mission.survivors=0", change])
    with pytest.raises((ConfigError, LocalProtocolError)) as caught:
        simulate(scenario)
    assert said in str(caught.value)


def test_a_mistake_that_our_code_finds_is_said_with_the_function_of_the_part_that_made_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.py").write_text(WRONG)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    words = ["simulate", "quick", "--set", "applications=[{use='wrong:Far'}]"]
    assert app(words, result_action="return_value", exit_on_error=False, print_error=False) == 1
    assert "ended early: wrong:Far.wake (agent-" in (err := capsys.readouterr().err)
    assert " at 2.6 s) has raised LocalProtocolError: destination = 99 must be " in err
