"""Tables, figures and statements of the external-acceleration paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import Item, claims_in

SAYS, LEVELS = claims_in("What the paper says"), claims_in("Levels of the tests: what holds")

ITEMS = (
    Item("Figure 1", "frames and sensor", because="it shows no result"),
    Item("Section III-B", "levels of acceleration of tests A, B and C", "Levels of the tests", LEVELS("Test")),
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
