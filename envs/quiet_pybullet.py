"""PyBullet without the line that it prints to standard output when it is imported.

That line would stand among machine-readable rows. PyBullet prints it in C, so Python's own redirection does not catch
it.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def silent_output() -> Iterator[None]:
    """Nothing that is written to file descriptor 1 within comes out; without such a descriptor nothing is done."""
    try:
        kept = os.dup(1)
    except OSError:
        yield
        return
    if sys.stdout is not None:
        sys.stdout.flush()
    c_library = ctypes.CDLL(None)
    c_library.fflush(None)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
        # what C holds back would come out after the descriptor is the old one again
        c_library.fflush(None)
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


with silent_output():
    import pybullet

__all__ = ["pybullet"]
