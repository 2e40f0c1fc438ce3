"""`fanet keys`, `dialect` and `dissector`: files for other programs (Zenoh, MAVLink tools, Wireshark)."""

import gzip
import os
import re
import sys
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter

from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import replace_file, writing
from sim.cli.options import ScenarioFlags, ScenarioName
from sim.console import Console

_INCLUDE: Final = re.compile(r"<include>\s*(\S+?)\s*</include>")


def write_dialect(folder: Path) -> Path:
    """Write `v1.0/fanet.xml` and what it includes; returns its path. Raises ConfigError."""
    target = folder / "v1.0"
    ours, theirs = files("fanet_mw.dialect"), files("pymavlink.dialects.v20")
    try:
        definitions = _with_included(ours / "fanet.xml", theirs)
    except FileNotFoundError as error:
        raise ConfigError(f"{error.filename}: is missing: install pymavlink anew") from error
    with writing(target):
        target.mkdir(parents=True, exist_ok=True)
        for name, text in definitions.items():
            replace_file(target / name, text.encode())
    return target / "fanet.xml"


def _with_included(source: Traversable, theirs: Traversable) -> dict[str, str]:
    """The texts of a definition and of all definitions that it includes, by file name."""
    found: dict[str, str] = {}
    wanted = [source]
    while wanted:
        file = wanted.pop()
        found[file.name] = file.read_text(encoding="utf-8")
        wanted += [theirs / name for name in _INCLUDE.findall(found[file.name]) if name not in found]
    return found


def keys(
    scenario: ScenarioName,
    *,
    out: Path,
    choice: ScenarioFlags = ScenarioFlags(),
    swarm: str | None = None,
    host: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    days: int = 365,
) -> int:
    """Make certificates and access lists for a swarm: one file per participant, for --zenoh-config of
    fanet launch. Needs openssl.

    Args:
        scenario: The scenario of the swarm: it says which UAVs there are.
        out: Folder for router.json5, emulator.json5, world.json5, operator.json5 and agent-1.json5 and so on.
        swarm: Name of the swarm on the bus; by default the scenario's name.
        host: Name or address at which the router is reached, besides localhost; repeatable.
        days: How long the certificates are valid [days].

    """
    from sim.bus.rights import make

    chosen = choice.scenario(scenario)
    made = make(chosen, out, swarm=swarm or chosen.name, hosts=host, days=days)
    Console().print(f"{made} files written to {out}; each holds a private key", highlight=False, soft_wrap=True)
    return 0


def dialect(folder: Path | None = None, *, definitions: Annotated[bool, Parameter(negative="")] = False) -> int:
    """Print the path of fanet-mw's MAVLink dialect, fanet.xml, with the definitions that it includes beside it.

    Args:
        folder: Where to write them; by default `fanet-mw/message_definitions` in the user's folder of data.
        definitions: Print the folder of definitions instead, which pymavlink wants in MDEF.

    """
    path = write_dialect(folder or _data() / "fanet-mw" / "message_definitions")
    sys.stdout.write(f"{path.parents[1] if definitions else path}\n")
    return 0


def _data() -> Path:
    """The user's folder of data; raises ConfigError if the user has none."""
    try:
        return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    except RuntimeError as error:
        raise ConfigError("the user has no home folder (HOME is not set): say in which folder to write") from error


def dissector(folder: Path) -> int:
    """Install Wireshark's dissector for MAVLink with the messages of fanet-mw: writes mavlink.lua.

    Args:
        folder: Wireshark's folder of personal Lua plugins: see Help, About Wireshark, Folders.

    """
    path = folder / "mavlink.lua"
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        replace_file(path, gzip.decompress(files("emulator.wireshark").joinpath("mavlink.lua.gz").read_bytes()))
    Console().print(f"written to {path}; restart Wireshark", highlight=False, soft_wrap=True)
    return 0
