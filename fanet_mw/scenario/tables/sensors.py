"""The `[sensors]` table: which sensors UAVs carry besides GPS and a Wi-Fi receiver, and how accurate they are.

A sensor with a rate of 0 is not on board. The models, their units and sources are in docs/reference/sensors.md.
"""

import math
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.tables.sections import (
    Coordinate,
    Decibels,
    Duration,
    Id,
    Length,
    Level,
    Rate,
    Section,
    SomeLength,
    SomeTime,
)

Angle = Annotated[float, Field(ge=0, le=180)]
"""Degrees."""
Outage = tuple[Coordinate, Coordinate, SomeLength, Duration, Duration]

MOST_FALSE_ECHOES: Final = 1000
"""The greatest mean number of false echoes in a scan of the radar: more would fill the memory."""


class Sensors(Section):
    """Rates and errors of the sensors on board, the same for all UAVs."""

    camera_hz: Rate = 0.0
    """Images per second in which people are searched for; the camera looks straight down."""
    camera_fov_deg: Annotated[float, Field(ge=1, le=170)] = 70.0
    """Field of view across the width of the image."""
    camera_pixels: tuple[Annotated[int, Field(ge=16, le=100_000)], Annotated[int, Field(ge=16, le=100_000)]] = (
        1920,
        1080,
    )
    """Width and height of an image."""
    camera_cycles: Annotated[float, Field(ge=0.1, le=100)] = 4.0
    """The number of line pairs across a person with which half of the people are recognized (Johnson's criteria: 1.0 to
    notice that something is there, 4.0 to distinguish a person from a car, 6.4 a man from a woman)."""
    camera_sigma_deg: Angle = 1.0
    """Standard deviation of a direction, along each of two axes."""
    camera_false_per_hour: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Rate of false alarms of one camera: people that it sees where there are none."""
    image_hz: Rate = 0.0
    """Rate of rendered images for a user's applications, with the camera's field of view; needs pybullet. Each image
    takes tens of milliseconds of the world's time, so in real time only few UAVs can have them."""
    image_pixels: tuple[Annotated[int, Field(ge=16, le=640)], Annotated[int, Field(ge=16, le=640)]] = (320, 240)
    """Width and height of a rendered image."""
    image_nodes: tuple[Id, ...] = ()
    """The UAVs for which images are rendered; empty: all."""
    voice_hz: Rate = 0.0
    """Rate at which a microphone array listens for voices."""
    voice_level_db: Level = 88.0
    """Sound pressure level of a call at 1 m [dB re 20 uPa]."""
    voice_loudness_db: Decibels = 5.0
    """Standard deviation of the level among survivors, of whom each keeps their own."""
    voice_error_db: Decibels = 2.0
    """Standard deviation of a measured level."""
    voice_share: Annotated[float, Field(ge=0, le=1)] = 0.5
    """Share of the time in which a survivor calls."""
    voice_rotor_db: Level = 80.0
    """Sound level of the UAV's own rotors at its array, in the band of voices."""
    voice_gain_db: Decibels = 15.0
    """Gain of the array's processing over noise from other directions."""
    voice_snr_db: Level = 0.0
    """The least signal-to-noise ratio, after processing, with which a voice is detected."""
    voice_sigma_deg: Angle = 5.0
    """Standard deviation of a direction at a ratio of 0 dB; it falls with the square root of the ratio."""
    radar_hz: Rate = 0.0
    """Scans per second, each all round."""
    radar_range_m: SomeLength = 120.0
    """The greatest distance of an echo."""
    radar_beam_deg: Annotated[float, Field(ge=1, le=90)] = 10.0
    """Horizontal width of a beam; a scan covers 20 degrees up and down."""
    radar_resolution_m: SomeLength = 0.5
    """Length of a range cell, the speed of light over twice the bandwidth."""
    radar_snr_db: Level = 21.6
    """Signal-to-noise ratio of a target of 1 m2 at 100 m."""
    radar_uav_m2: Annotated[float, Field(gt=0, le=1e6)] = 0.03
    """Radar cross section of a UAV."""
    radar_wall_m2: Annotated[float, Field(gt=0, le=1e6)] = 10.0
    """Radar cross section of the part of a wall or a hillside in one beam."""
    radar_false_alarm: Annotated[float, Field(gt=0, lt=0.1)] = 1e-6
    """Probability that noise is taken for an echo, in each cell of a scan."""
    altimeter_hz: Rate = 0.0
    """Readings per second of the barometer and of the rangefinder that looks down."""
    barometer_sigma_m: Length = 0.3
    """Standard deviation of the barometer's noise."""
    barometer_drift_m: Length = 1.0
    """Standard deviation of the barometer's slow error, with a correlation time of 300 s."""
    rangefinder_m: SomeLength = 120.0
    """Range of the rangefinder that looks down."""
    rangefinder_sigma_m: Length = 0.1
    """Standard deviation of its noise."""
    inertial_hz: Rate = 0.0
    """Readings per second of the velocity by inertial sensors and optical flow, which need no GPS."""
    inertial_sigma_m_s: Length = 0.1
    """Standard deviation of their noise along each axis."""
    inertial_drift_m_s: Length = 0.05
    """Standard deviation of the slow error along each axis, with a correlation time of 100 s."""
    battery_hz: Rate = 0.0
    """Readings per second of the battery's voltage, current and charge."""
    wind_hz: Rate = 0.0
    """Readings per second of the mean wind, as flight controllers estimate it from how far they lean."""
    wind_sigma_m_s: Length = 1.0
    """Standard deviation of its slow error along each horizontal axis, with a correlation time of 30 s."""
    pad_hz: Rate = 2.0
    """Images per second in which a camera that looks down finds the marker on the UAV's own pad; for UAVs that stand on
    pads (`nodes.on_ground`)."""
    pad_marker_m: SomeLength = 0.8
    """Side of that marker."""
    map_share: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Share of the buildings on the map that each UAV of a planned search carries; the map has all hills."""
    gps_common_m: Length = 2.0
    """Standard deviation of the slow GPS error along each horizontal axis that all receivers have in common."""
    gps_common_time_s: SomeTime = 1800.0
    """Correlation time of the common error."""
    gps_bias_m: Length = 0.6
    """Standard deviation of each receiver's own slow error along each horizontal axis."""
    gps_bias_time_s: SomeTime = 300.0
    """Correlation time of a receiver's own error."""
    gps_vertical: Annotated[float, Field(ge=0, le=10)] = 2.0
    """How many times greater vertical errors of GPS are than those along a horizontal axis."""
    gps_velocity_m_s: Length = 0.05
    """Standard deviation of a fix's velocity along each axis."""
    gps_delay_s: Annotated[float, Field(ge=0, le=1)] = 0.11
    """How old the position of a fix is when it arrives; UAVs know it and make up for it by their velocity."""
    gps_outages: tuple[Outage, ...] = ()
    """Areas and times without GPS, each as [east, north, radius, from, until] in metres and seconds."""
    burial_phone_db: Decibels = 20.0
    """Loss through rubble of the phone signal of a buried survivor."""
    burial_voice_db: Decibels = 20.0
    """Loss through rubble of the voice of a buried survivor."""

    @model_validator(mode="after")
    def _false_echoes_can_be_counted(self) -> Self:
        false_echoes = self.radar_cells * self.radar_false_alarm
        if self.radar_hz > 0 and false_echoes > MOST_FALSE_ECHOES:
            raise ValueError(
                f"sensors.radar_false_alarm = {self.radar_false_alarm:g} makes {false_echoes:.0f} false echoes in a "
                f"scan of {self.radar_cells} cells; there must be at most {MOST_FALSE_ECHOES}"
            )
        return self

    @property
    def tan_half_fov(self) -> tuple[float, float]:
        """How far east and north of a UAV its camera shows the ground, per metre of height."""
        width, height = self.camera_pixels
        east = math.tan(math.radians(self.camera_fov_deg) / 2)
        return east, east * height / width

    @property
    def radar_cells(self) -> int:
        """The number of cells of a scan of the radar: range cells in each beam."""
        return math.ceil(360 / self.radar_beam_deg - 1e-9) * math.ceil(self.radar_range_m / self.radar_resolution_m)

    @model_validator(mode="after")
    def _outages_begin_before_they_end(self) -> Self:
        for index, (*_, begin_s, end_s) in enumerate(self.gps_outages):
            if begin_s >= end_s:
                raise ValueError(f"sensors.gps_outages.{index}: from = {begin_s:g} must be < until = {end_s:g}")
        return self
