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
        ValueError: an unknown paper, or one whose study is not part of this version.
    """
    module = look_up("paper", name, PAPERS)
    try:
        return importlib.import_module(module, __package__).reproduce
    except ModuleNotFoundError as error:
        # What the module itself imports may be missing too: that is a defect, not an absent study.
        if error.name != f"{__package__}{module}":
            raise
        raise ValueError(f"the study of {name!r} is not part of this version") from None
