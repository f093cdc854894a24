"""The rider of the whole-body fixtures, whose numbers were computed independently."""

import math

from poise.filters.bicycle.geometry import RiderGeometry

C72, S72 = math.cos(math.radians(72.0)), math.sin(math.radians(72.0))
RIDER = RiderGeometry(
    saddle=(0.2418, 0.0, 0.8825),
    trunk_pivot=(0.2418, 0.0, 0.8825),
    trunk_flexion=math.radians(33.0),
    shoulder=(0.0, 0.190, 0.560),
    hip=(0.2418, 0.085, 0.9625),
    grip=(0.790, 0.270, 1.040),
    steer_origin=(1.11, 0.0, 0.0),
    steer_axis=(-C72, 0.0, S72),
    crank_axle=(0.426, 0.0, 0.280),
    crank_length=0.170,
    pedal_offset=0.120,
    upper_arm=0.327,
    forearm=0.257,
    thigh=0.431,
    shank=0.433,
    ankle_to_pedal=0.150,
    ankle_angle=math.radians(80.0),
    trunk_mass=39.3,
    trunk_centre=(0.0, 0.0, 0.415),
    trunk_imu=(-0.10, 0.0, 0.42),
)
"""1.76 m, 68 kg; the trunk turns about the saddle point."""
