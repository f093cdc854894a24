"""Device noise models of the papers' instrumented bicycle: published values and assumptions.

Sources: *two-gyro* = Y. Zhang, K. Chen, J. Yi, T. Liu, Q. Pan, rigid body on a moving platform with two gyroscopes and
relative measurements; *force-inertial* = Y. Zhang, K. Chen, J. Yi, rider trunk and bicycle pose from force and inertial
sensors, IEEE Trans. Biomed. Eng. 60 (2013); *whole-body* = whole-body pose in bicycle riding from a small set of
wearable sensors. *Assumed* values are choices of this project. Two choices recur: a limit ("below x") is
three standard deviations, and the gyroscopes' offset at rest has been measured and subtracted (force-inertial (14)), so
that only its drift is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ...sensors.noise import Form, NoiseModel

G = STANDARD_GRAVITY
LINES = 256
"""of the optical encoders (whole-body, section II-A: Grayhill 63R)"""
COUNTS = 4 * LINES
"""per turn: both edges of both tracks of the standard quadrature code (Grayhill 63R data sheet)"""
DRIFT_TIME = 1800.0
"""s: correlation time of gyroscope biases (force-inertial, table I)"""


@dataclass(frozen=True)
class Device:
    """A device with its errors."""

    name: str
    source: str
    """where the numbers come from, and which are assumed"""
    noise: NoiseModel
    form: Form = "additive"
    units: tuple[float, ...] = ()
    """of the noise model on each axis, see :class:`poise.envs.sensors.sensor.Sensor`"""
    per_sample: float = 0.0
    """u: white noise of one sample at whatever rate; added to the model's where a device takes pictures"""

    def at_rate(self, rate: float) -> NoiseModel:
        """The errors of samples at ``rate`` (Hz)."""
        if not self.per_sample:
            return self.noise
        return replace(self.noise, white_noise=math.hypot(self.noise.white_noise, self.per_sample / math.sqrt(rate)))


MODEL_605_GYROSCOPE = Device(
    "Motion Sense 605",
    "whole-body table I: 0.05 °/s/√Hz, resolution below 0.007 °/s, bandwidth 100 Hz, bias below 1 °/s (subtracted at "
    "rest); force-inertial table I: bias drifts with 1800 s; drift of 0.15 °/s and range assumed",
    NoiseModel(
        white_noise=0.05 * DEG,
        bias_instability=0.15 * DEG,
        bias_correlation_time=DRIFT_TIME,
        resolution=0.007 * DEG,
        bandwidth=100.0,
        full_scale=300.0 * DEG,
    ),
)
MODEL_605_ACCELEROMETER = Device(
    "Motion Sense 605",
    "whole-body table I: 100 µg/√Hz, resolution below 0.08 mg, bandwidth 100 Hz, bias below 15 mg; whole-body fig. 11: "
    "range 2 g",
    NoiseModel(
        white_noise=100e-6 * G,
        turn_on_bias=15e-3 / 3.0 * G,
        resolution=0.08e-3 * G,
        bandwidth=100.0,
        full_scale=2.0 * G,
    ),
)
SLIM_GYROSCOPE = Device(
    "Motion Sense slimAHRS",
    "whole-body table I: resolution below 0.1 °/s, bandwidth 40 Hz, bias 200 °/h; white noise of 0.03 °/s/√Hz, drift "
    "with 1800 s and range assumed",
    NoiseModel(
        white_noise=0.03 * DEG,
        bias_instability=200.0 / 3600.0 * DEG,
        bias_correlation_time=DRIFT_TIME,
        resolution=0.1 * DEG,
        bandwidth=40.0,
        full_scale=600.0 * DEG,
    ),
)
MAGNETOMETER = Device(
    "magnetometer",
    "none in the papers; assumed: 0.5 µT a sample at 100 Hz, hard iron of the bicycle 2 µT, scale 1 %",
    NoiseModel(white_noise=0.05, turn_on_bias=2.0, scale_factor=0.01, full_scale=800.0),
)
SEAT_WRENCH = Device(
    "JR3 six-axis sensor",
    "force-inertial section II-A names the maker only; all assumed: 3 N and 0.45 N·m a sample at 50 Hz, zero 3 N and "
    "0.45 N·m, scale and cross-talk 0.5 %, range 2000 N and 300 N·m",
    NoiseModel(white_noise=0.42, turn_on_bias=3.0, scale_factor=0.005, misalignment=0.005, full_scale=2000.0),
    units=(1.0, 1.0, 1.0, 0.15, 0.15, 0.15),
)
LOAD_CELL = Device(
    "Transducer Techniques SLB-250",
    "whole-body section II-A names the cell; capacity 250 lbf from its name; assumed: 2 N a sample at 50 Hz, zero 2 N, "
    "scale 0.25 %",
    NoiseModel(white_noise=0.28, turn_on_bias=2.0, scale_factor=0.0025, full_scale=250.0 * 4.4482216),
)
STRAIN_GAUGES = Device(
    "strain gauges",
    "force-inertial section II-A names them only; all assumed: 3 N a sample at 50 Hz, zero 3 N, scale and cross-talk "
    "2 %, range 1000 N",
    NoiseModel(white_noise=0.42, turn_on_bias=3.0, scale_factor=0.02, misalignment=0.02, full_scale=1000.0),
)
ANGLE_ENCODER = Device(
    "Grayhill 63R",
    "whole-body section II-A: 256 lines; data sheet: quadrature, so 1024 counts per turn; zero within 0.5° assumed",
    NoiseModel(turn_on_bias=0.5 * DEG, resolution=2.0 * math.pi / COUNTS, full_scale=math.pi),
    form="angle",
)
CAMERA_POSE = Device(
    "Allied Vision Manta G-145 with a marker",
    "16 frames/s (force-inertial and whole-body section II-A); errors not published and assumed: 1° an axis and frame, "
    "marker fixed within 1°, shifting on the back by 1° with 60 s: together the 2° of two-gyro table I",
    NoiseModel(turn_on_bias=1.0 * DEG, bias_instability=1.0 * DEG, bias_correlation_time=60.0, full_scale=1.0),
    form="rotation",
    per_sample=1.0 * DEG,
)
CAMERA_DISTANCES = Device(
    "Allied Vision Manta G-145 with three markers",
    "two-gyro section V-A: three distances from markers of known size; 16 frames/s as above; errors assumed: 2 mm a "
    "frame (a third of a pixel on a marker of 0.1 m), drifting by 2 mm with 60 s",
    NoiseModel(bias_instability=0.002, bias_correlation_time=60.0, full_scale=5.0),
    per_sample=0.002,
)


def wheel_encoder(radius: float, rate: float) -> Device:
    """Speed from counts of the rear wheel's encoder in each interval; radius in m, rate in Hz."""
    return Device(
        "Grayhill 63R",
        "whole-body section II-A: 256 lines; data sheet: quadrature; counts of each interval are not smoothed, and "
        "what a count leaves goes to the next interval; rolling radius known within 0.5 % (assumed)",
        NoiseModel(scale_factor=0.005, resolution=2.0 * math.pi / COUNTS * radius * rate, full_scale=20.0),
        form="counted",
    )
