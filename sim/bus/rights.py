"""The rights of each participant of a swarm, as an access list of Zenoh's router: what is not allowed is denied.

Who puts and hears what: docs/how-to/security.md. Participants are identified by the common names of their certificates;
the launcher is the router itself, so that its own puts (the clock) pass no access list.

`fanet keys` makes certificates for all participants, and this list. Each participant gets one Zenoh configuration file,
which can be carried to its machine. The authority's own key is made in a temporary folder and not kept, so whoever
needs another certificate makes new keys for all.
"""

import base64
import json
import os
import subprocess
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final, NamedTuple

from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.whole_file import replacing, writing
from sim.bus.operator_commands import OPERATOR

GATEWAY: Final = "gateway"
ROUTER: Final = "router"
"""The names of the certificates and configurations of a gateway's process and of the router."""
_INTO: Final = "ingress"
_OUT_OF: Final = "egress"


class Rights(NamedTuple):
    """What one participant may do, by key expressions."""

    puts: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    queries: tuple[str, ...] = ()
    alive: tuple[str, ...] = ()
    """Liveliness tokens that it may declare."""
    watches: tuple[str, ...] = ()
    """Liveliness tokens that it may watch."""


def rights(scenario: Scenario, names: Topics) -> dict[str, Rights]:
    """The rights of all participants of a swarm except the router, by name."""

    def actor(name: str, puts: tuple[str, ...], subscribes: tuple[str, ...]) -> Rights:
        return Rights(
            puts=(*puts, names.trace(name), names.report(name)),
            subscribes=(*subscribes, names.clock),
            queries=(names.clock, names.scenario),
            alive=(f"{names.alive(name)}/**",),
        )

    def agent(node: int) -> Rights:
        return actor(
            f"agent-{node}",
            (names.radio_tx(node), names.setpoint(node), names.mavlink(node)),
            (
                names.radio_rx(node),
                names.sensors(node),
                names.operator(node),
                *((names.orders,) if node == scenario.post else ()),
            ),
        )

    return {
        "emulator": actor(
            "emulator",
            (names.radio_rx("*"), names.radio_links),
            (names.all_tx, names.pose, names.obstruction, names.radio_control),
        ),
        "world": actor(
            "world",
            (names.pose, names.obstruction, names.all_sensors, names.radio_control),
            (names.all_setpoints, names.radio_control),
        ),
        **{f"agent-{node}": agent(node) for node in scenario.node_ids},
        OPERATOR: Rights(
            puts=(names.radio_control, names.clock_control, names.orders, names.operator("*")),
            subscribes=(
                names.pose,
                names.radio_links,
                names.all_traces,
                names.all_reports,
                names.mavlink("*"),
                names.clock,
                names.images,
            ),
            queries=(names.clock, names.scenario, names.standing),
            watches=(f"{ROOT}/*/alive/**",),
        ),
        GATEWAY: Rights(
            puts=(names.operator("*"),),
            subscribes=(names.mavlink("*"), names.clock),
            queries=(names.clock, names.scenario),
            watches=(f"{ROOT}/*/alive/**",),
        ),
    }


