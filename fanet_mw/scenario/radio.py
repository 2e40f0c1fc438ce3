"""The `[radio]` table of a scenario: PHY, MAC and channel, and which of its keys fit together.

Keys are people's units. Some defaults follow `radio.standard`; they are filled in before validation, so that a
resolved scenario names every value it ran with.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal, Self, get_args

from pydantic import Field, model_validator

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.sections import Decibels, Length, Level, Section, SomeLength
from fanet_mw.units import MS

DSSS_RATES_MBPS: Final = (1.0, 2.0, 5.5, 11.0)
OFDM_RATES_MBPS: Final = (6.0, 9.0, 12.0, 18.0, 24.0, 36.0, 48.0, 54.0)
RATES_MBPS: Final = {"b": DSSS_RATES_MBPS, "g": DSSS_RATES_MBPS + OFDM_RATES_MBPS, "a": OFDM_RATES_MBPS}
"""The rates of each `radio.standard`."""
CHANNELS: Final = ("range", "log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")
Ns3Point = Literal["difs", "eifs", "sums", "onset", "window"]
"""A point in which ns-3.44 differs from IEEE 802.11."""
MANDATORY_OFDM_MBPS: Final = (6.0, 12.0, 24.0)  # 17.1.1


def is_ofdm(rate_mbps: float) -> bool:
    """True if a rate is sent by OFDM (clauses 17 and 18 of IEEE 802.11-2020) and not by DSSS."""
    return rate_mbps in OFDM_RATES_MBPS


class Radio(Section):
    """The radio, its MAC and the channel. Defaults are the reference set-up: 802.11b, DSSS 11 Mb/s, long preamble."""

    channel: Annotated[str, PartName("radio.channel", CHANNELS)] = "range"
    """The path loss model: see docs/explanation/emulator.md for equations, sources and ranges of validity."""
    options: Annotated[dict[str, Any], OptionsOf("radio.channel", CHANNELS)] = Field(default_factory=Options)
    """The table of a channel that another package brings, as that package documents it."""
    range_m: SomeLength = 250.0
    """`range`: decode and carrier-sense limit; frames are equally strong within it, silent beyond."""
    standard: Literal["b", "g", "a"] = "b"
    """`b`: DSSS; `g`: DSSS or OFDM at 2.4 GHz; `a`: OFDM at 5 GHz. Fixes the rates, the slot, SIFS and their kin."""
    rate_mbps: Annotated[float, Field(gt=0, le=54)] = 11.0
    """Bit rate of data frames, one of the standard's. By default 11 (`b`) or 54 (`g`, `a`)."""
    ack_rate_mbps: Annotated[float, Field(gt=0, le=54)] = 11.0
    """Bit rate of acknowledgments. By default 11 (`b`), else the highest mandatory rate that is not above `rate_mbps`
    (6, 12, 24; or DSSS)."""
    preamble: Literal["long", "short"] = "long"
    """Preamble of DSSS frames: 192 or 96 us."""
    slot: Literal["long", "short"] = "long"
    """Slot time; `g` only: 20 or 9 us. The standard wants the long one in an ad hoc network; many drivers take the
    short one."""
    tx_power_dbm: Level = 30.0
    """Transmit power; all channels but `range`."""
    exponent: Annotated[float, Field(gt=0, le=10)] = 3.0
    """`log_distance`: path loss exponent."""
    reference_loss_db: Level = 40.05
    """`log_distance`: path loss at 1 m."""
    frequency_mhz: Annotated[float, Field(ge=100, le=100_000)] = 2412.0
    """Carrier frequency; all channels but `range` and `log_distance`. By default 2412 (channel 1), and 5180 (channel
    36) with `a`."""
    environment: Literal["suburban", "urban", "dense_urban", "highrise"] = "suburban"
    """`air_to_ground`: what stands around the node on the ground."""
    airborne_m: Length = 10.0
    """`air_to_ground` and `uma_av`: two nodes at or above this height see each other as `air_to_air`. By default 10,
    and 26 with `uma_av`, whose ground antenna is at 25 m."""
    shadowing_db: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Standard deviation of log-normal shadowing; 0: none."""
    shadowing_corr_m: SomeLength = 50.0
    """Distance over which its correlation falls to 1/e."""
    fading: Literal["none", "nakagami", "rician"] = "none"
    """Small-scale fading: a power gain of mean 1 per frame and receiver."""
    nakagami_m: Annotated[float, Field(ge=0.5, le=1000, json_schema_extra={"unit": ""})] = 3.0
    """`nakagami`: the shape m; 1 is Rayleigh; more is steadier."""
    rician_k_db: Annotated[float, Field(ge=-20, le=40)] = 10.0
    """`rician`: power of the line of sight over that of all scattered paths."""
    obstruction_loss_db: Decibels = 20.0
    """What a link loses when the world says that something stands in its way; with `range` it is cut."""
    sensitivity_dbm: Level = -82.0
    """All channels but `range`: decode and carrier-sense limit; weaker frames only interfere."""
    interference_floor_dbm: Level = -101.0
    """All channels but `range`: weaker frames are nothing. In free space it is reached after tens of kilometres."""
    preamble_snr_db: Level = 4.0
    """All channels but `range`: a receiver locks on to a frame whose preamble is this far above noise and
    interference."""
    noise_figure_db: Decibels = 7.0
    """All channels but `range`: what the receiver adds to thermal noise."""
    capture: bool = False
    """Whether a later frame that is `capture_db` stronger than the one being received takes the receiver over."""
    capture_db: Decibels = 10.0
    """`capture`: how much stronger the later frame must be."""
    access: Literal["standard", "ns3"] | tuple[Ns3Point, ...] = "standard"
    """`standard`: as IEEE 802.11 has it; `ns3`: as ns-3.44 does in every point in which it differs; or a list of such
    points: `difs`, `eifs`, `sums`, `onset`, `window` (docs/explanation/emulator.md)."""
    cw_min: Annotated[int, Field(ge=1, le=1023)] = 31
    """The first contention window, in slots. By default 31, and 15 with OFDM rates."""
    cw_max: Annotated[int, Field(ge=1, le=32767)] = 1023
    """The contention window is doubled after a failed unicast up to this many slots."""
    max_attempts: Annotated[int, Field(ge=1, le=255)] = 7
    """So often a unicast is sent until it is given up."""
    queue_frames: Annotated[int, Field(ge=1, le=100_000)] = 500
    """Frames that wait in the MAC queue at most."""
    lifetime_ms: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    """How long a frame may wait in the MAC queue; unset: 500 ms, or as long as it takes if arrivals are saturated."""
    max_frame_bytes: Annotated[int, Field(ge=64, le=2304)] = 2304
    """The longest frame that the radio takes."""
    lead_ms: Annotated[float, Field(ge=0, le=1000)] = 20.0
    """How long before its instant a node announces a transmission to the radio."""
    handover_ms: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    """Receptions are handed to nodes at multiples of this, as a driver with interrupt coalescing does; 0: at once.
    Fewer, larger wake-ups let more processes live on one machine; instants on the air stay exact."""
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
    """Fill in what the standard, the rate and the channel imply and the file does not say; wrong values stay."""
    keys = dict(given)
    standard = keys.get("standard", "b")
    if standard == "a":
        keys.setdefault("frequency_mhz", 5180.0)
    if keys.get("channel") == "uma_av":
        keys.setdefault("airborne_m", 26.0)
    if standard in ("g", "a"):
        keys.setdefault("rate_mbps", 54.0)
    rate = keys.get("rate_mbps", 11.0)
    if not isinstance(rate, int | float):
        return keys
    if is_ofdm(rate):
        keys.setdefault("ack_rate_mbps", max((r for r in MANDATORY_OFDM_MBPS if r <= rate), default=6.0))
        keys.setdefault("cw_min", 15)  # tables 17-21 and 18-5 (aCWmin)
    elif standard == "g":
        keys.setdefault("ack_rate_mbps", rate)  # all four DSSS rates are mandatory (16.1)
    return keys


def _disagreements(radio: Radio) -> Iterator[str]:
    """What each key allows alone but the table does not."""
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
    if radio.slot == "short" and radio.standard == "b":
        yield 'radio.slot = "short" needs radio.standard = "g" or "a"'
