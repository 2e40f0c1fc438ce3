"""The groups in which `fanet --help` lists the commands, in the order in which a newcomer meets them."""

from typing import Final

from cyclopts import Group

RUN: Final = Group("Run a swarm", sort_key=1)
SCENARIO: Final = Group("Scenarios", sort_key=2)
STUDY: Final = Group("Many runs, figures and reports", sort_key=3)
RUNNING: Final = Group("While a swarm runs", sort_key=4)
SERVICE: Final = Group("Services one by one (instead of fanet launch)", sort_key=5)
TOOLS: Final = Group("For other tools", sort_key=6)
OPTIONS: Final = Group("Options", sort_key=7)
