"""Tables, figures and statements of the whole-body paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import BOTH, INDOOR, OUTDOOR, Item, claims_in

BUMPS, EXACT, SPEED = map(claims_in, ("Figure 11: what holds", "Exact rides: what", "Speed sweep: what"))

ITEMS = (
    Item("Figures 1 to 5", "pictures, frames, constraints and block diagram", because="they show no result"),
    Item("Table I", "specifications of the inertial sensors", "Table I: inertial sensors"),
    Item("Table II", "parameters of the model", "Table II: parameters"),
    Item(
        "(3), (9), C7, C8",
        "equations as published",
        "Variants, indoor",
        INDOOR("The published forms are as good in φ", "The published forms are as good in β"),
        corrected=INDOOR("Corrected (3), (9), C7, C8"),
    ),
    Item(
        "Figure 6",
        "the filter follows, integration drifts after 20 s",
        "Figure 6: angles, indoor",
        INDOOR("Figure 6"),
        causes=INDOOR("Where the seat carries the trunk integrated"),
    ),
    Item(
        "Figure 7",
        "poses in space match the truth",
        ("Figure 7: rider and bicycle in space, indoor", "Figure 7: 4 s of the same ride as a film, indoor"),
        INDOOR("Figure 7"),
        causes=INDOOR("Where the seat carries the trunk every joint"),
    ),
    Item(
        "Table III",
        "errors of five riders, indoors and outdoors",
        ("Table III, indoor", "Table III, outdoor", "Skill, indoor", "Skill, outdoor"),
        BOTH("Every error is at or below"),
        causes=BOTH("Where the seat carries the trunk, every error"),
    ),
    Item(
        "Figure 8",
        "errors are around zero, their deviations do not grow",
        ("Figure 8: errors over time, indoor", "Figure 8: errors over time, outdoor"),
        BOTH("Figure 8"),
        causes=BOTH("Where the seat carries the trunk the mean"),
    ),
    Item(
        "Figure 9",
        "without C1 or C3 the errors of φr1 grow",
        ("Figure 9: held posture", "Figure 9: riding"),
        EXACT("Figure 9, held: no C1, C5", "Figure 9, indoor: no C1, C5", "Figure 9, indoor: no C3, C7"),
        causes=EXACT("Figure 9, held: no C1, C5"),
    ),
    Item(
        "Figure 10", "residual of C2 within ±0.05", "Figure 10: residuals of the right arm, indoor", BOTH("Figure 10")
    ),
    Item(
        "Figure 11",
        "bumps do not disturb θ2 significantly",
        ("Figure 11: accelerometer", "Figure 11: two bumps"),
        BUMPS("θ2"),
    ),
    Item(
        "Section V",
        "robust against wrong initial values",
        "Wrong initial values",
        EXACT("Robust against wrong initial values"),
        causes=EXACT("Of the wrong starts"),
    ),
    Item(
        "Section V",
        "insensitive to speed",
        ("Speed sweep on exact rides", "Errors by speed, outdoor"),
        (
            *SPEED("Insensitive to speed: no error changes"),
            *OUTDOOR("Insensitive to speed: no error changes"),
        ),
        causes=SPEED("Insensitive to speed: no error changes"),
    ),
    Item("Section V", "yaw cannot be estimated", "Figure 6: angles, indoor", BOTH("Yaw is not observed")),
    Item(
        "not in the paper",
        "every angle is worth estimating (better than the mean of the ride)",
        ("Skill, indoor", "Skill, outdoor"),
        BOTH("Every angle is estimated better"),
        causes=BOTH("Where the seat carries the trunk every angle"),
    ),
    Item(
        "not in the paper",
        "the elbow by C4 is half as wrong as from the encoders alone",
        ("Skill, indoor", "Variants, indoor"),
        BOTH("Elbow: the filter halves"),
        causes=BOTH("Where the seat carries the trunk the filter halves"),
    ),
    Item(
        "not in the paper",
        "the knee by C8 is that of the crank alone",
        "Variants, indoor",
        BOTH("Knee: the encoders alone"),
    ),
    Item(
        "not in the paper",
        "bumps do not disturb the other angles of trunk and roll (within 5°)",
        "Figure 11: two bumps",
        BUMPS("Without its guard"),
        causes=BUMPS("The filter with its guard", "The guard halves"),
    ),
    Item(
        "not in the paper",
        "NEES is right where the filter's assumptions hold",
        "Consistency, indoor",
        EXACT("Where the model is exact"),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        ("Skill, indoor", "Skill, outdoor"),
        BOTH("No error lies below its bound"),
    ),
    Item(
        "not in the paper",
        "no error of an exact ride lies below the bound for the filter's own noises",
        "Posterior Cramér–Rao bound",
        EXACT("filter's noises: no error lies below", "sensors' noises: no error lies below"),
        causes=EXACT("Where the model is exact"),
    ),
)
"""In the paper's order."""
