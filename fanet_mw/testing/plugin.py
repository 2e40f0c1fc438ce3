"""Fixtures for pytest, for applications and programs of one's own (docs/how-to/send-messages.md, In a test).

`swarm` makes swarms in virtual time; `real_swarm` starts real processes. Both end what they began. This file imports
neither numpy nor the core until it is used.
"""

import contextlib
import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from fanet_mw.installation import damage, missing_extra

if TYPE_CHECKING:
    from sim.run.api import Launched
    from sim.run.virtual_swarm import VirtualSwarm

__all__ = ["LaunchSwarm", "MakeSwarm", "real_swarm", "swarm"]

MakeSwarm = Callable[..., contextlib.AbstractAsyncContextManager["VirtualSwarm"]]
"""What the fixture `swarm` is."""
LaunchSwarm = Callable[..., contextlib.AbstractAsyncContextManager["Launched"]]
"""What the fixture `real_swarm` is."""


def _emulator(module: str) -> Any:  # noqa: ANN401  (a module)
    """A module that runs swarms; skips the test without the emulator, fails if another package stands in its way."""
    try:
        return importlib.import_module(module)
    except (ImportError, AttributeError) as error:
        if isinstance(error, ModuleNotFoundError) and missing_extra(error) is not None:
            pytest.skip(f"needs fanet-mw[emulator]: {error}")
        pytest.fail(damage() or f"{module} cannot be imported: {error}")


@pytest.fixture
def swarm() -> MakeSwarm:
    """`swarm(scenario, applications=..., seed=..., overrides=[...])`: a swarm in virtual time, as a context manager."""
    made: MakeSwarm = _emulator("sim.run.virtual_swarm").VirtualSwarm
    return made


@pytest.fixture
def real_swarm() -> LaunchSwarm:
    """`real_swarm(scenario, leave_out=[3], overrides=[...])`: a swarm of processes, as a context manager."""
    found: LaunchSwarm = _emulator("sim.run.api").launch
    return found
