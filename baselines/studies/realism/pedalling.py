"""How pedalling shakes the trunk: specific force at multiples of the cadence, which a recording does not tell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .spectra import Spectrum, spectrum, whole_stretches

WINDOW = 12.0
"""s, half overlapping"""
BESIDE = 0.13
"""Hz on either side of a line that count with it"""
CADENCES = np.arange(45.0, 105.0, 1.0) / 60.0
"""Hz of the cranks that are looked for"""
BAND = (0.6, 4.0)
"""Hz in which lines are compared with everything else"""
MULTIPLES = (1, 2, 4)


def pedalling(gyr: np.ndarray, force: np.ndarray, rate: float, cranks: np.ndarray | None = None) -> dict[str, float]:
    """Cadence and shaking of a rider's trunk, medians over windows.

    Where the cadence is not known, it is the frequency at which the angular rate and at twice which the force have the
    largest share of their power: the trunk sways once a turn and is lifted twice.

    Args:
        gyr: ``(T, 3)`` rad/s, NaN where missing.
        force: ``(T, 3)`` specific force, m/s².
        rate: Hz.
        cranks: ``(T,)`` true rate of the cranks, rad/s; None where it is not known.

    Returns:
        ``cadence`` (1/min), ``shake_1``, ``shake_2``, ``shake_4``: rms of the force near these multiples of it, m/s²;
        NaN if no stretch is as long as a window.
    """
    found, length = [], round(WINDOW * rate)
    signals = [gyr, force] if cranks is None else [gyr, force, cranks[:, None] / (2.0 * np.pi)]
    for part in whole_stretches(np.concatenate(signals, axis=1), rate, WINDOW):
        for start in range(0, len(part) - length + 1, length // 2):
            piece = part[start : start + length]
            turns, forces = (spectrum(values, rate, WINDOW) for values in (piece[:, :3], piece[:, 3:6]))
            cadence = likely_cadence(turns, forces) if cranks is None else float(piece[:, 6].mean())
            found.append([60.0 * cadence, *(forces.rms(*near(each * cadence)) for each in MULTIPLES)])
    middle = np.median(found, axis=0) if found else np.full(4, np.nan)
    return dict(zip(("cadence", *(f"shake_{each}" for each in MULTIPLES)), middle.tolist(), strict=True))


def near(frequency: float) -> tuple[float, float]:
    """Band around a line, Hz."""
    return frequency - BESIDE, frequency + BESIDE


def likely_cadence(turns: Spectrum, forces: Spectrum) -> float:
    """Frequency (Hz) of the cranks from the spectra of angular rate and specific force."""
    shares = [
        turns.power(*near(each)) / turns.power(*BAND) + forces.power(*near(2.0 * each)) / forces.power(*BAND)
        for each in CADENCES
    ]
    return float(CADENCES[np.argmax(shares)])


def pedalling_row(values: Mapping[str, float]) -> dict[str, float]:
    """Columns of a table."""
    shakes = {f"force at {each} × cadence m/s²": values[f"shake_{each}"] for each in MULTIPLES}
    return {"cadence 1/min": values["cadence"]} | shakes
