"""The engine that moves the bodies where pybullet is not installed, for all who read a scenario on that machine."""

import sys
from functools import cache
from importlib.util import find_spec

from fanet_mw.scenario import Scenario


def with_engine(scenario: Scenario) -> Scenario:
    """The scenario; with the engine `kinematic` in place of a pybullet that is not there, which is said once."""
    if scenario.world.engine != "pybullet" or find_spec("pybullet") is not None:
        return scenario
    say()
    world = scenario.world.model_copy(update={"engine": "kinematic"})
    return scenario.model_copy(update={"world": world})


@cache
def say() -> None:
    sys.stderr.write(
        "pybullet is not installed (pip install 'fanet-mw[pybullet]'): world.engine = \"kinematic\" serves instead.\n"
    )
