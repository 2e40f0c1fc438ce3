"""The sensor of the battery: a power module with a coulomb counter, whose errors are negligible here."""

from collections.abc import Iterator, Sequence

from fanet_mw.bus.messages import Battery, Message
from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from sim.world.engines.battery_drain import BatteryDrain
from sim.world.sensors.contract import Sensor, Truth


class BatterySensor(Sensor):
    """One power module per UAV."""

    kind = "battery"

    def __init__(self, scenario: Scenario, drain: BatteryDrain) -> None:
        self.period_ns = round(S / scenario.sensors.battery_hz)
        self._batteries = drain.batteries

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        batteries = self._batteries
        for row in rows:
            yield (
                row,
                Battery(
                    truth.now_ns,
                    float(batteries.voltage_v[row]),
                    float(batteries.current_a[row]),
                    float(batteries.charge[row]),
                ),
            )