def access_control(participants: dict[str, Rights]) -> dict[str, Any]:
    everything = (f"{ROOT}/**",)
    rules: list[dict[str, Any]] = [
        # Without this rule a client's publisher never learns that there are subscribers, and sends nothing.
        _rule("know-of-others", _OUT_OF, ("declare_subscriber", "declare_queryable"), everything)
    ]
    policies = []
    for name, may in participants.items():
        own = [
            _rule(f"{name}-says", _INTO, ("put",), may.puts),
            _rule(f"{name}-listens", _INTO, ("declare_subscriber",), may.subscribes),
            _rule(f"{name}-hears", _OUT_OF, ("put",), may.subscribes),
            _rule(f"{name}-asks", _INTO, ("query",), may.queries),
            _rule(f"{name}-is-answered", _OUT_OF, ("reply",), may.queries),
            _rule(f"{name}-lives", _INTO, ("liveliness_token",), may.alive),
            _rule(f"{name}-looks", _INTO, ("liveliness_query", "declare_liveliness_subscriber"), may.watches),
            _rule(f"{name}-sees", _OUT_OF, ("liveliness_token",), may.watches),
        ]
        own = [rule for rule in own if rule["key_exprs"]]
        rules += own
        policies.append({"rules": ["know-of-others", *(rule["id"] for rule in own)], "subjects": [name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in participants],
        "policies": policies,
    }


def _rule(name: str, flow: str, messages: tuple[str, ...], keys: tuple[str, ...]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": list(keys)}


_NEW_KEY: Final = ("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
_AT_HOME: Final = ("DNS:localhost", "IP:127.0.0.1", "IP:::1")


def make(scenario: Scenario, out: Path, *, swarm: str, hosts: Iterable[str] = (), days: int = 365) -> int:
    """Write NAME.json5 for each participant into a folder; returns how many. Raises ConfigError when that fails."""
    participants = rights(scenario, Topics(swarm))
    names = ",".join((*_AT_HOME, *(_subject(host) for host in hosts)))
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor() as pool:
            authority = _CertificateAuthority(Path(folder), days=days)
            settings = list(pool.map(lambda name: authority.settings(name, names), [ROUTER, *participants]))
        settings[0]["access_control"] = access_control(participants)
        for name, content in zip([ROUTER, *participants], settings, strict=True):
            _write_secret(out / f"{name}.json5", json.dumps(content, indent=1) + "\n")
    return len(settings)


def _subject(host: str) -> str:
    """The name or address of a host in the form that certificates use."""
    try:
        return f"IP:{ip_address(host)}"
    except ValueError:
        return f"DNS:{host}"


class _CertificateAuthority:
    """Signs certificates; its files are in a folder that is removed with it."""

    def __init__(self, folder: Path, *, days: int) -> None:
        self._folder = folder
        self._days = str(days)
        ours = ("-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=critical,keyCertSign")
        self._make("ca", "fanet-authority", ours)

    def settings(self, name: str, hosts: str) -> dict[str, Any]:
        self._make(
            name,
            name,
            (
                "-CA", str(self._folder / "ca.pem"), "-CAkey", str(self._folder / "ca.key"),
                "-addext", "basicConstraints=critical,CA:FALSE",
                "-addext", f"subjectAltName=DNS:{name},{hosts}",
                "-addext", f"extendedKeyUsage={'serverAuth' if name == ROUTER else 'clientAuth'}",
            ),
        )  # fmt: skip
        side = "listen" if name == ROUTER else "connect"
        tls = {
            "root_ca_certificate_base64": self._text("ca.pem"),
            "enable_mtls": True,
            "verify_name_on_connect": True,
            f"{side}_private_key_base64": self._text(f"{name}.key"),
            f"{side}_certificate_base64": self._text(f"{name}.pem"),
        }
        return {"transport": {"link": {"tls": tls}}}

    def _make(self, file: str, name: str, more: tuple[str, ...]) -> None:
        key, certificate = self._folder / f"{file}.key", self._folder / f"{file}.pem"
        command = ["openssl", *_NEW_KEY, "-days", self._days, "-subj", f"/CN={name}"]
        try:
            subprocess.run(  # noqa: S603  (no shell, and every argument is made here or was checked by openssl)
                [*command, "-keyout", str(key), "-out", str(certificate), *more],
                check=True,
                capture_output=True,
                text=True,
            )
        except FileNotFoundError as error:
            raise ConfigError("fanet keys needs the command openssl (3.0 or later), and there is none") from error
        except subprocess.CalledProcessError as error:
            why = error.stderr.strip().splitlines() or ["no reason given"]
            raise ConfigError(f"openssl could not make the certificate of {name}: {why[-1]}") from error

    def _text(self, file: str) -> str:
        return base64.b64encode((self._folder / file).read_bytes()).decode()


def _write_secret(path: Path, text: str) -> None:
    """Write a file that only its owner can read, even if a file of that name existed with other rights."""
    with replacing(path) as file:
        os.fchmod(file.fileno(), 0o600)
        file.write(text.encode())
