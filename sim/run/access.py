"""Who of a swarm may say and hear what, as an access list of Zenoh's router: what is not allowed is denied.

    agent-N    says its own requests, setpoint, telemetry, trace and report; hears its own receptions and sensors
    emulator   says receptions, links, its trace and report; hears requests, poses, obstructions, changes of the air
    world      says poses, obstructions, sensors, radios of crashed UAVs, its trace and report; hears setpoints
    operator   says changes of the air; hears links, traces, reports and telemetry

All but the operator hear the clock, ask for it, and say that they are alive. The router itself is the launcher: its own
puts (the clock) pass no access list. Participants are known by the common names of their certificates. A put that is
denied vanishes without a word to whoever made it.
"""

from typing import Any, Final, NamedTuple

from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.scenario import Scenario
from sim.run.air import OPERATOR

_INTO: Final = "ingress"
_OUT_OF: Final = "egress"


class Rights(NamedTuple):
    """What one participant may do, by key expressions."""

    says: tuple[str, ...] = ()
    hears: tuple[str, ...] = ()
    asks: tuple[str, ...] = ()
    lives: tuple[str, ...] = ()
    """Liveliness tokens that it may declare."""
    watches: tuple[str, ...] = ()
    """Liveliness tokens that it may look for."""


def rights(scenario: Scenario, names: Topics) -> dict[str, Rights]:
    """Every participant of a swarm but the router, by its name."""

    def actor(name: str, says: tuple[str, ...], hears: tuple[str, ...]) -> Rights:
        return Rights(
            says=(*says, names.trace(name), names.report(name)),
            hears=(*hears, names.clock),
            asks=(names.clock,),
            lives=(names.alive(name),),
        )

    def agent(node: int) -> Rights:
        return actor(
            f"agent-{node}",
            (names.radio_tx(node), names.setpoint(node), names.mavlink(node)),
            (names.radio_rx(node), names.sensors(node)),
        )

    return {
        "emulator": actor(
            "emulator",
            (names.radio_rx("*"), names.radio_links),
            (names.all_tx, names.pose, names.obstruction, names.radio_control),
        ),
        "world": actor(
            "world", (names.pose, names.obstruction, names.all_sensors, names.radio_control), (names.all_setpoints,)
        ),
        **{f"agent-{node}": agent(node) for node in scenario.node_ids},
        OPERATOR: Rights(
            says=(names.radio_control,),
            hears=(names.radio_links, names.all_traces, names.all_reports, names.mavlink("*")),
            watches=(f"{ROOT}/*/alive/*",),
        ),
    }


def access_control(participants: dict[str, Rights]) -> dict[str, Any]:
    """The `access_control` of the router's configuration."""
    everything = (f"{ROOT}/**",)
    rules: list[dict[str, Any]] = [
        # Without these a client's publisher never learns that anyone listens, and stays silent.
        _rule("know-of-others", _OUT_OF, ("declare_subscriber", "declare_queryable"), everything)
    ]
    policies = []
    for name, may in participants.items():
        own = [
            _rule(f"{name}-says", _INTO, ("put",), may.says),
            _rule(f"{name}-listens", _INTO, ("declare_subscriber",), may.hears),
            _rule(f"{name}-hears", _OUT_OF, ("put",), may.hears),
            _rule(f"{name}-asks", _INTO, ("query",), may.asks),
            _rule(f"{name}-is-answered", _OUT_OF, ("reply",), may.asks),
            _rule(f"{name}-lives", _INTO, ("liveliness_token",), may.lives),
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
