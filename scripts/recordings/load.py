"""Recordings that a command is given: files and folders → trajectories of distinct names, and what was passed over."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ...envs.data.trajectory import Trajectory
    from ..output import Output


def load_all(
    paths: Sequence[Path], calibration: Path | None = None, site: str | None = None
) -> tuple[list[Trajectory], list[tuple[Path, str]]]:
    """Load files, and folders as the recordings below them.

    Args:
        paths: files or folders.
        calibration: record of ``poise calibrate``.
        site: in recordings of several sensors, the one to use.

    Returns:
        Trajectories of distinct names; files of folders that were passed over, with the reason.

    Raises:
        ValueError: there is no recording, or a file that was named itself cannot be read.
        FileNotFoundError: a path leads nowhere.
    """
    from ...baselines.evaluation import distinct
    from ...envs.data.formats.load import find_recordings, load_recordings

    if not paths:
        raise ValueError("name at least one file or folder of recordings")
    found: list[Trajectory] = []
    sources: list[Path | None] = []
    passed_over: list[tuple[Path, str]] = []
    for path in paths:
        files = find_recordings(path) if path.is_dir() else [path]
        for file in files:
            try:
                loaded = load_recordings(file, calibration)
                loaded = loaded if site is None else chosen(loaded, site)
                found += loaded
                sources += [file] * len(loaded)
            except ValueError as reason:
                if not path.is_dir():
                    raise
                passed_over.append((file, str(reason)))
        if path.is_dir():
            others = (file for file in path.rglob("*") if file.is_file() and not file.name.startswith("."))
            # A folder may be a recording itself.
            unread = [file for file in sorted(others) if not set(files) & {file, *file.parents}]
            passed_over += [(file, "no known format, or part of another recording") for file in unread]
    if not found:
        reasons = "; ".join(f"{file.name}: {reason}" for file, reason in passed_over[:5])
        raise ValueError(f"no recording in {', '.join(map(str, paths))}{f' ({reasons})' if reasons else ''}")
    return distinct(found, sources), passed_over


def chosen(trajectories: list[Trajectory], site: str) -> list[Trajectory]:
    """One sensor of a recording: a trajectory of its own, or channels of the only trajectory."""
    named = [one for one in trajectories if str(one.metadata.get("sensor")).lower() == site.lower()]
    if named or len(trajectories) > 1:
        if not named:
            there = ", ".join(str(one.metadata.get("sensor")) for one in trajectories)
            raise ValueError(f"no sensor {site!r}; there are {there}")
        return named
    return [at_site(trajectories[0], site)]


def at_site(trajectory: Trajectory, site: str) -> Trajectory:
    """One sensor of a recording, as ``imu``; of a ride with the truth of that sensor.

    Raises:
        ValueError: there is no such sensor.
    """
    from ...envs.bicycle.sensors.single_imu import SITES, imu_of

    if site in SITES and f"{site}/gyr" in trajectory.measurements:
        return imu_of(trajectory, site)
    channels = site_channels(trajectory, site)
    if not channels:
        from ...envs.data.plausibility.sites import sites

        raise ValueError(f"{trajectory.name!r} has no sensor {site!r}; there are {', '.join(sites(trajectory))}")
    truth = {
        name.rpartition("/")[2]: values for name, values in trajectory.truth.items() if name.startswith(f"{site}/")
    }
    return trajectory.replace(
        measurements=channels, truth=truth, metadata={**trajectory.metadata, "name": f"{trajectory.name}/{site}"}
    )


def site_channels(trajectory: Trajectory, site: str) -> dict[str, Any]:
    """Channels of one sensor, as those of ``imu``."""
    return {
        f"imu/{name.rpartition('/')[2]}": values
        for name, values in trajectory.measurements.items()
        if name.rpartition("/")[0] == site
    }


def sensors_of(trajectory: Trajectory, channels: Sequence[str] = ()) -> list[Trajectory]:
    """The sensors of a recording, each as ``imu``; the recording itself if it has one, or has all the ``channels``."""
    from ...envs.data.plausibility.sites import sites

    if "imu/gyr" in trajectory.measurements or (channels and set(channels) <= set(trajectory.measurements)):
        return [trajectory]
    found = [site for site in sites(trajectory) if f"{site}/gyr" in trajectory.measurements]
    return [at_site(trajectory, site) for site in found] or [trajectory]


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Print warnings of the package in one line each on standard error, every text once."""
    shown: set[str] = set()

    def show(message: Any, category: type[Warning], filename: str, lineno: int, *rest: Any) -> None:
        text = " ".join(str(message).split())
        # What was not run is listed under the tables.
        if text not in shown and " was not run on " not in text:
            shown.add(text)
            print(f"poise: warning: {text}", file=sys.stderr, flush=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


def passed_over_text(passed_over: Sequence[tuple[Path, str]], most: int = 10) -> str:
    """Files that were passed over with the reason, one line per file."""
    lines = [f"- {file}: {' '.join(reason.split())}" for file, reason in passed_over[:most]]
    more = len(passed_over) - len(lines)
    return "\n".join([*lines, *([f"- … and {more} more"] if more > 0 else [])])


def say_passed_over(passed_over: Sequence[tuple[Path, str]], out: Output) -> None:
    """Print some of the files that were passed over; all are in the report."""
    if passed_over:
        out.sections["Passed over"] = passed_over_text(passed_over, most=1000)
        out.say(f"passed over:\n{passed_over_text(passed_over)}")
