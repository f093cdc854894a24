"""Tables, figures and statements of the force/inertial paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import INDOOR, OUTDOOR, Item, both

EXACT, BIASES, LIVELY = "Exact synthetic data: what", "Observability: what holds", "Figure 7: what"


ITEMS = (
    Item("Figures 1 to 5", "pictures, frames, forces and block diagram", because="they show no result"),
    Item(
        "(5) to (8)",
        "attitude accelerations from accelerometers",
        shown=("Exact synthetic data, RMS",),
        decided=((EXACT, "indoor: the published (7), (8) are as good"),),
        corrected=((EXACT, "indoor: corrected (7), (8) from accelerometers"),),
    ),
    Item(
        "(13)",
        "the seat force reads the roll",
        shown=("Exact synthetic data, RMS",),
        decided=((EXACT, "indoor: (13) as published is as good"),),
        corrected=((EXACT, "indoor: the apparent vertical in (13)"),),
    ),
    Item(
        "(14)",
        "offsets are measured and eliminated",
        shown=("Offsets of (14)",),
        decided=(("Offsets of (14): what", "(14)"),),
    ),
    Item(
        "below (14)",
        "biases of both gyroscopes are not observable",
        shown=("Observability of gyroscope biases",),
        decided=((BIASES, "indoor: the biases of both"), (BIASES, "outdoor: the biases of both")),
    ),
    Item("Table I", "parameters of rider, bicycle and noise model", shown=("Table I: parameters",)),
    Item(
        "Figure 6",
        "the filter follows, strapdown integration diverges after 50 s",
        shown=("Figure 6: angles of one ride, indoor", "Skill, indoor_circle"),
        decided=((INDOOR, "After 50 s integration is more than twice as wrong"),),
    ),
    Item(
        "Figure 7",
        "another subject, who moves the trunk arbitrarily",
        shown=("Figure 7",),
        decided=((LIVELY, "Figure 7"),),
        causes=((LIVELY, "Exact sensors leave"),),
    ),
    Item(
        "Table II",
        "errors of five riders, indoors and outdoors",
        shown=("Table II, indoor_circle", "Table II, outdoor", "Skill, outdoor"),
        decided=both("Every error is at or below"),
    ),
    Item(
        "Table II",
        "the bias model improves the estimates a little",
        shown=("Table II, indoor_circle",),
        decided=((INDOOR, "The bias model lowers the mean error"),),
        causes=((EXACT, "indoor: where forces err by noise"),),
    ),
    Item(
        "Table II",
        "outdoors the bias model's improvement is not significant",
        shown=("Table II, outdoor",),
        decided=((OUTDOOR, "The bias model changes no error by more than its standard deviation"),),
        causes=((OUTDOOR, "Zeros make more than a quarter"),),
    ),
    Item(
        "Table II",
        "φ_b has the least error",
        shown=("Table II, indoor_circle",),
        decided=both("φ_b has the smallest error"),
    ),
    Item(
        "Table II",
        "φ has the largest error",
        shown=("Table II, indoor_circle",),
        decided=both("φ has the largest error"),
        causes=both("With exact sensors φ has the largest error"),
    ),
    Item(
        "Figure 8",
        "errors are around zero and do not grow",
        shown=("Figure 8: errors over time, indoor_circle", "Figure 8: errors over time, outdoor"),
        decided=both("Figure 8"),
        causes=both("Exact sensors leave"),
    ),
    Item("Figure 9", "curvature of the spine", because="the simulated trunk is one rigid body: its curvature is zero"),
    Item(
        "Figure 10",
        "φ_h that starts more than 30° wrong converges within 6 s",
        shown=("Figure 10: wrong starts, indoor_circle", "Convergence from a wrong start"),
        decided=both("φ_h that starts 35° off"),
        causes=both("Nine of ten such starts"),
    ),
    Item(
        "Figure 11",
        "the dynamic torque matches what is read",
        shown=("Figure 11: torques over time, indoor_circle", "Torques at the true pose"),
        decided=both("The dynamic torque is nearer"),
        causes=both("In most rides the dynamic torque"),
    ),
    Item(
        "Figure 11",
        "the static torque underestimates",
        shown=("Figure 11: torques over time, indoor_circle",),
        decided=both("The static torque underestimates"),
    ),
    Item(
        "Section IV",
        "yaw cannot be estimated",
        shown=("Figure 6: angles of one ride, indoor",),
        decided=both("Yaw is not observed"),
    ),
    Item(
        "Section IV",
        "riders who stand on the pedals are not covered",
        shown=("Variants, indoor_circle",),
        decided=both("Who stands is not covered"),
    ),
    Item(
        "not in the paper",
        "the trunk of every rider is followed better than by the best constant",
        shown=("Skill, indoor_circle",),
        decided=((INDOOR, "The filter follows every rider"),),
        causes=((INDOOR, "Where it does so worst"), (INDOOR, "With exact sensors it does not either")),
    ),
    Item(
        "not in the paper",
        "the covariance is right where the model is exact",
        shown=("Consistency where the model is exact",),
        decided=(("Consistency where", "Where the model"),),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        shown=("Skill, indoor_circle", "Skill, outdoor"),
        decided=both("No error lies below its bound"),
    ),
)
"""In the paper's order."""
