"""Plausibility of the readings of one channel: dead, stuck, copied, repeated, saturated or wrapped samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from ....filters.core.quantity import ACCELEROMETER, GYROSCOPE, MAGNETOMETER, SHORTEST
from ..bursts import bursts
from ..glitches import LEAST, glitches
from ..ranges import at_range, reached_range
from ..repeats import HELD, foreign_runs, moves, repeated_blocks, runs_of, stuck_axes, usual_run

CHANNELS = {"gyr": GYROSCOPE, "acc": ACCELEROMETER, "mag": MAGNETOMETER}
LONGEST_ABSENCE = 0.3
"""Share of a recording: a longer stretch without rates makes most of an estimate a guess."""
UNREADABLE = 1e12
"""Beyond any reading in any unit of a sensor: numbers that were damaged, or read as another type."""
MOST_CODES = 3
"""Magnitudes of codes for no value in one channel."""
OVERFLOW = 0.8
"""Share of the largest reading beyond which a jump to the other sign is the overflow of a counter."""
SLOWER = 0.8
"""Share of values that stand equally long, from which on a sensor is slower than its table."""
BETWEEN = 0.01
"""Share of readings in the middle third of a range, below which they are unsigned numbers of a signed sensor."""
FEWEST_JUMPS = 5
"""Of such readings, from one end of the range to the other."""
CLIPPED, OFTEN_CLIPPED = 1e-3, 5e-3
"""Share of saturated samples that is told, and of which a gyroscope's rotation is lost."""

Severity = Literal["note", "warning"]


@dataclass(frozen=True)
class Finding:
    """One finding about a recording.

    Attributes:
        severity: ``warning`` if estimates will be wrong, else ``note``.
        channel: affected channel, ``time``, or quantity of the truth.
        what: what was found, with the number.
        cause: the likely cause.
        remedy: what to do about it.
    """

    severity: Severity
    channel: str
    what: str
    cause: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.channel}: {self.what}; likely cause: {self.cause}. {self.remedy}"


