"""From which modules of other packages a scenario takes parts."""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.extensions import digest, module_of
from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.tables.clusters import METHODS
from fanet_mw.scenario.tables.mobility import MOBILITY_MODELS
from fanet_mw.scenario.tables.radio import CHANNELS
from fanet_mw.scenario.tables.routing import PROTOCOLS

_OURS: Final[Mapping[str, Sequence[str]]] = {
    "routing.protocol": PROTOCOLS,
    "clusters.method": METHODS,
    "mobility.model": MOBILITY_MODELS,
    "radio.channel": CHANNELS,
    "applications.use": (),
}
"""The keys that name parts, and those parts that are this project's own."""


def modules_of(scenario: Scenario) -> dict[str, str]:
    """The digests of the modules from which the scenario takes parts."""
    named = [
        ("routing.protocol", scenario.routing.protocol),
        ("clusters.method", scenario.clusters.method),
        ("mobility.model", scenario.mobility.model),
        ("radio.channel", scenario.radio.channel),
        *(("applications.use", application.use) for application in scenario.applications),
    ]
    modules = {module_of(key, name) for key, name in named if name not in _OURS[key]}
    return {module: digest(module) for module in sorted(modules - {""})}
