"""The rights of each participant of a swarm, as an access list of Zenoh's router: what is not allowed is denied.

Who puts and hears what: docs/how-to/security.md. Participants are identified by the common names of their certificates;
the launcher is the router itself, so that its own puts (the clock) pass no access list.
"""

from typing import Any, Final, NamedTuple

from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.scenario import Scenario
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
