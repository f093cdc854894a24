"""Speed of the filters relative to other packages: rates and ratios of one run on one machine."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator

import numpy as np

from ...filters.core.estimator import run
from ...filters.core.kalman import KalmanFilter
from ...filters.imu.external_acceleration import ExternalAcceleration
from ..registry import make_estimator
from .measure import Speed, form_rates, measure

BATCHES = (256, 1024)


def samples(length: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Six-axis samples of a tumbling sensor; their values do not affect the cost."""
    generator = np.random.default_rng(seed)
    force = generator.standard_normal((length, 3)) + np.array([0.0, 0.0, 9.8])
    return {"imu/gyr": generator.standard_normal((length, 3)), "imu/acc": force}


def filterpy_run(model: ExternalAcceleration, measurements: dict[str, np.ndarray]) -> np.ndarray:
    """The external-acceleration filter (mode 1) as a user of filterpy would write it; states ``(T, 3)``.

    It is both the yardstick of speed and an independent second implementation.
    """
    from filterpy.kalman import KalmanFilter as FilterpyFilter

    other = FilterpyFilter(dim_x=3, dim_z=3)
    gyroscope, accelerometer, g = measurements["imu/gyr"], measurements["imu/acc"], model.gravity
    up = accelerometer[0] / np.linalg.norm(accelerometer[0])
    acceleration = accelerometer[0] - g * up
    other.x, other.P, other.H = up.reshape(3, 1), 1e-2 * np.eye(3), g * np.eye(3)
    states = [up]
    for rate, force in zip(gyroscope[1:], accelerometer[1:], strict=True):
        turn = -model.dt * rate
        angle = np.linalg.norm(turn)
        x, y, z = turn
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        phi = np.eye(3) + np.sin(angle) / angle * skew + (1.0 - np.cos(angle)) / angle**2 * skew @ skew
        up = other.x[:, 0]
        other.predict(F=phi, Q=(model.dt * model.gyroscope_noise) ** 2 * (np.eye(3) - np.outer(up, up)))
        variance = model.accelerometer_noise**2 + model.c_a**2 * (acceleration @ acceleration) / 3.0
        other.update(force - model.c_a * acceleration, R=variance * np.eye(3))
        other.x = other.x / np.linalg.norm(other.x)
        acceleration = force - g * other.x[:, 0]
        states.append(other.x[:, 0])
    return np.array(states)


def filter_speeds() -> Iterator[Speed]:
    """Updates a second of the three-state filter in every form, beside filterpy; then of larger filters and VQF."""
    model, short = ExternalAcceleration(), samples(2_000)
    group = "external-acceleration (3 states, 3 rows)"
    yardstick = measure(lambda: filterpy_run(model, short), 2_000)
    yield Speed(group, "filterpy.KalmanFilter, same equations", yardstick, "updates/s", 1.0)
    for what, rate in form_rates(KalmanFilter(model), samples, 2_000, 100_000, 100, 200, BATCHES):
        yield Speed(group, what, rate, "updates/s", rate / yardstick)
    for name in ("mekf", "bounded-motion", "mahony", "gru", "vqf"):
        try:
            estimator = make_estimator(name, dt=0.01)
        except ImportError:
            continue
        part = samples(20_000)
        rate = measure(lambda estimator=estimator, part=part: run(estimator, part), 20_000)  # type: ignore[misc]
        yield Speed("whole sequence by name", name, rate, "updates/s", rate / yardstick)


FIRST_RUN = """
import time
import numpy as np
start = time.perf_counter()
from poise.baselines.speed.filters import samples
from poise.filters.core.estimator import run
from poise.filters.imu.external_acceleration import ExternalAcceleration
from poise.filters.core.kalman import KalmanFilter
imported = time.perf_counter()
run(KalmanFilter(ExternalAcceleration()), samples(10))
first = time.perf_counter()
run(KalmanFilter(ExternalAcceleration()), samples(10))
print(first - imported, time.perf_counter() - first)
"""


def latencies() -> Iterator[Speed]:
    """Seconds until a process has run its first filter: nothing cached, then with the compiled file in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        environment["POISE_CACHE"] = folder
        for what in ("first run of a machine (traces, compiles)", "first run of a process (from the cache)"):
            result = subprocess.run(
                [sys.executable, "-c", FIRST_RUN], env=environment, capture_output=True, text=True, check=True
            )
            first, again = map(float, result.stdout.split())
            yield Speed("latency", what, first, "s")
    yield Speed("latency", "run of 10 samples afterwards", again, "s")
