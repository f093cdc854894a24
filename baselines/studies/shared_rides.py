"""Rides of all works, recorded before the works begin: a ride that several of them want is ridden once."""

from __future__ import annotations

from collections.abc import Collection

from .force_inertial.rides import RIDES as FORCE_INERTIAL
from .kit import Study
from .two_gyro.rides import RIDES as TWO_GYRO
from .whole_body.rides import RIDES as WHOLE_BODY


def record_rides(study: Study, papers: Collection[str]) -> None:
    """Record the rides of those works that ride, several at a time; :attr:`.Study.rides` is where they find them."""
    works = (TWO_GYRO, FORCE_INERTIAL, WHOLE_BODY)
    study.record_together(job for work in works if work.name in papers for job in work.jobs(study))
