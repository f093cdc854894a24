"""Simulated calibration runs: a device with random scales and offsets on a rate table, or rotated by hand.

The schedules are those of P. He's thesis (Université Laval, chapter 4); counts are those of its sensors (ADXL345,
L3G4200D), whose tolerances are our choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...filters.arrays.array import AccelerometerArray, recorded_channel
from ...filters.core import rotation
from ...filters.core.quantity import STANDARD_GRAVITY
from ..data.calibration.data import MagnetometerData, RateTableData, mounting_matrix
from ..data.calibration.records import CalibrationRecord, ChannelCalibration
from ..sensors.ideal import magnetic_field
from ..sensors.noise import NoiseModel
from .controller_gestures import BOTH_WAYS, DOWNWARDS, UPWARDS, RateTable
from .devices import ArrayPreset, HandDevice, actual_array
from .sensing import simulate_hand

ACCELEROMETER_SCALE = 4e-3 * STANDARD_GRAVITY
"""m/s² per count: ADXL345, 4 mg."""
ACCELEROMETER_RANGE = 4095
"""Counts: ±16 g."""
GYROSCOPE_SCALE = math.radians(8.75e-3)
"""rad/s per count: L3G4200D at ±250 °/s."""
GYROSCOPE_RANGE = 32767
MAGNETOMETER_SCALE = 1.0 / 300.0
"""of a unit field, per count"""

ACCELEROMETER_MOUNTINGS = (*(("+z", "+x"), ("-z", "-x")), *(("+x", "+y"), ("-x", "-y")), *(("+y", "+z"), ("-y", "-z")))
"""(up, out): each axis outwards, inwards, upright and upside down."""
GYROSCOPE_MOUNTINGS = (("+x", "+y"), ("+y", "+z"), ("+z", "+x"))
ONE_AXIS = AccelerometerArray(((0.0, 0.0, 0.0),), ((0.0, 0.0, 1.0),))
"""An accelerometer that no reading is taken of."""
LONE_GYROSCOPE = HandDevice("gyroscope", ONE_AXIS, "array-data-sheet", magnetometer=False)


def nominal_calibration(array: AccelerometerArray) -> CalibrationRecord:
    """Values of the data sheets: typical scales, no offsets, a magnetometer along the axes of the device."""
    return CalibrationRecord(
        {
            recorded_channel(array).name: ChannelCalibration.scaled(
                [ACCELEROMETER_SCALE] * array.size, [0.0] * array.size, "m/s²"
            ),
            "imu/gyr": ChannelCalibration.scaled([GYROSCOPE_SCALE] * 3, [0.0] * 3, "rad/s"),
            "imu/mag": ChannelCalibration.scaled([MAGNETOMETER_SCALE] * 3, [0.0] * 3, "1"),
        }
    )


def random_calibration(array: AccelerometerArray, seed: int) -> CalibrationRecord:
    """A random device: true scales, offsets, hard and soft iron, and a misaligned magnetometer.

    Standard deviations: scale of the accelerometers 5 %, offset 1 m/s² (as wide as the thesis' table 4.1); scale of the
    gyroscope 1 %, offset 0.5 °/s; hard iron 100 counts, soft iron 5 %, axes of the magnetometer 20°.
    """
    acc, gyr, mag = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3))
    m = array.size
    soft = mag.normal(0.0, 0.05, (3, 3))
    turned = rotation.exp_matrix(math.radians(20.0) * mag.standard_normal(3))
    matrix = MAGNETOMETER_SCALE * turned @ (np.eye(3) + 0.5 * (soft + soft.T))
    return CalibrationRecord(
        {
            recorded_channel(array).name: ChannelCalibration.scaled(
                ACCELEROMETER_SCALE * (1.0 + 0.05 * acc.standard_normal(m)), acc.normal(0.0, 1.0, m), "m/s²"
            ),
            "imu/gyr": ChannelCalibration.scaled(
                GYROSCOPE_SCALE * (1.0 + 0.01 * gyr.standard_normal(3)),
                math.radians(0.5) * gyr.standard_normal(3),
                "rad/s",
            ),
            "imu/mag": ChannelCalibration(matrix.tolist(), (-matrix @ mag.normal(0.0, 100.0, 3)).tolist(), "1"),
        }
    )


def built_with(array: AccelerometerArray, axis_error: float, seed: int) -> AccelerometerArray:
    """The array with axes rotated by random angles of standard deviation ``axis_error``, rad, about each normal."""
    errors = ArrayPreset("axes", "errors of the axes alone", NoiseModel(), NoiseModel(), axis_error=axis_error)
    return actual_array(array, errors, np.random.default_rng(np.random.SeedSequence(seed).spawn(4)[3]))


def counts(channel: ChannelCalibration, readings: np.ndarray, largest: float = math.inf) -> np.ndarray:
    """Raw readings of a device with the calibration ``channel``: whole counts that stop at the end of the range."""
    return np.clip(np.rint(channel.undo(readings)), -largest, largest)


def accelerometer_runs(
    array: AccelerometerArray, truth: CalibrationRecord, seed: int, *, hold: float = 10.0
) -> RateTableData:
    """Runs for every axis: 80 to 800 °/s where it points outwards, back where it points inwards, and upright.

    The reference point of the array is 0.1 m from the axis of the table, which holds each rate for ``hold`` s.
    """
    device = HandDevice(array.name, array.spatial, "array-data-sheet", gyroscope=False, magnetometer=False)
    channel = truth.channels[recorded_channel(array).name]
    tables = {
        (up, out): RateTable(UPWARDS if out.startswith("+") else DOWNWARDS, hold, offset=(0.1, 0.0, 0.0))
        for up, out in ACCELEROMETER_MOUNTINGS
    }
    return _runs(device, tables, seed, lambda read: counts(channel, read["array/acc"], ACCELEROMETER_RANGE))


def gyroscope_runs(truth: CalibrationRecord, seed: int, *, hold: float = 10.0) -> RateTableData:
    """Runs for every axis: −325 to 350 °/s by 25, of which the largest saturate; arguments as for accelerometers."""
    channel, table = truth.channels["imu/gyr"], RateTable(BOTH_WAYS, hold, offset=(0.0, 0.0, 0.0))
    tables = dict.fromkeys(GYROSCOPE_MOUNTINGS, table)
    return _runs(LONE_GYROSCOPE, tables, seed, lambda read: counts(channel, read["imu/gyr"], GYROSCOPE_RANGE))


def magnetometer_run(truth: CalibrationRecord, seed: int, *, duration: float = 60.0) -> MagnetometerData:
    """The device of this calibration rotated by hand through all attitudes, at 50 Hz for ``duration`` s.

    The reference attitudes are those of a tracker, with an error of 0.002 rad about each axis.
    """
    device = HandDevice("magnetometer", ONE_AXIS, "array-data-sheet", gyroscope=False)
    motion, reference = np.random.SeedSequence(seed).spawn(2)
    trajectory = simulate_hand("mixed", int(motion.generate_state(1)[0]), rate=50.0, duration=duration, device=device)
    unit = trajectory.measurements["imu/mag"] / np.linalg.norm(magnetic_field())
    error = np.random.default_rng(reference).normal(0.0, 0.002, (len(unit), 3))
    attitude = rotation.multiply(trajectory.truth["orientation"], rotation.exp(error))
    return MagnetometerData(trajectory.time, counts(truth.channels["imu/mag"], unit), attitude)


def _runs(
    device: HandDevice,
    tables: Mapping[tuple[str, str], RateTable],
    seed: int,
    raw: Callable[[Mapping[str, np.ndarray]], np.ndarray],
) -> RateTableData:
    """Runs of a device mounted (up, out) on a table, one below the other, a minute apart, without the changes of rate.

    ``raw`` turns readings of channels ``(n, size)`` into raw ones.
    """
    data: RateTableData | None = None
    for child, ((up, out), table) in zip(np.random.SeedSequence(seed).spawn(len(tables)), tables.items(), strict=True):
        table = replace(table, attitude=tuple(rotation.from_matrix(mounting_matrix(up, out)).tolist()))
        run = simulate_hand(table, int(child.generate_state(1)[0]), device=device)
        steady, rate = held_rates(table, run.time)
        time, readings = run.time[steady], {name: values[steady] for name, values in run.measurements.items()}
        mounted = np.full(len(time), up), np.full(len(time), out)
        if data is not None:
            time = time + data.time[-1] + 60.0
        one = RateTableData(time, *mounted, rate, raw(readings))
        data = one if data is None else data.joined(one)
    assert data is not None
    return data


def held_rates(table: RateTable, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the times ``(T,)`` lie where the table holds a rate, and those rates ``(n,)`` rad/s."""
    gesture = table.draw(np.random.default_rng(0))
    step = np.searchsorted(gesture.starts, time, "right") - 1
    steady = (step >= 0) & (time > gesture.starts[np.maximum(step, 0)] + table.ramp + 0.05)
    return steady, gesture.rates[step[steady]]
