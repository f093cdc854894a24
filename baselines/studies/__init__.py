"""Reproductions of the studies of the papers on simulated rides and motions, one package per paper."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from ...filters.support.names import look_up

if TYPE_CHECKING:
    from .kit import Study
    from .report import Report

PAPERS: dict[str, str] = {
    "two-gyro": ".two_gyro.study",
    "force-inertial": ".force_inertial.study",
    "whole-body": ".whole_body.study",
    "accelerometer-array": ".accelerometer_array.study",
    "external-acceleration": ".external_acceleration.study",
}
"""Paper → module with ``reproduce(study, report)``."""


def find_paper(name: str) -> Callable[[Study, Report], None]:
    """The function that does a paper's study again.

    Raises:
        ValueError: an unknown paper.
    """
    return importlib.import_module(look_up("paper", name, PAPERS), __package__).reproduce