def codes(kind: str, values: np.ndarray) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` that stand for no value: beyond any sensor's range, of few magnitudes.

    Samples beyond it of many magnitudes are of another unit.
    """
    beyond = np.abs(values) > CHANNELS[kind].limit
    found = beyond.any(axis=1)
    return found if len(np.unique(np.abs(values[beyond]))) <= MOST_CODES else np.zeros(len(values), bool)


def plausible_samples(kind: str, values: np.ndarray) -> np.ndarray:
    """Samples ``(T, 3)`` with NaN for codes, glitches, numbers that are not readings and, but of a gyroscope, zeros."""
    none = codes(kind, values) | (np.abs(values) > UNREADABLE).any(axis=1)
    if kind in LEAST:
        none |= glitches(values, LEAST[kind])
    found = np.where(none[:, None], np.nan, values)
    return found if kind == "gyr" else np.where((np.abs(found) >= SHORTEST).any(axis=1, keepdims=True), found, np.nan)


def check_alive(
    channel: str, values: np.ndarray, dt: float | None = None, moving: np.ndarray | None = None
) -> Iterator[Finding]:
    """Zeros, constants, copies, repeats, clipping, overflow, absent and impossible samples.

    Args:
        channel: ``site/gyr`` and so on.
        values: ``(T, 3)``.
        dt: s between samples; None where it is unknown.
        moving: where the gyroscope of the same site moves (:func:`poise.envs.data.repeats.moves`); None without one.
    """
    present = np.isfinite(values).all(axis=1)
    if not present.any():
        yield Finding("warning", channel, "no sample at all", "a channel that was not recorded", "Leave it out.")
        return
    unreadable = present & (np.abs(values) > UNREADABLE).any(axis=1)
    if unreadable.any() and not codes(channel.rpartition("/")[2], values).any():
        share, largest = 100.0 * unreadable.sum() / present.sum(), np.abs(values[unreadable]).max()
        what = f"{share:.3g} % of the samples reach {largest:.2g}"
        cause = "a damaged file, or numbers that were read as another type"
        yield Finding("warning", channel, what, cause, "They are treated as missing samples.")
        present &= ~unreadable
        if not present.any():
            return
    samples = values[present]
    longest = float(np.diff(np.flatnonzero(np.concatenate([[True], present, [True]]))).max() - 1) / len(present)
    if channel.endswith("gyr") and longest > LONGEST_ABSENCE:
        what = f"{100 * longest:.0f} % of the samples are missing in one stretch"
        remedy = "Cut the recording, or choose another channel: without rates nothing follows a rotation."
        yield Finding("warning", channel, what, "a gyroscope that failed or was switched off", remedy)
    nothing = ~(samples.any(axis=1) if channel.endswith("gyr") else (np.abs(samples) >= SHORTEST).any(axis=1))
    zero = float(np.mean(nothing))
    still = len(samples) > 20 and bool((samples == samples[0]).all())
    what = f"{100 * zero:.0f} % of the samples are 0, 0, 0" + (" or nearly" if samples[nothing].any() else "")
    if 0.5 < zero < 0.995 and slower(samples):
        remedy = "Replace the zeros by NaN." if channel.endswith("gyr") else "They are treated as missing samples."
        severity: Severity = "warning" if channel.endswith("gyr") else "note"
        yield Finding(severity, channel, what, "a slower sensor, and zeros between its samples", remedy)
    elif zero > 0.5:
        yield Finding("warning", channel, what, "a sensor that was absent or off", "Leave the channel out.")
        return
    if still:
        remedy = "Leave the channel out."
        yield Finding("warning", channel, f"always {samples[0].tolist()}", "a sensor that is off or stuck", remedy)
        return
    if 0.01 < zero <= 0.5 and not channel.endswith("gyr"):
        yield Finding("note", channel, what, "drop-outs written as zeros", "They are treated as missing samples.")
    impossible = codes(channel.rpartition("/")[2], samples)
    if impossible.any():
        what = f"{100 * impossible.mean():.3g} % of the samples reach {np.abs(samples[impossible]).max():g}"
        yield Finding("note", channel, what, "codes for no value", "They are treated as missing samples.")
    kind = channel.rpartition("/")[2]
    single = glitches(values, LEAST[kind]) if kind in LEAST else np.zeros(len(values), bool)
    alone = 0 if impossible.any() else int((single & ~unreadable).sum())
    if alone:
        what = f"{alone} samples stand alone, far from those beside them"
        yield Finding("note", channel, what, "errors of the transmission", "They are treated as missing samples.")
    yield from check_axes_alive(channel, samples[~impossible])
    yield from check_repeats(channel, values, dt, moving)
    if dt is not None:
        yield from check_stretches(channel, values, dt, single)
    yield from check_range(channel, samples[~impossible])


def check_stretches(channel: str, values: np.ndarray, dt: float, single: np.ndarray) -> Iterator[Finding]:
    """Axes that stand still, blocks that were written again, and bursts beside the glitches ``single``."""
    kind = channel.rpartition("/")[2]
    remedy = "They are treated as missing samples."
    for axis, begin, length in stuck_axes(values, dt):
        what = f"axis {'xyz'[axis]} stands at {values[begin, axis]:.4g} for {length * dt:.1f} s from sample {begin}"
        yield Finding("warning", channel, what, "an axis that failed on the way", remedy)
    again = np.flatnonzero(repeated_blocks(values))
    if len(again):
        what = f"{len(again)} samples in blocks that stood there before, from sample {again[0]}"
        added = "If rows were added so, leave them out: what follows is late."
        yield Finding("note", channel, what, "a buffer that was sent or written twice", f"{remedy} {added}")
    if kind not in LEAST:
        return
    wild = np.flatnonzero(bursts(values, kind, dt) & ~single)
    if len(wild):
        what = f"{len(wild)} samples in a row jump away and back at once, from sample {wild[0]}"
        yield Finding("note", channel, what, "errors of the transmission", remedy)


def slower(samples: np.ndarray) -> bool:
    """Whether samples ``(T, 3)`` other than zeros come at equal intervals."""
    steps = np.diff(np.flatnonzero(samples.any(axis=1)))
    return len(steps) >= 20 and float((np.abs(steps - np.median(steps)) <= 1).mean()) > SLOWER


def check_axes_alive(channel: str, samples: np.ndarray) -> Iterator[Finding]:
    """Axes that never change or that equal another, while the others move."""
    if len(samples) <= 20:
        return
    dead = (samples == samples[0]).all(axis=0)
    for axis in np.flatnonzero(dead):
        what = f"axis {'xyz'[axis]} is always {samples[0, axis]:g}"
        yield Finding("warning", channel, what, "an axis that is off or stuck", "Leave the channel out.")
    for one, other in ((0, 1), (0, 2), (1, 2)):
        equal = np.array_equal(np.abs(samples[:, one]), np.abs(samples[:, other]))
        if equal and not dead[one]:
            what = f"axes {'xyz'[one]} and {'xyz'[other]} are the same"
            yield Finding("warning", channel, what, "a column that was named twice", "Name three different columns.")


def check_repeats(
    channel: str, values: np.ndarray, dt: float | None, moving: np.ndarray | None = None
) -> Iterator[Finding]:
    """Runs of one sample, of a slower sensor or in place of missing samples (:mod:`poise.envs.data.repeats`)."""
    if dt is None:
        return
    lengths = runs_of(values)[1]
    usual = usual_run(lengths)
    if usual > 1 and float((lengths == usual).mean()) > SLOWER:
        what = f"every sample stands {usual} times: the sensor runs at {1.0 / (usual * dt):.4g} Hz"
        cause = "a recorder that is faster than the sensor"
        yield Finding("note", channel, what, cause, "Replace the repeated samples by NaN, or keep every first one.")
    own = channel.endswith("gyr")
    begins, lengths = foreign_runs(values, dt, None if own else moving)
    zero = ~(moves(values[begins]) if own else values[begins].any(axis=1))
    if own and zero.any() and lengths[zero].max() * dt >= HELD:
        start, length = begins[zero][lengths[zero].argmax()], lengths[zero].max()
        what = f"0, 0, 0 for {length * dt:.1f} s from sample {start}"
        remedy = "They are treated as missing samples where the accelerometer moves; else it may have rested."
        yield Finding("warning", channel, what, "drop-outs written as zeros", remedy)
    if not zero.all():
        start, length = begins[~zero][lengths[~zero].argmax()], lengths[~zero].max()
        often = "" if np.sum(~zero) == 1 else f" at {np.sum(~zero)} places,"
        what = f"one sample again and again,{often} for {length * dt:.1f} s from sample {start}"
        severity: Severity = "warning" if length * dt >= HELD else "note"
        cause = "a recorder that repeats the last sample where none came"
        yield Finding(severity, channel, what, cause, "They are treated as missing samples.")


def check_copies(channels: Mapping[str, np.ndarray]) -> Iterator[Finding]:
    """Channels whose samples ``(T, 3)`` are those of another one."""
    for (one, values), (other, others) in combinations(channels.items(), 2):
        if np.isfinite(values).any() and values.any() and np.array_equal(values, others, equal_nan=True):
            cause = "columns that were named twice"
            yield Finding("warning", other, f"the same samples as {one}", cause, "Name the columns of each sensor.")


def check_range(channel: str, samples: np.ndarray) -> Iterator[Finding]:
    """Saturation, and counters that overflow."""
    if len(samples) < 3:
        return
    unsigned = [axis for axis in range(3) if is_unsigned(samples[:, axis])]
    if unsigned:
        axes, largest = ", ".join("xyz"[axis] for axis in unsigned), samples[:, unsigned].max()
        what = f"readings of {axes} lie near 0 and near {largest:.4g}, none between"
        remedy = "Read the counts as signed numbers: of 16 bits, those from 32768 on less 65536."
        yield Finding("warning", channel, what, "signed numbers that were read as unsigned", remedy)
        return
    clipped = clipped_share(samples)
    if clipped > CLIPPED:
        what = f"{100 * clipped:.1f} % of the samples stand at the extreme value {np.abs(samples).max():.4g}"
        lost = channel.endswith("gyr") and clipped > OFTEN_CLIPPED
        severity: Severity = "warning" if lost else "note"
        remedy = "Choose a larger range of the sensor."
        yield Finding(severity, channel, what, "saturation of the sensor", remedy)
    elif (
        reached := reached_range(kind, samples) if (kind := channel.rpartition("/")[2]) in LEAST else None
    ) is not None:
        count = int(at_range(samples, reached).sum())
        what = f"{count} samples stand at {reached:.4g}, the end of the range"
        remedy = "What jumps there counts as missing; readings that saturate in a motion stay."
        yield Finding("note", channel, what, "saturation of the sensor, or errors of the transmission", remedy)
    limit = OVERFLOW * np.abs(samples).max(axis=0)
    before, after = samples[:-1], samples[1:]
    jumps = int((((before > limit) & (after < -limit)) | ((before < -limit) & (after > limit))).sum())
    if jumps >= 3:
        what = f"{jumps} jumps from one end of the range to the other"
        remedy = "Choose a larger range of the sensor, or read the counts as signed numbers."
        yield Finding("warning", channel, what, "numbers that overflow", remedy)


def is_unsigned(values: np.ndarray) -> bool:
    """Whether readings ``(T,)`` jump between the ends of a range without negative numbers, and avoid its middle."""
    if values.min() < 0.0 or values.max() <= 0.0:
        return False
    low, high = values < values.max() / 3.0, values > values.max() * 2.0 / 3.0
    jumps = int((low[1:] & high[:-1]).sum() + (high[1:] & low[:-1]).sum())
    return bool(jumps >= FEWEST_JUMPS and 1.0 - low.mean() - high.mean() < BETWEEN)


def clipped_share(samples: np.ndarray) -> float:
    """Share of samples with a component at the largest magnitude of all, in runs of three or more."""
    largest = np.abs(samples).max()
    at_limit = np.abs(samples) >= (1.0 - 1e-4) * largest
    runs = at_limit[2:] & at_limit[1:-1] & at_limit[:-2] & (samples[2:] != 0.0)
    return float(runs.any(axis=1).mean()) if len(runs) else 0.0
