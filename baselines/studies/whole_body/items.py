"""Tables, figures and statements of the whole-body paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import INDOOR, OUTDOOR, Item, both

BUMPS, EXACT = "Figure 11: what holds", "Exact rides: what"


ITEMS = (
    Item("Figures 1 to 5", "pictures, frames, constraints and block diagram", because="they show no result"),
    Item("Table I", "specifications of the inertial sensors", shown=("Table I: inertial sensors",)),
    Item("Table II", "parameters of the model", shown=("Table II: parameters",)),
    Item(
        "(3), (9), C7, C8",
        "equations as published",
        shown=("Variants, indoor",),
        decided=((INDOOR, "The published forms are as good in φ"), (INDOOR, "The published forms are as good in β")),
        corrected=((INDOOR, "Corrected (3), (9), C7, C8"),),
    ),
    Item(
        "Figure 6",
        "the filter follows, integration drifts after 20 s",
        shown=("Figure 6: angles, indoor",),
        decided=((INDOOR, "Figure 6"),),
        causes=((INDOOR, "Where the seat carries the trunk integrated"),),
    ),
    Item(
        "Figure 7",
        "poses in space match the truth",
        shown=("Figure 7: rider and bicycle in space, indoor", "Figure 7: 4 s of the same ride as a film, indoor"),
        decided=((INDOOR, "Figure 7"),),
        causes=((INDOOR, "Where the seat carries the trunk every joint"),),
    ),
    Item(
        "Table III",
        "errors of five riders, indoors and outdoors",
        shown=("Table III, indoor", "Table III, outdoor", "Skill, indoor", "Skill, outdoor"),
        decided=both("Every error is at or below"),
        causes=both("Where the seat carries the trunk, every error"),
    ),
    Item(
        "Figure 8",
        "errors are around zero, their deviations do not grow",
        shown=("Figure 8: errors over time, indoor", "Figure 8: errors over time, outdoor"),
        decided=both("Figure 8"),
        causes=both("Where the seat carries the trunk the mean"),
    ),
    Item(
        "Figure 9",
        "without C1 or C3 the errors of φr1 grow",
        shown=("Figure 9: held posture", "Figure 9: riding"),
        decided=(
            (EXACT, "Figure 9, held: no C1, C5"),
            (EXACT, "Figure 9, indoor: no C1, C5"),
            (EXACT, "Figure 9, indoor: no C3, C7"),
        ),
        causes=((EXACT, "Figure 9, held: no C1, C5"),),
    ),
    Item(
        "Figure 10",
        "residual of C2 within ±0.05",
        shown=("Figure 10: residuals of the right arm, indoor",),
        decided=both("Figure 10"),
    ),
    Item(
        "Figure 11",
        "bumps do not disturb θ2 significantly",
        shown=("Figure 11: accelerometer", "Figure 11: two bumps"),
        decided=((BUMPS, "θ2"),),
    ),
    Item(
        "Section V",
        "robust against wrong initial values",
        shown=("Wrong initial values",),
        decided=((EXACT, "Robust against wrong initial values"),),
        causes=((EXACT, "Of the wrong starts"),),
    ),
    Item(
        "Section V",
        "insensitive to speed",
        shown=("Speed sweep on exact rides", "Errors by speed, outdoor"),
        decided=(
            ("Speed sweep: what", "Insensitive to speed: no error changes"),
            (OUTDOOR, "Insensitive to speed: no error changes"),
        ),
        causes=(("Speed sweep: what", "Insensitive to speed: no error changes"),),
    ),
    Item(
        "Section V",
        "yaw cannot be estimated",
        shown=("Figure 6: angles, indoor",),
        decided=both("Yaw is not observed"),
    ),
    Item(
        "not in the paper",
        "every angle is worth estimating (better than the mean of the ride)",
        shown=("Skill, indoor", "Skill, outdoor"),
        decided=both("Every angle is estimated better"),
        causes=both("Where the seat carries the trunk every angle"),
    ),
    Item(
        "not in the paper",
        "the elbow by C4 is half as wrong as from the encoders alone",
        shown=("Skill, indoor", "Variants, indoor"),
        decided=both("Elbow: the filter halves"),
        causes=both("Where the seat carries the trunk the filter halves"),
    ),
    Item(
        "not in the paper",
        "the knee by C8 is that of the crank alone",
        shown=("Variants, indoor",),
        decided=both("Knee: the encoders alone"),
    ),
    Item(
        "not in the paper",
        "bumps do not disturb the other angles of trunk and roll (within 5°)",
        shown=("Figure 11: two bumps",),
        decided=((BUMPS, "Without its guard"),),
        causes=((BUMPS, "The filter with its guard"), (BUMPS, "The guard halves")),
    ),
    Item(
        "not in the paper",
        "NEES is right where the filter's assumptions hold",
        shown=("Consistency, indoor",),
        decided=((EXACT, "Where the model is exact"),),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        shown=("Skill, indoor", "Skill, outdoor"),
        decided=both("No error lies below its bound"),
    ),
    Item(
        "not in the paper",
        "no error of an exact ride lies below the bound for the filter's own noises",
        shown=("Posterior Cramér–Rao bound",),
        decided=((EXACT, "filter's noises: no error lies below"), (EXACT, "sensors' noises: no error lies below")),
        causes=((EXACT, "Where the model is exact"),),
    ),
)
"""In the paper's order."""
