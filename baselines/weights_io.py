"""Weights in a file, with a card that describes them.

``name.safetensors`` holds arrays only: reading it runs no code. ``name.json``, the card, contains their description
and SHA-256, so that a change of the weights is detected. Shipped weights lie in :data:`WEIGHTS`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from ..filters.support.files import write_bytes, write_text

WEIGHTS = Path(__file__).resolve().parent / "weights"
"""Folder of the weights that come with the package."""

SUFFIX = ".safetensors"
ALIKE = str.maketrans("+-", "__")
DIGEST = "sha256"
"""Field of the card that :func:`save_weights` adds."""


def save_weights(path: str | Path, arrays: Mapping[str, np.ndarray], card: Mapping[str, Any]) -> Path:
    """Write ``path`` (weights) and, with the suffix ``.json``, the card; each atomically.

    Args:
        path: file of the weights; ``.safetensors`` is appended where it is missing. Folders are made.
        arrays: name → array of numbers.
        card: JSON-able description; the SHA-256 of the weights is added to it.

    Returns:
        The path of the weights.

    Raises:
        ValueError: there are no arrays, one is not finite or of a type that the format lacks, or the card is not
            JSON-able or has a field ``sha256`` already.
    """
    path = weights_path(path)
    if not arrays:
        raise ValueError("weights must hold at least one array, got none")
    contiguous = {name: np.array(array, order="C") for name, array in arrays.items()}
    for name, array in contiguous.items():
        if array.dtype.kind not in "fiub":
            raise ValueError(f"weights {name!r} must be numbers, got dtype {array.dtype}")
        if not np.isfinite(array).all():
            raise ValueError(f"weights {name!r} must be finite")
    if DIGEST in card:
        raise ValueError(f"the card must not hold {DIGEST!r}: it is computed here")
    try:
        data = save(contiguous)
        digest = {DIGEST: hashlib.sha256(data).hexdigest()}
        text = json.dumps({**card, **digest}, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    except (SafetensorError, KeyError, TypeError, ValueError) as reason:
        raise ValueError(f"cannot write {path.name}: {reason}") from None
    write_text(card_path(write_bytes(path, data)), text)
    return path


def load_weights(path_or_name: str | Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read weights and card.

    Args:
        path_or_name: path of a ``.safetensors`` file (its card lies beside it), or the name of shipped weights.

    Returns:
        Name → array, and the card.

    Raises:
        FileNotFoundError: there are no such weights, or their card is missing; the message lists what is shipped.
        ValueError: the weights are not those that the card describes, or one of the files is damaged.
    """
    path, card = find_weights(path_or_name), load_card(path_or_name)
    data = path.read_bytes()
    found = hashlib.sha256(data).hexdigest()
    if found != card[DIGEST]:
        raise ValueError(
            f"{path} is not the file that its card describes: it is damaged or was exchanged "
            f"({DIGEST} {found[:12]}…, the card says {card[DIGEST][:12]}…)"
        )
    try:
        return load(data), card
    except SafetensorError as reason:
        raise ValueError(f"{path} is not a safetensors file: {reason}") from None


def load_card(path_or_name: str | Path) -> dict[str, Any]:
    """Read the card of weights alone; arguments and errors are those of :func:`load_weights`."""
    path = find_weights(path_or_name)
    beside = card_path(path)
    if not beside.is_file():
        raise FileNotFoundError(f"{path} has no card {beside.name} beside it")
    try:
        card = json.loads(beside.read_text(encoding="utf-8"))
    except ValueError as reason:
        raise ValueError(f"{beside} is not JSON: {reason}") from None
    if not isinstance(card, dict) or not isinstance(card.get(DIGEST), str):
        raise ValueError(f"{beside} must hold the {DIGEST} of {path.name}")
    return card


def list_weights() -> list[str]:
    """Names of the shipped weights."""
    return sorted(path.stem for path in WEIGHTS.glob(f"*{SUFFIX}"))


def find_weights(path_or_name: str | Path) -> Path:
    """Path of the weights of a shipped name or of a file.

    The names of estimators are names of their weights: a + or - of a name matches a _ of a file.

    Raises:
        FileNotFoundError: there are none.
    """
    given = Path(path_or_name)
    # A bare name selects shipped weights, independent of the working directory.
    bare = given.name == str(path_or_name) and given.suffix != SUFFIX
    if bare:
        names = {name.translate(ALIKE): name for name in list_weights()}
        given = WEIGHTS / names.get(given.name.translate(ALIKE), given.name)
    path = weights_path(given)
    if not path.is_file():
        raise FileNotFoundError(f"no weights {str(path_or_name)!r}; shipped are {', '.join(list_weights()) or 'none'}")
    return path


def weights_path(path: str | Path) -> Path:
    """The path with the suffix of weights."""
    path = Path(path)
    return path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)


def card_path(path: Path) -> Path:
    """Path of the card of weights."""
    return path.with_suffix(".json")
