"""The files that the examples of ``docs/recordings.md`` read: a simulated motion in the formats of devices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from poise.filters.core import rotation

from .motion import G, axes, readings, write_table

DOT = "sep=,\nDeviceTag:,thigh\nOutputRate:,100Hz\nMeasurement Mode:,Rate Quantities(with mag)\n\n"


def write_examples(folder: Path) -> None:
    """Write every file."""
    time, gyr, acc, mag, q = readings()
    ticks = np.arange(len(time))
    channels = axes("Acc_{}", acc) | axes("Mag_{}", mag)
    matrix = {f"Mat[{i + 1}][{j + 1}]": rotation.to_matrix(q)[:, i, j] for j in range(3) for i in range(3)}
    counter = {"PacketCounter": (65_000 + ticks) % 65_536}
    write_table(
        folder / "wrist.txt", counter | channels | axes("Gyr_{}", gyr) | matrix, "\t", "// Update Rate: 100.0Hz\n"
    )
    clock = {"PacketCounter": ticks + 1, "SampleTimeFine": 1_000 + ticks * 10_000}
    kept = np.delete(ticks, np.arange(300, 320))
    dot = clock | channels | axes("Gyr_{}", np.degrees(gyr))
    write_table(folder / "thigh.csv", {name: values[kept] for name, values in dot.items()}, ",", DOT)
    phone = folder / "phone"
    write_table(phone / "Gyroscope.csv", {"Time (s)": time} | axes("{} (rad/s)", gyr))
    write_table(phone / "Accelerometer.csv", {"Time (s)": time + 0.004} | axes("{} (m/s^2)", acc))
    write_table(phone / "Magnetometer.csv", {"Time (s)": time[::4]} | axes("{} (µT)", mag[::4]))
    table, units = {"Time": time}, ["s"]
    for sensor in ("Lumbar", "Right Foot"):
        table |= axes(f"{sensor}/Acceleration/{{}}", acc) | axes(f"{sensor}/Angular Velocity/{{}}", gyr)
        table |= axes(f"{sensor}/Magnetic Field/{{}}", mag)
        table |= dict(zip((f"{sensor}/Orientation/{axis}" for axis in ("Scalar", "X", "Y", "Z")), q.T, strict=True))
        units += ["m/s^2"] * 3 + ["rad/s"] * 3 + ["uT"] * 3 + [""] * 4
    write_table(folder / "gait.csv", table, ",", "Sample Rate:,100,Hz" + "," * (len(units) - 3) + "\n", ",".join(units))
    logged = {"ms": 1e3 * time} | axes("gyro_{}", np.degrees(gyr), "xyz") | axes("acc_{}", -acc / G, "xyz")
    logged |= {f"vicon_{axis}": q[:, place] for axis, place in zip("xyzw", (1, 2, 3, 0), strict=True)}
    write_table(folder / "logger.csv", logged, ";")
