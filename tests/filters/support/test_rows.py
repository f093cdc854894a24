"""Rows of any kind become plain values, JSON or Markdown."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from poise.filters.support import rows


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.23456, "1.23"), (12345.6, "12346"), (1e-7, "1e-07"), (math.nan, "–"), (None, "–"), (True, "yes"), (12, "12")],
)
def test_cell(value: Any, text: str) -> None:
    assert rows.cell(value) == text


def test_markdown_table_chooses_and_escapes() -> None:
    text = rows.markdown_table([{"a": "x|y", "b": 2.0, "c": 3}], columns=["b", "a"])
    assert text.splitlines() == ["| b | a |", "| ---: | --- |", "| 2 | x\\|y |"]


def test_a_row_must_be_a_record() -> None:
    with pytest.raises(TypeError, match="a row is"):
        rows.records([(1, 2)])


def test_numbers_that_are_not_finite_become_what_is_asked_for() -> None:
    value = {"a": (np.float64("nan"), 1.5), "b": np.array([1.0, math.inf])}
    assert json.dumps(rows.jsonable(value, lambda _: None), allow_nan=False) == '{"a": [null, 1.5], "b": [1.0, null]}'
    assert rows.jsonable(value)["b"] == [1.0, "inf"]
