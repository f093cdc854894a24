"""Plausibility of a recording: SI units, signs and axes of a right-handed sensor, time in seconds.

An estimator cannot distinguish a wrong unit from strong motion. Each check here compares a number with limits from
physics and other channels, and names the most likely mistake.
"""

from __future__ import annotations

import warnings

from ..repeats import moves
from ..resampling import shifted
from ..trajectory import Trajectory
from .bias_steps import check_bias_step
from .clocks import check_clock
from .field_changes import check_field_change
from .lateness import agreements, check_gyroscope_scale, check_lag, is_sure
from .readings import Finding, check_alive, check_copies
from .reference import check_drift, check_frozen, check_reference, check_steps, reference_on_sensor
from .sites import seen, sites, vectors
from .turning import check_halves, check_rates, compared
from .units import check_field, check_force, check_noise, check_rest, check_sign


def check_recording(trajectory: Trajectory) -> list[Finding]:
    """Look for wrong units, signs, axes and clocks.

    Args:
        trajectory: any; every ``site/gyr``, ``site/acc`` and ``site/mag`` is checked.

    Returns:
        Findings, warnings first; empty for a plausible recording.

    Raises:
        ValueError: ``trajectory`` is not a :class:`.Trajectory`.
    """
    if not isinstance(trajectory, Trajectory):
        raise ValueError(f"trajectory must be a Trajectory, such as poise.load_recording gives, got {trajectory!r}")
    findings = list(check_clock(trajectory))
    wrong_clock = any(finding.severity == "warning" for finding in findings)
    if not wrong_clock:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            trajectory = trajectory.on_grid()
    findings += check_reference(trajectory)
    if not wrong_clock:
        trajectory, moved = reference_on_sensor(trajectory)
        findings += moved
    for site in sites(trajectory):
        findings += check_site(trajectory, site, wrong_clock)
    if not any(finding.channel == "imu/gyr" and finding.severity == "warning" for finding in findings):
        findings += [*check_frozen(trajectory), *check_steps(trajectory)]
        findings += [] if wrong_clock else check_drift(trajectory)
    return sorted(findings, key=lambda finding: finding.severity != "warning")


def check_site(trajectory: Trajectory, site: str, wrong_clock: bool) -> list[Finding]:
    """All checks of one sensor."""
    recorded = {kind: vectors(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc", "mag")}
    findings: list[Finding] = []
    moving = None if recorded["gyr"] is None else moves(recorded["gyr"])
    for kind, values in recorded.items():
        if values is not None:
            findings += check_alive(f"{site}/{kind}", values, trajectory.dt if not wrong_clock else None, moving)
    findings += check_copies({f"{site}/{kind}": values for kind, values in recorded.items() if values is not None})
    dead = {finding.channel for finding in findings if finding.severity == "warning"}
    gyr, acc, mag = (
        None if f"{site}/{kind}" in dead else seen(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc", "mag")
    )
    if mag is not None:
        findings += check_field(f"{site}/mag", mag)
        if gyr is not None and acc is not None and not wrong_clock:
            changes = list(check_field_change(f"{site}/mag", trajectory.time, gyr, acc, mag))
            # Two fields tell nothing of the other sensors.
            findings, mag = findings + changes, None if changes else mag
    fits = {} if gyr is None or wrong_clock else agreements(gyr, {"acc": acc, "mag": mag}, trajectory.dt)
    late = list(check_lag(site, fits))
    if gyr is not None and any(finding.channel == f"{site}/gyr" for finding in late):
        # What follows is told of rates in their place.
        gyr = shifted({"gyr": gyr}, trajectory.time, -fits["acc"].lag)["gyr"]
    turning = {} if gyr is None or wrong_clock else compared(trajectory, site, gyr, acc, mag)
    if acc is not None:
        findings += check_force(f"{site}/acc", acc, gyr, turning.get("accelerometer"))
    if gyr is not None:
        if not wrong_clock:
            scale = fits["acc"].scale if is_sure(fits.get("acc")) else None
            rates = list(check_rates(trajectory, site, gyr, turning, scale))
            # Of rates in another unit a fit of the lag tells nothing.
            findings += rates or [*check_gyroscope_scale(site, fits), *late]
        known = any(finding.channel == f"{site}/gyr" and finding not in late for finding in findings)
        findings += check_rest(f"{site}/gyr", gyr, known or any(one.explains for one in turning.values()))
        findings += [] if known or acc is None else check_noise(f"{site}/gyr", gyr, acc)
    if gyr is not None and not wrong_clock and not any(finding.severity == "warning" for finding in findings):
        findings += list(check_halves(trajectory, site, gyr, acc, mag)) or [
            *check_bias_step(f"{site}/gyr", gyr, acc, mag, trajectory.dt)
        ]
    removed = any(f.channel == f"{site}/acc" and f.severity == "warning" and f not in late for f in findings)
    if acc is not None and not removed:
        findings += check_sign(trajectory, f"{site}/acc", acc, mag)
    return findings
