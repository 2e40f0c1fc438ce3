"""The summary of one run of a shipped scenario; what two tables need is measured once."""

from functools import lru_cache
from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog


@lru_cache(maxsize=64)
def summarized(scenario: str, *settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find(scenario, list(settings))), out=None)
