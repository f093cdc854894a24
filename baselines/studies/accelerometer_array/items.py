"""Tables, figures and statements of the thesis on the game controller, and what of the study answers each."""

from __future__ import annotations

from ..coverage import Item

TWO, THREE, FOUR, DEVICE = (
    "Chapter 2: what",
    "Chapter 3: what",
    "Chapter 4 and appendix B",
    "Chapter 4, the thesis' device",
)
FIVE, BEYOND, TABLE_5_1, VIRTUAL = "Chapter 5: what", "Chapter 5, beyond", "Table 5.1: what", "Virtual controller: what"

ITEMS = (
    Item("Figures 2.2 to 2.4", "bias and noise of real accelerometers", because="they show single real sensors"),
    Item("Figures 1.x, 2.1, 2.5 to 2.8", "photographs, drawings, flow chart", because="they show no result"),
    Item(
        "Figure 2.9",
        "integration is useless after instants",
        shown=("Figures 2.9 to 2.12",),
        decided=((TWO, "Figure 2.9"),),
    ),
    Item(
        "Figure 2.10",
        "polynomial roots take the wrong root, the proposed method does not",
        shown=("Figures 2.9 to 2.12",),
        decided=((TWO, "Figure 2.10"),),
    ),
    Item(
        "Figure 2.11",
        "errors do not grow; predicted deviation",
        shown=("Figure 2.11",),
        decided=((TWO, "Figure 2.11"),),
    ),
    Item(
        "Table 2.1",
        "the proposed method has the smallest error",
        shown=("Table 2.1", "Angular rate by method"),
        decided=((TWO, "Table 2.1: the weighted method"),),
    ),
    Item(
        "Table 2.1",
        "Cardou's polynomial roots err less than Parsa's method in five of six runs",
        shown=("Table 2.1",),
        decided=((TWO, "Table 2.1: polynomial roots err less"),),
        causes=((TWO, "With white 0"), (TWO, "Table 2.1: neither polynomial roots nor Parsa")),
    ),
    Item(
        "Table 2.1", "sizes of the errors", shown=("Table 2.1",), decided=((TWO, "Table 2.1: the weighted error lies"),)
    ),
    Item("Figure 2.12", "weights are near one", shown=("Figures 2.9 to 2.12",), decided=((TWO, "Figure 2.12"),)),
    Item(
        "Figure 2.13",
        "weights are nearer to one at high rates",
        shown=("Figure 2.13", "Figures 2.12 and 2.13"),
        decided=((TWO, "Figure 2.13"),),
        causes=((TWO, "The Jacobian at the polynomial roots"),),
    ),
    Item("Figures 3.1, 3.2", "sketch and drawing", because="they show no result"),
    Item("Figures 3.3, 3.7", "paths", shown=("Figure 3.3", "Figure 3.7")),
    Item("Figures 3.4, 3.8", "readings with and without noise", shown=("Figure 3.4", "Figure 3.8")),
    Item(
        "Figures 3.5, 3.9",
        "integration drifts, the tilt angle is not reliable",
        shown=("Figure 3.5", "Figure 3.9"),
        decided=((THREE, "Figure 3.5"), (THREE, "Figure 3.9")),
    ),
    Item(
        "Figures 3.6, 3.10",
        "the extended filter is accurate to within 10°",
        shown=("Figure 3.6", "Figure 3.10"),
        decided=((THREE, "planar-walk: the extended filter never"), (THREE, "infinity: the extended filter never")),
        causes=((THREE, "planar-walk: it is within 10°"), (THREE, "infinity: it is within 10°")),
    ),
    Item(
        "Figures 3.6, 3.10",
        "the complete pose is worse than the orientation alone",
        shown=("Figure 3.6", "Figure 3.10"),
        decided=((THREE, "planar-walk: the thesis' complete pose"), (THREE, "infinity: the thesis' complete pose")),
    ),
    Item("Figure 3.11", "another path", shown=("Figure 3.11",)),
    Item(
        "Figure 3.12",
        "averaging is as bad as tilt, the linear filter errs by 200°, UKF and EKF agree",
        shown=("Figure 3.12",),
        decided=((THREE, "Figure 3.12"), (THREE, "Unscented and extended")),
    ),
    Item(
        "Section 3.5",
        "the linear filter cannot capture the nonlinear relation",
        shown=("Planar methods",),
        decided=((THREE, "planar-walk: a linear filter cannot"),),
        causes=((THREE, "planar-walk: the linear filter fails by averaging"),),
    ),
    Item(
        "Figure 3.13",
        "the extended filter alone",
        shown=("Figure 3.13",),
        decided=((THREE, "planar-walk: it is within 10°"),),
    ),
    Item(
        "Figures 3.14, 3.15",
        "the complete pose estimates ω poorly",
        shown=("Figure 3.14", "Figure 3.15"),
        decided=((THREE, "planar-walk: the complete pose estimates"), (THREE, "infinity: the complete pose estimates")),
        causes=((THREE, "infinity: with H as published"), (THREE, "infinity: (3.45) is what")),
    ),
    Item("Figures 4.1 to 4.5, 4.10", "photographs and drawings", because="they show no result"),
    Item("Figures 4.6, 4.7", "imposed rates and output", shown=("Figure 4.6", "Figure 4.7")),
    Item("Figure 4.8", "output and imposed acceleration, best fit", shown=("Figure 4.8",)),
    Item(
        "Figure 4.9, (4.7)",
        "residual of the fit ±0.7 m/s²",
        shown=("Figure 4.9",),
        decided=((DEVICE, "Figure 4.9: with"),),
        causes=((DEVICE, "Figure 4.9: noise"), (DEVICE, "Figure 4.9: of that")),
    ),
    Item(
        "Table 4.1", "scales and offsets of the accelerometers", shown=("Table 4.1",), decided=((DEVICE, "Table 4.1"),)
    ),
    Item("Figures 4.11, 4.12", "rate of the table, output of the gyroscope", shown=("Figures 4.11 and 4.12",)),
    Item("Figure 4.13", "best fit of the gyroscope", shown=("Figures 4.13 and 4.14",)),
    Item(
        "Figure 4.14",
        "residual of the fit ±2.8 °/s",
        shown=("Figures 4.13 and 4.14",),
        decided=((DEVICE, "Figure 4.14: with"),),
        causes=((DEVICE, "Figure 4.14: noise"),),
    ),
    Item("Table 4.2", "scales and offsets of the gyroscope", shown=("Table 4.2",), decided=((DEVICE, "Table 4.2"),)),
    Item(
        "Figures 4.15, 4.16",
        "two places on the table",
        shown=("Figures 4.15 and 4.16",),
        decided=((DEVICE, "Figure 4.16"),),
    ),
    Item("Figures 4.17 to 4.19", "back and forth", shown=("Figures 4.17 to 4.19",), decided=((DEVICE, "Figure 4.19"),)),
    Item("Figures 4.20, 4.21", "magnetometer before and after", shown=("Figures 4.20 and 4.21",)),
    Item(
        "Appendix B",
        "(B.4) is a rotation",
        decided=((FOUR, "Appendix B: (B.4) is a rotation"),),
        causes=((FOUR, "Appendix B: (B.4) is a mirror"),),
    ),
    Item("Figures 5.1, 5.2, 5.12 to 5.17, 5.23", "block diagrams, photographs, windows", because="they show no result"),
    Item("Figures 5.3, 5.4, 5.5", "targets, profile of a move, readings", shown=("Figures 5.3 and 5.4", "Figure 5.5")),
    Item(
        "Figures 5.6, 5.7",
        "controller: errors within ±3°, tilt and Marins large",
        shown=("Figures 5.6 and 5.7",),
        decided=(
            (FIVE, "controller: proposed, first order"),
            (FIVE, "controller: tilt sensor"),
            (FIVE, "controller: Marins, σ_q = 0.01"),
        ),
        causes=((FIVE, "controller: proposed, exact rotation"), (FIVE, "controller: the first-order transition")),
    ),
    Item("Figure 5.8", "path of the controller", shown=("Figure 5.8",)),
    Item(
        "Figures 5.9, 5.10",
        "OCTA without gyroscope: errors within ±3°",
        shown=("Figures 5.9 and 5.10",),
        decided=((FIVE, "octa: proposed, exact rotation, no gyroscope"),),
        causes=((FIVE, "octa: proposed, exact rotation, with gyroscope"), (FIVE, "octa: without a gyroscope")),
    ),
    Item("Figure 5.11", "path of OCTA", shown=("Figure 5.11",)),
    Item(
        "Figures 5.18, 5.19",
        "experiment with the controller: the proposed method within ±10°",
        shown=("Figures 5.18 and 5.19", "Table 5.1"),
        decided=((TABLE_5_1, "controller, experiment: the proposed"),),
    ),
    Item(
        "Figures 5.18, 5.19",
        "Marins within ±10°; tilt sensor and Marins worse than the proposed method",
        shown=("Figures 5.18 and 5.19",),
        decided=((TABLE_5_1, "controller, experiment: Marins"), (TABLE_5_1, "controller, experiment: the tilt")),
    ),
    Item(
        "Figures 5.18, 5.19",
        "integration is lost after 20 s",
        shown=("Figures 5.18 and 5.19",),
        decided=((TABLE_5_1, "controller, experiment: integration"),),
        causes=((TABLE_5_1, "controller: integration is lost with"),),
    ),
    Item(
        "Figures 5.20, 5.21",
        "experiment with OCTA: the proposed method within ±5°",
        shown=("Figures 5.20 and 5.21",),
        decided=((TABLE_5_1, "octa, experiment: the proposed"),),
        causes=((TABLE_5_1, "octa, with a gyroscope"),),
    ),
    Item(
        "Figures 5.20, 5.21",
        "tilt sensor and Marins worse than the proposed method, integration lost at once",
        shown=("Figures 5.20 and 5.21",),
        decided=(
            (TABLE_5_1, "octa, experiment: Marins is worse"),
            (TABLE_5_1, "octa, experiment: the tilt"),
            (TABLE_5_1, "octa, experiment: integration"),
        ),
    ),
    Item(
        "Table 5.1",
        "controller and OCTA are similarly accurate",
        shown=("Table 5.1", "Figures 5.6 to 5.10 and Table 5.1"),
        decided=((TABLE_5_1, "OCTA without a gyroscope"),),
        causes=((TABLE_5_1, "OCTA with a gyroscope is as accurate"),),
    ),
    Item(
        "Figure 5.22, (5.63)",
        "errors lie in a cone",
        shown=("Figure 5.22: errors", "Figure 5.22: share"),
        decided=((BEYOND, "(5.63): errors of pitch of the proposed"),),
    ),
    Item(
        "not in the thesis",
        "the cone bounds the tilt sensor's filter too",
        shown=("Figure 5.22: share",),
        decided=((BEYOND, "(5.63) as arcsine bounds the tilt"),),
        causes=((BEYOND, "(5.63) as arcsine bounds a single"),),
    ),
    Item(
        "not in the thesis",
        "no error lies below its bound",
        shown=("Bound of the orientation",),
        decided=tuple(("Bound of the orientation: what", device) for device in ("controller", "octa")),
        causes=(("Bound of the orientation: what", "Were the hand's acceleration known"),),
    ),
    Item(
        "Figure 5.24, (5.66), (5.67)",
        "the virtual controller follows, its position does not drift",
        shown=("Figure 5.24: true and virtual", "Figure 5.24: position"),
        decided=((VIRTUAL, ""),),
    ),
)
"""In the thesis' order."""
