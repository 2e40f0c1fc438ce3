"""The `[radio]` table of a scenario: PHY, MAC and channel, and which of its keys fit together.

Some defaults depend on `radio.standard`. They are filled in before validation, so that a resolved scenario states every
value.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal, Self, get_args

from pydantic import Field, model_validator

from fanet_mw.airtime import OFDM_RATES_MBPS, is_ofdm
from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Decibels, Length, Level, Section, SomeLength
from fanet_mw.units import LIGHT_M_PER_S, MS

DSSS_RATES_MBPS: Final = (1.0, 2.0, 5.5, 11.0)
RATES_MBPS: Final = {"b": DSSS_RATES_MBPS, "g": DSSS_RATES_MBPS + OFDM_RATES_MBPS, "a": OFDM_RATES_MBPS}
"""The rates of each `radio.standard`."""
CHANNELS: Final = ("range", "log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")
DSSS_BANDWIDTH_HZ: Final = 22e6
OFDM_BANDWIDTH_HZ: Final = 20e6
_THERMAL_DBM_PER_HZ: Final = -174.0
NS3_SENSITIVITY_DBM: Final = -82.0
LEAST_SNR_DB: Final = {
    "nist": {
        1.0: -6.65, 2.0: -2.5, 5.5: 0.35, 11.0: 3.35,
        6.0: 2.2, 9.0: 5.05, 12.0: 5.2, 18.0: 8.05, 24.0: 11.55, 36.0: 14.65, 48.0: 19.3, 54.0: 20.55,
    },
    "tables": {
        1.0: -6.65, 2.0: -2.5, 5.5: 0.35, 11.0: 3.35,
        6.0: -1.65, 9.0: -0.3, 12.0: 1.35, 18.0: 3.85, 24.0: 6.65, 36.0: 9.8, 48.0: 13.65, 54.0: 15.05,
    },
}  # fmt: skip
"""The SINR [dB] at which one of a hundred frames of 128 bytes arrives, by `ofdm_errors` and rate, by the emulator's
error rates (emulator/channel/error_rate.py)."""
_FLOOR_DBM: Final = -101.0
_SENSED_DBM: Final = -82.0
"""802.11-2020, 17.3.10.6: a preamble of this power must be sensed, whatever the rate of data."""
ED_OFDM_DBM: Final = -62.0
"""802.11-2020, 17.3.10.6: any signal 20 dB above the least sensitivity of -82 dBm holds the medium busy."""
UMA_ANTENNA_M: Final = 25.0
"""3GPP TR 36.777, table A.1-1: height of the antenna of an urban macro cell."""
MOST_PAYLOAD_BYTES: Final = 2304 - 36
"""An MSDU has at most 2,304 bytes (802.11-2020, 9.2.4.8.1), of which LLC/SNAP, IPv4 and UDP take 36."""
Ns3Point = Literal["difs", "eifs", "sums", "onset", "window"]
"""A point in which ns-3.44 differs from IEEE 802.11."""
MANDATORY_OFDM_MBPS: Final = (6.0, 12.0, 24.0)  # 17.1.1


def noise_dbm(rate_mbps: float, noise_figure_db: float) -> float:
    """Thermal noise in the channel of a rate, raised by the receiver's noise figure."""
    bandwidth_hz = OFDM_BANDWIDTH_HZ if is_ofdm(rate_mbps) else DSSS_BANDWIDTH_HZ
    return _THERMAL_DBM_PER_HZ + 10 * math.log10(bandwidth_hz) + noise_figure_db


def default_sensitivity_dbm(radio: "Radio", rate_mbps: float) -> float:
    """`radio.sensitivity_dbm` by default, if data had this rate."""
    access = "ns3" if radio.channel == "range" else radio.access
    return _sensitivity_dbm(rate_mbps, radio.noise_figure_db, radio.ofdm_errors, access)


def _sensitivity_dbm(rate_mbps: float, noise_figure_db: float, ofdm_errors: str, access: object) -> float:
    if access == "ns3":
        return NS3_SENSITIVITY_DBM
    return round(noise_dbm(rate_mbps, noise_figure_db) + LEAST_SNR_DB[ofdm_errors][rate_mbps], 2)


