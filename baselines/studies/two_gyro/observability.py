r"""Exact ranks of the two-gyroscope paper's observability argument (17)–(22), by Lie derivatives in rational numbers.

The published gradients {h, L_f0 h, L_f5 h, L_f5 f0 h} have rank 8, not 9: a common rate about the vertical in both
gyroscopes (δb_z^p = 1, δb^h = R_PHᵀ [0, tan φ, 1]) cannot be distinguished. L_f0 f1 h instead of the last closes the
gap, so the conclusion stands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ....filters.analysis.observability import exact_rank, lie_gradients

if TYPE_CHECKING:
    import sympy

PUBLISHED = ((), ("f0",), ("f5",), ("f5", "f0"))
"""Lie derivatives of h in (20)."""
STACKS: dict[str, tuple[tuple[str, ...], ...]] = {
    "h, L_f0, L_f5": PUBLISHED[:3],
    "+ L_f5 f0 (as published)": PUBLISHED,
    "+ L_f0 f5": (*PUBLISHED[:3], ("f0", "f5")),
    "+ both orders": (*PUBLISHED, ("f0", "f5")),
    "h, L_f0, L_f5, L_f0 f1": (*PUBLISHED[:3], ("f0", "f1")),
    "as published + L_f0 f1": (*PUBLISHED, ("f0", "f1")),
}
"""What is stacked in each line of the table."""
POINT = {"phi": "1/7", "t1": "2/9", "t2": "-3/11", "t3": "1/5"}
"""Tangents of half the angles at which ranks are taken; any other generic point gives the same."""
BIASES = ("1/3", "-2/5", "3/7", "5/9", "-1/4", "2/3")
TIMES = ("1/11", "1/13")
"""1/τ of body and platform."""


def symbols() -> dict[str, Any]:
    """φ, θ, biases and inverse time constants."""
    import sympy

    names = "phi t1 t2 t3 h1 h2 h3 p1 p2 p3 qh qp"
    return dict(zip(names.split(), sympy.symbols(names), strict=True))


def equations() -> tuple[dict[str, sympy.Matrix], sympy.Matrix, sympy.Matrix]:
    """Vector fields of (17), output h = θ and state of Σ2; the rates of the platform are f4 (x) and f5 (z)."""
    import sympy

    v = symbols()
    sin, cos = sympy.sin, sympy.cos
    s1, c1, s2, c2, s3, c3 = (f(v[name]) for name in ("t1", "t2", "t3") for f in (sin, cos))
    A = sympy.Matrix([[c3 / c2, -s3 / c2, 0], [s3, c3, 0], [-c3 * s2 / c2, s3 * s2 / c2, 1]])
    M = sympy.Matrix([[-1, -s1 * s2 / c2, c1 * s2 / c2], [0, -c1, -s1], [0, s1 / c2, -c1 / c2]])
    body, theta = sympy.Matrix([v["h1"], v["h2"], v["h3"]]), sympy.Matrix([v["t1"], v["t2"], v["t3"]])
    tangent = sin(v["phi"]) / cos(v["phi"])
    D, platform = M * sympy.Matrix([[1, 0], [0, tangent], [0, 1]]), sympy.Matrix([v["p1"], v["p3"]])
    state = sympy.Matrix.vstack(sympy.Matrix([v["phi"]]), theta, body, platform)
    drift = sympy.Matrix.vstack(
        sympy.Matrix([-v["p1"]]), -A * body - D * platform, -v["qh"] * body, -v["qp"] * platform
    )
    zeros = sympy.zeros(5, 1)
    fields = {"f0": drift}
    for index in range(3):
        fields[f"f{index + 1}"] = sympy.Matrix.vstack(sympy.zeros(1, 1), A[:, index], zeros)
    for index, name in enumerate(("f4", "f5")):
        fields[name] = sympy.Matrix.vstack(sympy.Matrix([1 - index]), D[:, index], zeros)
    return fields, theta, state


def ranks() -> dict[str, int]:
    """Generic rank of each of :data:`STACKS`, exact at a rational point. Needs the package sympy."""
    fields, output, state = equations()
    angles, values = point()
    return {
        name: exact_rank(lie_gradients(fields, output, state, words), angles, values)[0]
        for name, words in STACKS.items()
    }


def point() -> tuple[dict[Any, str], dict[Any, str]]:
    """Half-angle tangents, and values of biases and time constants, by symbol."""
    v = symbols()
    angles = {v[name]: value for name, value in POINT.items()}
    others = dict(zip((v[name] for name in ("h1", "h2", "h3", "p1", "p2", "p3")), BIASES, strict=True))
    return angles, others | dict(zip((v["qh"], v["qp"]), TIMES, strict=True))
