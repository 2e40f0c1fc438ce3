"""What is given for a real radio: an epoch that is past or in another unit would be a flight that never begins."""

import socket
from contextlib import nullcontext

import pytest

from agents.__main__ import Radio, start
from agents.program.attached import OnAir
from agents.uav import Uav
from fanet_mw.errors import ConfigError
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.hosts.timebase import THIS_MACHINE
from fanet_mw.scenario import config
from fanet_mw.units import Enu, NodeId, S
from sim.run.virtual import actors_of

SCENARIO = config.build({"duration_s": 14, "nodes": {"count": 1}, "routing": {"protocol": "flooding"}})


@pytest.mark.parametrize("epoch_s", [float("nan"), float("inf"), -1.0, 5.0, 1e30, "passed", "in ms"])
async def test_an_epoch_whose_swarm_is_over_or_would_never_begin_is_refused(epoch_s: float | str) -> None:
    now_s = THIS_MACHINE.unix_ns() / S
    given = {"passed": now_s - 15, "in ms": now_s * 1000}.get(str(epoch_s), epoch_s)
    (uav,) = (actor for actor in actors_of(SCENARIO, "field") if isinstance(actor, Uav))
    on_air = OnAir("127.0.0.1", "127.255.255.255", epoch_unix_s=float(given))
    with pytest.raises(ConfigError, match=r"^epoch .*: by this machine's clock it is .* duration_s = 14 before"):
        async with on_air.opened(uav, SCENARIO, NodeId(1)):
            pass


@pytest.mark.parametrize(("ahead_s", "refused"), [(-13, False), (-15, True), (29 * 86400, False), (31 * 86400, True)])
async def test_who_comes_late_takes_part_while_the_swarm_lasts_and_a_month_ahead_is_refused(
    ahead_s: int, refused: bool
) -> None:
    (uav,) = (actor for actor in actors_of(SCENARIO, "field") if isinstance(actor, Uav))
    with socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    on_air = OnAir("127.0.0.1", "127.255.255.255", port, epoch_unix_s=THIS_MACHINE.unix_ns() / S + ahead_s)
    with pytest.raises(ConfigError) if refused else nullcontext():
        async with on_air.opened(uav, SCENARIO, NodeId(1)):
            pass


@pytest.mark.parametrize("port", [-1, 0, 65536])
async def test_a_port_that_is_none_is_refused(port: int) -> None:
    (uav,) = (actor for actor in actors_of(SCENARIO, "field") if isinstance(actor, Uav))
    on_air = OnAir("127.0.0.1", "127.255.255.255", port, epoch_unix_s=THIS_MACHINE.unix_ns() / S)
    with pytest.raises(ConfigError, match=rf"= {port}: must be in \[1, 65535\]"):
        async with on_air.opened(uav, SCENARIO, NodeId(1)):
            pass


@pytest.mark.parametrize(
    ("radio", "said"), [(Radio(epoch_unix_s=5), "--epoch 5: needs"), (Radio(port=9), "--radio-port 9: needs")]
)
def test_what_only_a_real_radio_heeds_is_refused_without_one(radio: Radio, said: str) -> None:
    with pytest.raises(ConfigError, match=f"^{said} --radio-address"):
        start(SCENARIO, SwarmAddress("field", "tcp/127.0.0.1:9"), node=NodeId(1), position=Enu(0, 0, 0), radio=radio)