class Radio(Section):
    """The radio, its MAC and the channel. Defaults are the reference set-up: 802.11b, DSSS 11 Mb/s, long preamble."""

    channel: Annotated[str, PartName("radio.channel", CHANNELS)] = "range"
    """The path loss model; the documentation (explanation/channel) has equations, sources and ranges of validity."""
    options: Annotated[dict[str, Any], OptionsOf("radio.channel", CHANNELS)] = Field(default_factory=Options)
    """The options of a channel from another package, as that package documents them."""
    range_m: SomeLength = 250.0
    """`range`: the greatest distance at which frames are received and sensed; within it all frames
    are equally strong."""
    standard: Literal["b", "g", "a"] = "b"
    """`b`: DSSS; `g`: DSSS or OFDM at 2.4 GHz; `a`: OFDM at 5 GHz. It determines the possible rates, the slot time and
    SIFS."""
    rate_mbps: Annotated[float, Field(gt=0, le=54)] = 11.0
    """Bit rate of data frames, one of the standard's; by default 11 (`b`) or 54 (`g`, `a`)."""
    ack_rate_mbps: Annotated[float, Field(gt=0, le=54)] = 11.0
    """Bit rate of acknowledgments; by default the highest mandatory rate that is not above `rate_mbps` (802.11
    10.6.6.5): that rate itself for DSSS, else 6, 12 or 24."""
    preamble: Literal["long", "short"] = "long"
    """Preamble of DSSS frames: 192 us (`long`) or 96 us (`short`)."""
    slot: Literal["long", "short"] = "long"
    """`g`: slot time of 20 us (`long`) or 9 us (`short`). The standard requires the long one in an ad hoc network; many
    drivers use the short one."""
    tx_power_dbm: Level = 30.0
    """Transmit power; all channels but `range`."""
    exponent: Annotated[float, Field(gt=0, le=10)] = 3.0
    """`log_distance`: path loss exponent."""
    reference_loss_db: Level = 40.05
    """`log_distance`: path loss at 1 m. By default 40.05 (free space at 2400 MHz), and that of free space at
    `frequency_mhz` if that is given or the standard is `a` (46.73)."""
    frequency_mhz: Annotated[float, Field(ge=100, le=100_000)] = 2412.0
    """Carrier frequency; all channels but `range`. By default 2412 (channel 1), and 5180 (channel 36) with `a`."""
    environment: Literal["suburban", "urban", "dense_urban", "highrise"] = "suburban"
    """`air_to_ground`: the surroundings of the node on the ground."""
    airborne_m: Length = 35.0
    """`uma_av`: two nodes at or above this height have the path loss of `air_to_air`; between the 25 m of the antenna
    and this height it goes over into that."""
    shadowing_db: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Standard deviation of log-normal shadowing; 0: none."""
    shadowing_corr_m: SomeLength = 50.0
    """Distance over which the correlation of shadowing falls to 1/e."""
    fading: Literal["none", "nakagami", "rician"] = "none"
    """Small-scale fading: a power gain of mean 1 that changes as the two nodes move, the same in both directions."""
    nakagami_m: Annotated[float, Field(ge=0.5, le=1000, json_schema_extra={"unit": ""})] = 3.0
    """`nakagami`: the shape m; 1 is Rayleigh fading, greater values vary less."""
    rician_k_db: Annotated[float, Field(ge=-20, le=40)] = 10.0
    """`rician`: ratio of the power of the line of sight to that of all scattered paths."""
    scatterer_speed_m_s: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """`fading`: speed of what scatters the waves around the nodes, such as leaves and cars. It makes links fade whose
    nodes are at rest; 0: these keep their gain."""
    obstruction_loss_db: Decibels | Literal["knife_edge"] = "knife_edge"
    """Loss of a link with a hill or a building in its way: that over or around the edge (ITU-R P.526), or as many dB
    wherever something solid is between; with `range` such a link is cut."""
    sensitivity_dbm: Level = -82.0
    """All channels but `range`: the weakest frame that is received; weaker frames only interfere. By default that of
    which one in a hundred with 128 bytes arrives, by the error rates of data and of acknowledgments; -82 with
    `access = "ns3"` and on `range`."""
    carrier_sense_dbm: Level = -82.0
    """All channels but `range`: the weakest frame that is sensed. By default `sensitivity_dbm`, but -82 at most if that
    is not given (802.11 17.3.10.6)."""
    energy_detection_dbm: Level | None = None
    """All channels but `range`: energy from which the medium is busy, whatever it consists of. By default -62 with OFDM
    (802.11 17.3.10.6); with DSSS unset: only signals are sensed."""
    interference_floor_dbm: Level = -101.0
    """All channels but `range`: the weakest frame that interferes; weaker ones are ignored. In free space a frame falls
    below it after tens of kilometres. By default -101, or lower if one of the two keys above
    is."""
    preamble_snr_db: Level = 4.0
    """All channels but `range`: by how much a frame's preamble must exceed noise and interference to be detected. By
    default as much as the header needs, by its error rate; 4 with `access = "ns3"`."""
    ofdm_errors: Literal["nist", "tables"] = "nist"
    """Error rates of OFDM: `nist`, the bound of Pei and Henderson for hard decisions (NistErrorRateModel of ns-3), or
    `tables`, link simulations with soft decisions (ns-3's default); `tables` needs 1 to 5 dB less."""
    coverage_class: Annotated[int, Field(ge=0, le=31)] = 0
    """Adds 3 us per class to the slot time and so to DIFS and the ACK timeout, for long links: acknowledgments arrive
    in time over 3.0 km (1.35 km with slots of 9 us) and 450 m more per class (802.11 9.4.2.8)."""
    noise_figure_db: Decibels = 7.0
    """All channels but `range`: noise figure of the receiver, in addition to thermal noise."""
    capture: bool = False
    """Whether a later frame that is `capture_db` stronger than the one being received takes over the receiver."""
    capture_db: Decibels = 10.0
    """`capture`: how much stronger the later frame must be."""
    access: Literal["standard", "ns3"] | tuple[Ns3Point, ...] = "standard"
    """`standard`: as in IEEE 802.11; `ns3`: as in ns-3.44 in all points in which it differs; or a list of those points
    in which it is as in ns-3: `difs`, `eifs`, `sums`, `onset`, `window` (documentation, explanation/emulator)."""
    cw_min: Annotated[int, Field(ge=1, le=1023)] = 31
    """The first contention window, in slots. By default 31, and 15 with OFDM rates."""
    cw_max: Annotated[int, Field(ge=1, le=32767)] = 1023
    """The greatest contention window, in slots; the window is doubled after each failed unicast."""
    max_attempts: Annotated[int, Field(ge=1, le=255)] = 7
    """How often a unicast is sent before it is given up."""
    queue_frames: Annotated[int, Field(ge=1, le=100_000)] = 500
    """The greatest number of frames in the MAC queue."""
    lifetime_ms: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    """How long a frame may wait in the MAC queue; unset: 500 ms, or as long as it takes if arrivals are saturated."""
    max_frame_bytes: Annotated[int, Field(ge=64, le=MOST_PAYLOAD_BYTES)] = MOST_PAYLOAD_BYTES
    """The longest frame that the radio accepts; with 36 bytes of UDP, IP and LLC it is an MSDU of 2,304 at most."""
    lead_ms: Annotated[float, Field(ge=0, le=1000)] = 20.0
    """How long before its instant a node announces a transmission to the radio."""
    handover_ms: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    """Receptions are handed to nodes at multiples of this interval, as a driver with interrupt coalescing does; 0: at
    once. Fewer and larger wake-ups let more processes run on one machine; instants on the air remain exact."""
    late_limit: Annotated[float, Field(ge=0, le=1)] = 0.01
    """The share of late frames above which a real-time run is invalid."""

    @model_validator(mode="before")
    @classmethod
    def _defaults_follow_the_standard(cls, given: object) -> object:
        return _with_standard_defaults(given) if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _keys_agree(self) -> Self:
        problems = list(_disagreements(self))
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def as_ns3(self) -> frozenset[Ns3Point]:
        """The points in which the radio does as ns-3.44 does."""
        if isinstance(self.access, str):
            return frozenset(get_args(Ns3Point) if self.access == "ns3" else ())
        return frozenset(self.access)

    @property
    def lead_ns(self) -> int:
        return round(self.lead_ms * MS)

    @property
    def handover_ns(self) -> int:
        return round(self.handover_ms * MS)


def _with_standard_defaults(given: Mapping[str, Any]) -> dict[str, Any]:
    """Fill in the defaults that follow from standard, rate and channel; wrong values are left for the validation."""
    keys = dict(given)
    standard = keys.get("standard", "b")
    if standard == "a":
        keys.setdefault("frequency_mhz", 5180.0)
    if standard in ("g", "a"):
        keys.setdefault("rate_mbps", 54.0)
    rate = keys.get("rate_mbps", 11.0)
    if "frequency_mhz" in keys and isinstance(mhz := keys["frequency_mhz"], int | float) and mhz > 0:
        keys.setdefault("reference_loss_db", round(20 * math.log10(4 * math.pi * mhz * 1e6 / LIGHT_M_PER_S), 2))
    if not isinstance(rate, int | float):
        return keys
    if is_ofdm(rate):
        keys.setdefault("ack_rate_mbps", max((r for r in MANDATORY_OFDM_MBPS if r <= rate), default=6.0))
        keys.setdefault("cw_min", 15)  # tables 17-21 and 18-5 (aCWmin)
    elif rate in RATES_MBPS["b"]:
        keys.setdefault("ack_rate_mbps", rate)  # all four DSSS rates are mandatory (16.1)
    _add_levels(keys, float(rate))
    return keys


def _add_levels(keys: dict[str, Any], rate_mbps: float) -> None:
    """Fill in the defaults of sensitivity, carrier sense, energy and preamble detection."""
    figure_db, model = keys.get("noise_figure_db", 7.0), keys.get("ofdm_errors", "nist")
    access = "ns3" if keys.get("channel", "range") == "range" else keys.get("access")
    if not (rate_mbps in RATES_MBPS["g"] and isinstance(figure_db, int | float) and isinstance(model, str)):
        return
    if model not in LEAST_SNR_DB:
        return
    header_mbps = 6.0 if is_ofdm(rate_mbps) else 1.0
    weakest_dbm = _sensitivity_dbm(rate_mbps, figure_db, model, access)
    keys.setdefault("carrier_sense_dbm", keys.get("sensitivity_dbm", min(weakest_dbm, _SENSED_DBM)))
    keys.setdefault("sensitivity_dbm", weakest_dbm)
    if is_ofdm(rate_mbps):
        keys.setdefault("energy_detection_dbm", ED_OFDM_DBM)
    if access != "ns3":
        keys.setdefault("preamble_snr_db", LEAST_SNR_DB[model][header_mbps])
    if all(isinstance(keys[key], int | float) for key in ("sensitivity_dbm", "carrier_sense_dbm")):
        keys.setdefault("interference_floor_dbm", min(_FLOOR_DBM, keys["sensitivity_dbm"], keys["carrier_sense_dbm"]))


def _disagreements(radio: Radio) -> Iterator[str]:
    """Combinations of keys that do not fit together."""
    if radio.cw_max < radio.cw_min:
        yield f"radio.cw_max = {radio.cw_max} must be >= radio.cw_min = {radio.cw_min}"
    rates = RATES_MBPS[radio.standard]
    for key, rate in (("rate_mbps", radio.rate_mbps), ("ack_rate_mbps", radio.ack_rate_mbps)):
        if rate not in rates:
            known = ", ".join(f"{r:g}" for r in rates)
            yield f'radio.{key} = {rate:g} must be one of {known} for radio.standard = "{radio.standard}"'
    if is_ofdm(radio.rate_mbps) != is_ofdm(radio.ack_rate_mbps):
        yield (
            f"radio.ack_rate_mbps = {radio.ack_rate_mbps:g} must be of the modulation (DSSS or OFDM) of "
            f"radio.rate_mbps = {radio.rate_mbps:g}"
        )
    if radio.channel == "range":
        for key, used in (
            ("capture", radio.capture),
            ("shadowing_db", radio.shadowing_db > 0),
            ("fading", radio.fading != "none"),
        ):
            if used:
                yield f'radio.{key} needs a channel with powers: with radio.channel = "range" all are equally strong'
    else:
        yield from _silent_cuts(radio)
    if radio.channel == "uma_av" and radio.airborne_m <= UMA_ANTENNA_M:
        yield f"radio.airborne_m = {radio.airborne_m:g} must be > {UMA_ANTENNA_M:g}, the antenna's height of uma_av"
    if radio.slot == "short" and radio.standard == "b":
        yield 'radio.slot = "short" needs radio.standard = "g" or "a"'


def _silent_cuts(radio: Radio) -> Iterator[str]:
    """Levels by which frames that could be received would be ignored."""
    for key, level_dbm in (("sensitivity_dbm", radio.sensitivity_dbm), ("carrier_sense_dbm", radio.carrier_sense_dbm)):
        if radio.interference_floor_dbm > level_dbm:
            yield (
                f"radio.interference_floor_dbm = {radio.interference_floor_dbm:g} must be <= radio.{key} = "
                f"{level_dbm:g}: what is ignored cannot be received or sensed"
            )
    if radio.carrier_sense_dbm > radio.sensitivity_dbm:
        yield (
            f"radio.carrier_sense_dbm = {radio.carrier_sense_dbm:g} must be <= radio.sensitivity_dbm = "
            f"{radio.sensitivity_dbm:g}: what is not sensed cannot be received"
        )
