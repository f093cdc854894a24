"""Weights of a network as named arrays: checked, read from a file, given to one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import ClassVar, Self

import numpy as np


class NetworkWeights:
    """Base of a frozen dataclass whose fields are the arrays of a network.

    Raises:
        ValueError: a shape does not fit the others.
    """

    names: ClassVar[tuple[str, ...]]
    """of the arrays in a file, in the order of the fields; those of the torch module that is trained"""

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Field → the shape that it must have beside the others."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        for name, shape in self.shapes().items():
            array = np.array(getattr(self, name), dtype=float)
            if array.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
            object.__setattr__(self, name, array)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The network of a weights file.

        Raises:
            ValueError: an array is missing or unknown, or has the wrong shape.
        """
        if set(arrays) != set(cls.names):
            raise ValueError(f"weights of a network hold the arrays {list(cls.names)}, got {sorted(arrays)}")
        return cls(*(arrays[name] for name in cls.names))

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of a weights file, float32."""
        values = (getattr(self, field.name) for field in fields(self))  # type: ignore[arg-type]
        return {name: array.astype(np.float32) for name, array in zip(self.names, values, strict=True)}
