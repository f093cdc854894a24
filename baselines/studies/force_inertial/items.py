"""Tables, figures and statements of the force/inertial paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import BOTH, INDOOR, OUTDOOR, Item, claims_in

EXACT, BIASES, LIVELY = map(claims_in, ("Exact synthetic data: what", "Observability: what holds", "Figure 7: what"))

ITEMS = (
    Item("Figures 1 to 5", "pictures, frames, forces and block diagram", because="they show no result"),
    Item(
        "(5) to (8)",
        "attitude accelerations from accelerometers",
        "Exact synthetic data, RMS",
        EXACT("indoor: the published (7), (8) are as good"),
        corrected=EXACT("indoor: corrected (7), (8) from accelerometers"),
    ),
    Item(
        "(13)",
        "the seat force reads the roll",
        "Exact synthetic data, RMS",
        EXACT("indoor: (13) as published is as good"),
        corrected=EXACT("indoor: the apparent vertical in (13)"),
    ),
    Item("(14)", "offsets are measured and eliminated", "Offsets of (14)", claims_in("Offsets of (14): what")("(14)")),
    Item(
        "below (14)",
        "biases of both gyroscopes are not observable",
        "Observability of gyroscope biases",
        BIASES("indoor: the biases of both", "outdoor: the biases of both"),
    ),
    Item("Table I", "parameters of rider, bicycle and noise model", "Table I: parameters"),
    Item(
        "Figure 6",
        "the filter follows, strapdown integration diverges after 50 s",
        ("Figure 6: angles of one ride, indoor", "Skill, indoor_circle"),
        INDOOR("After 50 s integration is more than twice as wrong"),
    ),
    Item(
        "Figure 7",
        "another subject, who moves the trunk arbitrarily",
        "Figure 7",
        LIVELY("Figure 7"),
        causes=LIVELY("Exact sensors leave"),
    ),
    Item(
        "Table II",
        "errors of five riders, indoors and outdoors",
        ("Table II, indoor_circle", "Table II, outdoor", "Skill, outdoor"),
        BOTH("Every error is at or below"),
    ),
    Item(
        "Table II",
        "the bias model improves the estimates a little",
        "Table II, indoor_circle",
        INDOOR("The bias model lowers the mean error"),
        causes=EXACT("indoor: where forces err by noise"),
    ),
    Item(
        "Table II",
        "outdoors the bias model's improvement is not significant",
        "Table II, outdoor",
        OUTDOOR("The bias model changes no error by more than its standard deviation"),
        causes=OUTDOOR("Zeros make more than a quarter"),
    ),
    Item("Table II", "φ_b has the least error", "Table II, indoor_circle", BOTH("φ_b has the smallest error")),
    Item(
        "Table II",
        "φ has the largest error",
        "Table II, indoor_circle",
        BOTH("φ has the largest error"),
        causes=BOTH("With exact sensors φ has the largest error"),
    ),
    Item(
        "Figure 8",
        "errors are around zero and do not grow",
        ("Figure 8: errors over time, indoor_circle", "Figure 8: errors over time, outdoor"),
        BOTH("Figure 8"),
        causes=BOTH("Exact sensors leave"),
    ),
    Item("Figure 9", "curvature of the spine", because="the simulated trunk is one rigid body: its curvature is zero"),
    Item(
        "Figure 10",
        "φ_h that starts more than 30° wrong converges within 6 s",
        ("Figure 10: wrong starts, indoor_circle", "Convergence from a wrong start"),
        BOTH("φ_h that starts 35° off"),
        causes=BOTH("Nine of ten such starts"),
    ),
    Item(
        "Figure 11",
        "the dynamic torque matches what is read",
        ("Figure 11: torques over time, indoor_circle", "Torques at the true pose"),
        BOTH("The dynamic torque is nearer"),
        causes=BOTH("In most rides the dynamic torque"),
    ),
    Item(
        "Figure 11",
        "the static torque underestimates",
        "Figure 11: torques over time, indoor_circle",
        BOTH("The static torque underestimates"),
    ),
    Item("Section IV", "yaw cannot be estimated", "Figure 6: angles of one ride, indoor", BOTH("Yaw is not observed")),
    Item(
        "Section IV",
        "riders who stand on the pedals are not covered",
        "Variants, indoor_circle",
        BOTH("Who stands is not covered"),
    ),
    Item(
        "not in the paper",
        "the trunk of every rider is followed better than by the best constant",
        "Skill, indoor_circle",
        INDOOR("The filter follows every rider"),
        causes=INDOOR("Where it does so worst", "With exact sensors it does not either"),
    ),
    Item(
        "not in the paper",
        "the covariance is right where the model is exact",
        "Consistency where the model is exact",
        claims_in("Consistency where")("Where the model"),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        ("Skill, indoor_circle", "Skill, outdoor"),
        BOTH("No error lies below its bound"),
    ),
)
"""In the paper's order."""
