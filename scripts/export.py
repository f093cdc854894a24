"""Export a trained network as ONNX, for programs without Python."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from .output import Output
from .targets import check_file


@dataclass
class Args:
    """Arguments of ``poise export``."""

    weights: tyro.conf.Positional[str]
    """name of shipped weights, such as gru, or a file of weights"""
    onnx: Path
    """ONNX file to write: a graph with its memory as input and output, and the model card in its metadata"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Write the file."""
    from ..baselines.learned.onnx_export import export_onnx

    check_file("onnx", args.onnx, (Path(args.weights),))
    with Output("export", args) as out:
        path = export_onnx(args.weights, args.onnx)
        out.say(f"{path}: {path.stat().st_size / 1000.0:.0f} kB")
        out.add(file=str(path))
    return 0
