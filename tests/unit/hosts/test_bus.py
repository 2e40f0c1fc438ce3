"""All work of a client's Zenoh session is done by the threads of one runtime, or by those that the user asks for."""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from kit import slow

from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts.bus import Bus, exposure, with_port
from sim.run.launcher.swarm import free_endpoint

CLIENT = """
import sys, time
from pathlib import Path
from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts.bus import Bus, exposure, with_port
def runtimes():
    names = {(task / "comm").read_text().strip().rpartition("-")[0] for task in Path("/proc/self/task").iterdir()}
    return " ".join(sorted(names & {"app", "rx", "tx", "net", "acc"}))
with Bus.join(sys.argv[1], patience_s=20) as bus:
    bus.ask("a/topic", lambda topic, payload: None)
    time.sleep(0.3)  # a thread that there is has its name by then
    ends_s = time.monotonic() + 20
    while runtimes() != sys.argv[2] and time.monotonic() < ends_s:
        time.sleep(0.05)
    print(runtimes())
"""
pytestmark = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="only Linux tells the names of threads")


@pytest.mark.parametrize(
    ("environment", "runtimes"),
    [({}, "app"), *slow(({"ZENOH_RUNTIME": "(tx: (handover: app), net: (handover: app))"}, "app rx"))],
)
def test_a_client_does_not_switch_between_threads_unless_the_user_asks_for_it(
    environment: Mapping[str, str], runtimes: str
) -> None:
    endpoint = free_endpoint()
    others = {key: value for key, value in os.environ.items() if key != "ZENOH_RUNTIME"}
    with Bus.serve(endpoint):
        client = subprocess.run(
            [sys.executable, "-c", CLIENT, endpoint, runtimes],
            env=others | environment, capture_output=True, text=True, timeout=60, check=True,
        )  # fmt: skip
    assert client.stdout.strip() == runtimes


@pytest.mark.parametrize("endpoint", ["127.0.0.1:7447", "localhost:7447", "tcp", "", "/127.0.0.1:7447", "tcp/"])
def test_what_is_no_endpoint_is_said_with_one_that_is(endpoint: str) -> None:
    for opened in (Bus.serve, Bus.join):
        with pytest.raises(ConfigError, match=r"must be PROTOCOL/ADDRESS, for example tcp/\S+:7447$|example tcp/tcp$"):
            opened(endpoint)
    assert exposure("127.0.0.1:7447", listens=True) is None, "no warning of what is refused anyway"


def test_port_0_becomes_one_that_is_free() -> None:
    assert re.fullmatch(r"tcp/127\.0\.0\.1:[1-9]\d{3,4}", with_port("tcp/127.0.0.1:0"))
    assert re.fullmatch(r"tls/0\.0\.0\.0:[1-9]\d{3,4}#so_rcvbuf=65000", with_port("tls/0.0.0.0:0#so_rcvbuf=65000"))
    for other in ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:70", "unixsock-stream//tmp/x"):
        assert with_port(other) == other
    with pytest.raises(BusError, match=r"cannot serve on tcp/192\.0\.2\.1:0"):
        with_port("tcp/192.0.2.1:0")


def test_a_configuration_that_is_no_json5_is_refused_with_the_place_and_what_is_expected_there(tmp_path: Path) -> None:
    (tmp_path / "z.json5").write_text("{nonsense")
    with pytest.raises(ConfigError, match=r"z\.json5: --> 1:1: expected array, boolean, null, number, object, or str"):
        Bus.serve("tcp/127.0.0.1:0", tmp_path / "z.json5")
