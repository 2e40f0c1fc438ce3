"""Scenarios from somebody else: one short line each, at once; nothing is called, and nothing of Python is imported."""

import os
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path

import pytest

from fanet_mw import extensions
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import config
from sim.cli.app import refused
from sim.scenarios import catalog
from sim.sweep import spec
from sim.world.possible_world import require_possible

DEEP, MANY = 1_000, 20_000
HOSTILE = {
    "arrays": "a = " + "[" * DEEP + "]" * DEEP,
    "dotted keys": "a" + ".a" * DEEP + " = 1",
    "tables": "a = " + "{a=" * DEEP + "1" + "}" * DEEP,
    "digits": "seed = " + "9" * 5_000,
    "hex digits": "[nodes]\ncount = 0x" + "f" * 5_000,
    "brackets in a key": '"a[b]" = 1',
    "markup in a key": '"[red]" = 1',
    "control characters in a key": '"a\\n\\u001b[31m" = 1',
    "unknown keys": "".join(f"k{i} = 1\n" for i in range(MANY)),
    "unknown keys of a table": "[radio]\n" + "".join(f"k{i} = 1\n" for i in range(MANY)),
    "a long name": f'name = "{"x" * 1_000_000}"',
    "NUL in a path": '[traffic]\npackets_csv = "a\\u0000b"',
    "a device as a file": '[traffic]\npackets_csv = "/dev/zero"',
    "a pipe as a file": '[traffic]\npackets_csv = "pipe"',
    "a pipe as a map": '[world]\nheightmap = "pipe"',
    "a pipe as buildings": '[world]\nbuildings_geojson = "pipe"',
    "a list in place of a word": "[radio]\nofdm_errors = []",
    "NUL in the path of a map": '[world]\nheightmap = "a\\u0000b"',
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_file_is_one_short_line_at_once(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "hostile.toml").write_text(HOSTILE[kind])
    began = time.process_time()  # beside other programs all takes longer
    with pytest.raises(ConfigError) as error:
        require_possible(config.load(tmp_path / "hostile.toml"))  # as `fanet check` does
    assert time.process_time() - began < 5
    assert refused(str(error.value)) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert len(printed) < 1_000
    assert printed.strip().isprintable()


@pytest.mark.parametrize("read", [config.load, lambda path: spec.find(str(path))])
def test_what_is_no_regular_file_is_no_scenario(read: object, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "device.toml").symlink_to("/dev/zero")
    (tmp_path / "folder.toml").mkdir()
    for name in ("pipe", "device", "folder"):
        with pytest.raises(ConfigError, match="not a regular file"):
            read(tmp_path / f"{name}.toml")  # type: ignore[operator]


def test_all_of_a_few_mistakes_are_named() -> None:
    with pytest.raises(ConfigError) as error:
        config.parse("a = 1\nb = 2\nduration_s = -1", source="x", name="x")
    assert [line.split(":")[1].split()[0] for line in str(error.value).splitlines()] == ["duration_s", "a", "b"]


@pytest.mark.parametrize(
    "named",
    ["os:system", "json:JSONDecoder", "sys:exit", "os:_exit", "time:sleep", "antigravity:geohash", "shutil:rmtree",
     "x:", ":y",
     "fanet_mw.units:Enu", "fanet_mw.node.contract:RoutingProtocol", "fanet_mw.application:AppPort", "..os:system"],
)  # fmt: skip
@pytest.mark.parametrize(
    "key", ["routing.protocol", "mobility.model", "clusters.method", "radio.channel", "applications"]
)
def test_what_is_no_part_is_refused_and_never_called(key: str, named: str) -> None:
    if key == "applications":
        with pytest.raises(ConfigError, match=r"applications\.use = "):
            config.parse(f'[[applications]]\nuse = "{named}"', source="x", name="x")
    else:
        with pytest.raises(ConfigError, match=key):
            catalog.find("quick", [f'{key}="{named}"'])
    assert "antigravity" not in sys.modules


def test_a_module_that_raises_or_exits_when_it_is_imported_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    codes = ("raise SystemExit(3)", "1 / 0", "def (", "\0", "import os; os._exit(0)", "raise GeneratorExit")
    for number, code in enumerate(codes):
        (tmp_path / f"hostile_{number}.py").write_text(code)
        with pytest.raises(ConfigError, match=f"hostile_{number}:Part cannot be imported"):
            catalog.find("quick", [f"routing.protocol=hostile_{number}:Part"])


def test_what_a_module_prints_when_it_is_imported_is_no_output_of_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "greeting.py").write_text(
        "from fanet_mw.routing.flooding import Flooding as Theirs\nclass Part(Theirs): pass\nprint('hello')"
    )
    catalog.find("quick", ["routing.protocol=greeting:Part"])
    assert capsys.readouterr() == ("", "hello\n")


@pytest.mark.parametrize(("where", "code", "said"), [("thread", 1, b"os._exit(0)"), ("fork", 0, b"")])
def test_a_thread_of_a_part_does_not_end_the_process_with_0_and_without_a_word(
    where: str, code: int, said: bytes
) -> None:
    read, write = os.pipe()
    with extensions.exits_raised():
        if not (child := os.fork()):
            with extensions.exits_raised() if where == "thread" else nullcontext():
                os.dup2(write, 2)
                threading.Thread(target=os._exit, args=(0,)).start()
                threading.Event().wait()
    os.close(write)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == code
    assert said in os.read(read, 999)
    os.close(read)
