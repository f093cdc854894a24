"""What calibration is worth to the angular rate of OCTA; the table of the page about calibration."""

import math

import numpy as np
import pytest

from poise.envs.data.calibration.channels import accelerometer_record
from poise.envs.data.calibration.records import CalibrationRecord, apply_calibration, undo_calibration
from poise.envs.hand.calibration_runs import accelerometer_runs, built_with, nominal_calibration, random_calibration
from poise.envs.hand.devices import HandDevice
from poise.envs.hand.sensing import simulate_hand
from poise.filters.arrays.array import OCTA
from poise.filters.arrays.files import read_array
from poise.filters.arrays.rate import ArrayRate
from poise.filters.core.recursion import Observer

NAME = "array/acc"
COLUMNS = ("data sheet", "axes as drawn", "axes estimated", "perfect device")


def rms_errors(seed):
    """RMS error of the weighted method over 30 s of shaking, rad/s, with axes 0.5° off."""
    truth, built = random_calibration(OCTA, seed), built_with(OCTA, math.radians(0.5), seed)
    runs = accelerometer_runs(built, truth, seed, hold=1.0)
    device = HandDevice("octa", built, "array-data-sheet", gyroscope=False, magnetometer=False)
    motion = simulate_hand("shaking", seed, duration=30.0, device=device)
    raw = undo_calibration(motion, CalibrationRecord({NAME: truth.channels[NAME]}))
    nominal = CalibrationRecord({NAME: nominal_calibration(OCTA).channels[NAME]})
    drawn, estimated = accelerometer_record(runs, OCTA), accelerometer_record(runs, OCTA, estimate_axes=True)
    cases = (
        (apply_calibration(raw, nominal), OCTA),
        (apply_calibration(raw, drawn), OCTA),
        (apply_calibration(raw, estimated), read_array(estimated.details[NAME]["array"])),
        (motion, built),
    )
    errors = []
    for trajectory, array in cases:
        estimate = Observer(ArrayRate(array=array, dt=0.01), compiled=False).run(trajectory.measurements)
        error = np.linalg.norm(estimate.pose["angular_rate"] - motion.truth["angular_rate"], axis=1)
        errors.append(math.sqrt(np.mean(error**2)))
    return errors


@pytest.mark.slow
def test_each_step_of_calibration_pays():
    table = np.array([rms_errors(seed) for seed in range(5)])
    print()
    for name, column in zip(COLUMNS, table.T, strict=True):
        print(f"{name}: {column.min():.2g} to {column.max():.2g} rad/s")
    sheet, drawn, estimated, perfect = table.T
    assert (drawn < 0.6 * sheet).all()
    assert (estimated < 0.2 * drawn).all()
    assert (estimated < 2.0 * perfect).all()
