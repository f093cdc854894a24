"""Tables, figures and statements of the thesis on the game controller, and what of the study answers each."""

from __future__ import annotations

from ..coverage import Item, claims_in

TWO, THREE, FOUR, FIVE = map(
    claims_in, ("Chapter 2: what", "Chapter 3: what", "Chapter 4 and appendix B", "Chapter 5: what")
)
DEVICE, BEYOND = map(claims_in, ("Chapter 4, the thesis' device", "Chapter 5, beyond"))
TABLE_5_1, VIRTUAL = map(claims_in, ("Table 5.1: what", "Virtual controller: what"))
BOUND = claims_in("Bound of the orientation: what")

ITEMS = (
    Item("Figures 2.2 to 2.4", "bias and noise of real accelerometers", because="they show single real sensors"),
    Item("Figures 1.x, 2.1, 2.5 to 2.8", "photographs, drawings, flow chart", because="they show no result"),
    Item("Figure 2.9", "integration is useless after instants", "Figures 2.9 to 2.12", TWO("Figure 2.9")),
    Item(
        "Figure 2.10",
        "polynomial roots take the wrong root, the proposed method does not",
        "Figures 2.9 to 2.12",
        TWO("Figure 2.10"),
    ),
    Item("Figure 2.11", "errors do not grow; predicted deviation", "Figure 2.11", TWO("Figure 2.11")),
    Item(
        "Table 2.1",
        "the proposed method has the smallest error",
        ("Table 2.1", "Angular rate by method"),
        TWO("Table 2.1: the weighted method"),
    ),
    Item(
        "Table 2.1",
        "Cardou's polynomial roots err less than Parsa's method in five of six runs",
        "Table 2.1",
        TWO("Table 2.1: polynomial roots err less"),
        causes=TWO("With white 0", "Table 2.1: neither polynomial roots nor Parsa"),
    ),
    Item("Table 2.1", "sizes of the errors", "Table 2.1", TWO("Table 2.1: the weighted error lies")),
    Item("Figure 2.12", "weights are near one", "Figures 2.9 to 2.12", TWO("Figure 2.12")),
    Item(
        "Figure 2.13",
        "weights are nearer to one at high rates",
        ("Figure 2.13", "Figures 2.12 and 2.13"),
        TWO("Figure 2.13"),
        causes=TWO("The Jacobian at the polynomial roots"),
    ),
    Item("Figures 3.1, 3.2", "sketch and drawing", because="they show no result"),
    Item("Figures 3.3, 3.7", "paths", ("Figure 3.3", "Figure 3.7")),
    Item("Figures 3.4, 3.8", "readings with and without noise", ("Figure 3.4", "Figure 3.8")),
    Item(
        "Figures 3.5, 3.9",
        "integration drifts, the tilt angle is not reliable",
        ("Figure 3.5", "Figure 3.9"),
        THREE("Figure 3.5", "Figure 3.9"),
    ),
    Item(
        "Figures 3.6, 3.10",
        "the extended filter is accurate to within 10°",
        ("Figure 3.6", "Figure 3.10"),
        THREE("planar-walk: the extended filter never", "infinity: the extended filter never"),
        causes=THREE("planar-walk: it is within 10°", "infinity: it is within 10°"),
    ),
    Item(
        "Figures 3.6, 3.10",
        "the complete pose is worse than the orientation alone",
        ("Figure 3.6", "Figure 3.10"),
        THREE("planar-walk: the thesis' complete pose", "infinity: the thesis' complete pose"),
    ),
    Item("Figure 3.11", "another path", "Figure 3.11"),
    Item(
        "Figure 3.12",
        "averaging is as bad as tilt, the linear filter errs by 200°, UKF and EKF agree",
        "Figure 3.12",
        THREE("Figure 3.12", "Unscented and extended"),
    ),
    Item(
        "Section 3.5",
        "the linear filter cannot capture the nonlinear relation",
        "Planar methods",
        THREE("planar-walk: a linear filter cannot"),
        causes=THREE("planar-walk: the linear filter fails by averaging"),
    ),
    Item("Figure 3.13", "the extended filter alone", "Figure 3.13", THREE("planar-walk: it is within 10°")),
    Item(
        "Figures 3.14, 3.15",
        "the complete pose estimates ω poorly",
        ("Figure 3.14", "Figure 3.15"),
        THREE("planar-walk: the complete pose estimates", "infinity: the complete pose estimates"),
        causes=THREE("infinity: with H as published", "infinity: (3.45) is what"),
    ),
    Item("Figures 4.1 to 4.5, 4.10", "photographs and drawings", because="they show no result"),
    Item("Figures 4.6, 4.7", "imposed rates and output", ("Figure 4.6", "Figure 4.7")),
    Item("Figure 4.8", "output and imposed acceleration, best fit", "Figure 4.8"),
    Item(
        "Figure 4.9, (4.7)",
        "residual of the fit ±0.7 m/s²",
        "Figure 4.9",
        DEVICE("Figure 4.9: with"),
        causes=DEVICE("Figure 4.9: noise", "Figure 4.9: of that"),
    ),
    Item("Table 4.1", "scales and offsets of the accelerometers", "Table 4.1", DEVICE("Table 4.1")),
    Item("Figures 4.11, 4.12", "rate of the table, output of the gyroscope", "Figures 4.11 and 4.12"),
    Item("Figure 4.13", "best fit of the gyroscope", "Figures 4.13 and 4.14"),
    Item(
        "Figure 4.14",
        "residual of the fit ±2.8 °/s",
        "Figures 4.13 and 4.14",
        DEVICE("Figure 4.14: with"),
        causes=DEVICE("Figure 4.14: noise"),
    ),
    Item("Table 4.2", "scales and offsets of the gyroscope", "Table 4.2", DEVICE("Table 4.2")),
    Item("Figures 4.15, 4.16", "two places on the table", "Figures 4.15 and 4.16", DEVICE("Figure 4.16")),
    Item("Figures 4.17 to 4.19", "back and forth", "Figures 4.17 to 4.19", DEVICE("Figure 4.19")),
    Item("Figures 4.20, 4.21", "magnetometer before and after", "Figures 4.20 and 4.21"),
    Item(
        "Appendix B",
        "(B.4) is a rotation",
        decided=FOUR("Appendix B: (B.4) is a rotation"),
        causes=FOUR("Appendix B: (B.4) is a mirror"),
    ),
    Item("Figures 5.1, 5.2, 5.12 to 5.17, 5.23", "block diagrams, photographs, windows", because="they show no result"),
    Item("Figures 5.3, 5.4, 5.5", "targets, profile of a move, readings", ("Figures 5.3 and 5.4", "Figure 5.5")),
    Item(
        "Figures 5.6, 5.7",
        "controller: errors within ±3°, tilt and Marins large",
        "Figures 5.6 and 5.7",
        FIVE("controller: proposed, first order", "controller: tilt sensor", "controller: Marins, σ_q = 0.01"),
        causes=FIVE("controller: proposed, exact rotation", "controller: the first-order transition"),
    ),
    Item("Figure 5.8", "path of the controller", "Figure 5.8"),
    Item(
        "Figures 5.9, 5.10",
        "OCTA without gyroscope: errors within ±3°",
        "Figures 5.9 and 5.10",
        FIVE("octa: proposed, exact rotation, no gyroscope"),
        causes=FIVE("octa: proposed, exact rotation, with gyroscope", "octa: without a gyroscope"),
    ),
    Item("Figure 5.11", "path of OCTA", "Figure 5.11"),
    Item(
        "Figures 5.18, 5.19",
        "experiment with the controller: the proposed method within ±10°",
        ("Figures 5.18 and 5.19", "Table 5.1"),
        TABLE_5_1("controller, experiment: the proposed"),
    ),
    Item(
        "Figures 5.18, 5.19",
        "Marins within ±10°; tilt sensor and Marins worse than the proposed method",
        "Figures 5.18 and 5.19",
        TABLE_5_1("controller, experiment: Marins", "controller, experiment: the tilt"),
    ),
    Item(
        "Figures 5.18, 5.19",
        "integration is lost after 20 s",
        "Figures 5.18 and 5.19",
        TABLE_5_1("controller, experiment: integration"),
        causes=TABLE_5_1("controller: integration is lost with"),
    ),
    Item(
        "Figures 5.20, 5.21",
        "experiment with OCTA: the proposed method within ±5°",
        "Figures 5.20 and 5.21",
        TABLE_5_1("octa, experiment: the proposed"),
        causes=TABLE_5_1("octa, with a gyroscope"),
    ),
    Item(
        "Figures 5.20, 5.21",
        "tilt sensor and Marins worse than the proposed method, integration lost at once",
        "Figures 5.20 and 5.21",
        TABLE_5_1("octa, experiment: Marins is worse", "octa, experiment: the tilt", "octa, experiment: integration"),
    ),
    Item(
        "Table 5.1",
        "controller and OCTA are similarly accurate",
        ("Table 5.1", "Figures 5.6 to 5.10 and Table 5.1"),
        TABLE_5_1("OCTA without a gyroscope"),
        causes=TABLE_5_1("OCTA with a gyroscope is as accurate"),
    ),
    Item(
        "Figure 5.22, (5.63)",
        "errors lie in a cone",
        ("Figure 5.22: errors", "Figure 5.22: share"),
        BEYOND("(5.63): errors of pitch of the proposed"),
    ),
    Item(
        "not in the thesis",
        "the cone bounds the tilt sensor's filter too",
        "Figure 5.22: share",
        BEYOND("(5.63) as arcsine bounds the tilt"),
        causes=BEYOND("(5.63) as arcsine bounds a single"),
    ),
    Item(
        "not in the thesis",
        "no error lies below its bound",
        "Bound of the orientation",
        BOUND("controller", "octa"),
        causes=BOUND("Were the hand's acceleration known"),
    ),
    Item(
        "Figure 5.24, (5.66), (5.67)",
        "the virtual controller follows, its position does not drift",
        ("Figure 5.24: true and virtual", "Figure 5.24: position"),
        VIRTUAL(""),
    ),
)
"""In the thesis' order."""
