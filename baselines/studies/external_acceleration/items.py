"""Published values, tables, figures and statements of the external-acceleration paper, and what answers each.

J. K. Lee, E. J. Park, S. N. Robinovitch, 2012.
"""

from __future__ import annotations

from ..coverage import Item, claims_in

LEVELS = {"A": (0.40, 1.83), "B": (3.06, 16.71), "C": (6.29, 37.22)}
"""Section III-B: test → mean and largest size of the reference acceleration, m/s²."""

TABLE_I = {
    ("A", 1): (1.84, 1.39, 0.23, 0.26, 0.15, 0.27),
    ("A", 2): (1.86, 1.40, 0.23, 0.27, 0.15, 0.28),
    ("A", 3): (1.86, 1.39, 0.23, 0.27, 0.15, 0.27),
    ("B", 1): (1.77, 0.92, 0.15, 0.17, 0.24, 0.23),
    ("B", 2): (18.21, 10.88, 1.71, 1.86, 2.31, 2.01),
    ("B", 3): (1.15, 0.76, 0.12, 0.11, 0.16, 0.15),
    ("C", 1): (5.28, 4.00, 0.55, 0.53, 0.69, 0.52),
    ("C", 2): (17.08, 6.78, 0.98, 2.09, 1.41, 1.77),
    ("C", 3): (7.41, 5.19, 0.81, 0.91, 0.71, 0.81),
}
"""(Test, mode) → root mean square errors of roll, pitch (deg), a_x, a_y, a_z and ‖a‖ (m/s²)."""

TABLE_II = {
    0.001: ((1.86, 1.40), (17.98, 10.80), (13.02, 7.43)),
    0.01: ((1.86, 1.40), (9.03, 6.28), (6.92, 8.87)),
    0.05: ((1.85, 1.40), (2.86, 1.76), (5.79, 5.42)),
    0.1: ((1.84, 1.39), (1.77, 0.92), (5.28, 4.00)),
    0.3: ((1.85, 1.35), (1.11, 0.74), (6.43, 4.76)),
    0.5: ((1.99, 1.38), (1.05, 0.82), (9.40, 7.09)),
    0.7: ((17.72, 10.87), (1.09, 1.02), (11.93, 8.54)),
    1.0: ((44.13, 19.96), (1.20, 1.53), (16.25, 10.34)),
}
"""c_a of mode 1 → roll and pitch error of tests A, B and C, deg."""

TABLE_III = {
    (0.05, 1): ((1.89, 1.34), (1.29, 0.77), (8.46, 4.11)),
    (0.1, 2): ((1.82, 1.38), (1.28, 0.78), (8.50, 4.04)),
    (0.2, 4): ((1.86, 1.39), (1.15, 0.76), (7.41, 5.19)),
    (0.5, 7): ((1.86, 1.40), (3.59, 1.67), (5.85, 3.48)),
    (1.0, 10): ((1.86, 1.40), (9.13, 7.45), (5.57, 3.47)),
}
"""(ε_A in m/s², n) of mode 3 → roll and pitch error of tests A, B and C, deg."""


SAYS, MOTION = claims_in("What the paper says"), claims_in("Levels of the tests: what holds")

ITEMS = (
    Item("Figure 1", "frames and sensor", because="it shows no result"),
    Item("Section III-B", "levels of acceleration of tests A, B and C", "Levels of the tests", MOTION("Test")),
    Item("Table I, test A", "all modes are the same", ("Table I", "Skill: inclination"), SAYS("Test A: all modes")),
    Item("Table I, tests B and C", "mode 2 fails", "Table I", SAYS("Mode 2 fails in test B", "Mode 2 fails in test C")),
    Item(
        "Table I, test B",
        "mode 3 is slightly better than mode 1",
        "Table I",
        SAYS("Mode 3 is better than mode 1 in test B"),
        causes=SAYS("In some trials of test B"),
    ),
    Item(
        "Table I, test C",
        "mode 1 is better than mode 3",
        "Table I",
        SAYS("Mode 1 is better than mode 3 in test C"),
        causes=SAYS("With the exact rotation mode 1 is better than mode 3"),
    ),
    Item(
        "Table II", "a properly chosen c_a works in most scenarios", "Table II: mode 1", SAYS("A properly chosen c_a")
    ),
    Item(
        "Table II",
        "the effect of c_a depends on the test: large ones harm in test A and help in test B",
        ("Table II: mode 1", "Table II, test A nearly at rest"),
        SAYS("The best c_a depends", "A large c_a harms", "In test B it is the other"),
    ),
    Item(
        "Table II, test A",
        "c_a up to 0.3 hardly matters, 0.7 loses the vertical",
        "Table II, test A nearly at rest",
        SAYS("Nearly at rest"),
    ),
    Item("Table III", "mode 3 is sensitive to its threshold", "Table III", SAYS("Mode 3 is sensitive")),
    Item("Section IV", "errors grow in prolonged acceleration", "Figure 5", SAYS("Errors grow")),
    Item("(30)", "mode 3 needs n + 1 quiet samples before it corrects", decided=SAYS("(30)")),
    Item("Figure 2", "test A: errors of modes 1 and 2", "Figure 2"),
    Item("Figure 3", "test B: external acceleration and accelerometer", "Figure 3"),
    Item("Figure 4", "test B: attitude and acceleration of the three modes", "Figure 4"),
    Item("Figure 5", "test C: errors of the external acceleration", "Figure 5"),
    Item("Figure 6", "test C: errors of mode 1", "Figure 6"),
    Item("Figure 7", "roll of tests A and B against c_a", "Figure 7"),
    Item(
        "Section IV",
        "the estimated external acceleration is accurate",
        "External acceleration and truth",
        SAYS("Test B: the external acceleration", "Test C: the external acceleration"),
    ),
    Item(
        "not in the paper",
        "the filter beats what needs no filter",
        "Skill: inclination",
        SAYS("Test A: mode 1 beats", "Test B: mode 1 beats", "Test C: mode 1 beats"),
        causes=SAYS("Over 120 s"),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        "Skill: inclination",
        SAYS("Test A: mode 1 does not", "Test B: mode 1 does not", "Test C: mode 1 does not"),
    ),
    Item(
        "Tables I to III",
        "single numbers of the paper",
        because="its trials were moved by hand; level, order and shape can be met, no number",
    ),
)
"""In the paper's order."""
