"""Checkpoints of a training: one file, written atomically, with a key of the training and without code."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..filters.support.files import write_bytes
from ..filters.support.resume import refuse_changes
from ..filters.support.version import code_version

MAGIC = b"poise checkpoint 1 "
"""How the first line of a checkpoint begins."""
ARRAY = "__array__"
"""Marks a tensor that was an array."""


def save_checkpoint(path: Path, key: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Write a checkpoint atomically; the previous one is kept beside it as ``<stem>.previous<suffix>``.

    A checkpoint resumes only a training with an equal key, of JSON's types. The state holds arrays, tensors, numbers,
    texts, lists and dictionaries.
    """
    import torch

    data = io.BytesIO()
    torch.save({"key": flat({**key, "code": code_version()}), "state": wrapped(dict(state))}, data)
    if path.is_file():
        os.replace(path, previous(path))
    write_bytes(path, sealed(data.getvalue()))


def has_checkpoint(path: Path) -> bool:
    """Whether a training had come to its first checkpoint when it was interrupted."""
    return path.is_file() or previous(path).is_file()


def load_checkpoint(path: Path, key: Mapping[str, Any]) -> dict[str, Any]:
    """The state that :func:`save_checkpoint` wrote; of the checkpoint before, with a warning, if the last is damaged.

    Raises:
        ValueError: there is no checkpoint, none can be read, or it belongs to a training with another ``key`` or to
            another version of the package.
    """
    import torch

    found = [file for file in (path, previous(path)) if file.is_file()]
    if not found:
        raise ValueError(f"there is nothing to resume: no {path.name} in {path.parent}; start a new run")
    for file in found:
        try:
            # weights_only: a checkpoint may come from elsewhere and must not run code.
            content = torch.load(io.BytesIO(opened(file.read_bytes())), weights_only=True)
        except (ValueError, pickle.UnpicklingError) as error:
            warnings.warn(f"{file} is damaged or is not a checkpoint: {error}", stacklevel=2)
            continue
        refuse_changes(file, content["key"], flat({**key, "code": code_version()}))
        return unwrapped(content["state"])
    raise ValueError(f"there is nothing to resume: no checkpoint in {path.parent} can be read")


def sealed(data: bytes) -> bytes:
    """Data behind a line that names the format and the SHA-256 of the data."""
    return MAGIC + hashlib.sha256(data).hexdigest().encode() + b"\n" + data


def opened(content: bytes) -> bytes:
    """The data of :func:`sealed`.

    Raises:
        ValueError: the line is missing, or the data are not those that it names.
    """
    line, _, data = content.partition(b"\n")
    if not line.startswith(MAGIC):
        raise ValueError("its first line names another format")
    if line != sealed(data).partition(b"\n")[0]:
        raise ValueError("its content is not what its SHA-256 says")
    return data


def previous(path: Path) -> Path:
    """Where the checkpoint before that at ``path`` is kept."""
    return path.with_name(f"{path.stem}.previous{path.suffix}")


def wrapped(value: Any) -> Any:
    """The same with every array as a tensor, marked, since arrays cannot be read without running code."""
    import torch

    if isinstance(value, np.ndarray | np.generic):
        return {ARRAY: torch.as_tensor(value)}
    if isinstance(value, dict):
        return type(value)((name, wrapped(part)) for name, part in value.items())
    return [wrapped(part) for part in value] if isinstance(value, list) else value


def unwrapped(value: Any) -> Any:
    """Inverse of :func:`wrapped`."""
    if isinstance(value, dict):
        if value.keys() == {ARRAY}:
            return value[ARRAY].numpy()
        return type(value)((name, unwrapped(part)) for name, part in value.items())
    return [unwrapped(part) for part in value] if isinstance(value, list) else value


def flat(key: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one, with names such as ``config.seed`` and JSON's types."""
    parts: dict[str, Any] = {}
    for name, value in key.items():
        parts |= flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return json.loads(json.dumps(parts))
