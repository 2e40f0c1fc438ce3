"""A command imports what it needs and no more: whoever asks for help does not wait for a physics engine."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from kit import slow

ROOT = Path(__file__).parents[3]
COMPUTE = ("numpy", "numba", "pybullet", "matplotlib", "pyarrow", "distributed", "emulator", "agents")
NETWORK = ("zenoh", "asyncio", "pymavlink")
MODELS = ("pydantic", "fanet_mw.scenario.model")
RIVALS = tuple(
    f"fanet_mw.routing.{name}" for name in ("clustered.build", "aodv", "olsr", "dsdv", "storm", "geographic")
)
"""The protocols that a scenario with plain flooding does not choose."""
RUN = (
    "import sys; from fanet_mw.__main__ import main\n"
    "try:\n"
    "    main()\n"
    "except SystemExit as end:\n"
    "    print('ended', end.code, file=sys.stderr)\n"
    "print('imported', *sys.modules, file=sys.stderr)"
)


def imported_by(*arguments: str) -> tuple[set[str], str]:
    """The modules that a command has imported at its end, and what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", RUN, *arguments],
        env=environment, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    ended, names = done.stderr.splitlines()[-2:]
    assert ended == "ended 0", done.stderr
    return set(names.split()), done.stdout


@pytest.mark.parametrize(
    ("arguments", "says", "without"),
    [
        (("--help",), "simulate", (*COMPUTE, *NETWORK, *MODELS)),
        (("simulate", "--help"), "deterministic", (*COMPUTE, *NETWORK, *MODELS)),
        (("check", "quick"), "is right", (*COMPUTE, *NETWORK)),
        (("show", "quick"), "[nodes]", (*COMPUTE, *NETWORK)),
        *slow(
            (("--version",), "0.", (*COMPUTE, *NETWORK, *MODELS, "rich.markdown")),
            (("__complete", "simulate", "fl"), "flooding", (*COMPUTE, *NETWORK, *MODELS)),
            (("scenarios",), "rescue", (*COMPUTE, *NETWORK, *MODELS)),
            (("swarms",), "swarm", (*COMPUTE, *NETWORK, *MODELS)),
            (("simulate", "flooding", "--duration", "1", "--set", "drain_s=0"), "delivered", RIVALS),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) and len(value) < 4 else None,
)
def test_a_command_imports_only_what_it_needs(arguments: tuple[str, ...], says: str, without: tuple[str, ...]) -> None:
    modules, printed = imported_by(*arguments)

    assert says in printed
    assert sorted(modules.intersection(without)) == []


def test_a_launcher_leaves_what_its_processes_do_to_the_server_that_they_are_forked_from() -> None:
    """It starts in half the time without, and a user waits for both, one after the other."""
    names = subprocess.run(
        [sys.executable, "-c", "import sys, sim.run.launcher.swarm; print(*sys.modules)"],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60, check=True,
    ).stdout.split()  # fmt: skip
    assert "numpy" in names
    assert not {"numba", "pymavlink", "emulator.medium", "agents.uav", "sim.world.world"}.intersection(names)
