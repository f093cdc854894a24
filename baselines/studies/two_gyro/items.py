"""Tables, figures and statements of the two-gyroscope paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import BOTH, INDOOR, OUTDOOR, Item, claims_in

BOUNDS, RANKS, MOTIONS = map(claims_in, ("Bounds:", "Observability:", "Simulated motions:"))
KINEMATICS, FIXTURE, IDEAL = map(claims_in, ("Kinematics: what", "Fixture: what", "Consistency with ideal"))
STRAIGHT, PITCHING = map(claims_in, ("What holds, straight", "What holds, pitch"))
CAMERA = "The camera's alignment error makes more than half"

ITEMS = (
    Item("Figures 1 to 3", "pictures, frames and block diagram", because="they show no result"),
    Item(
        "(3) to (15)",
        "kinematics of platform and body; both models are precise without pitch",
        "Kinematics: largest error",
        KINEMATICS("Level"),
    ),
    Item(
        "(6)",
        "a Segway: roll negligible, pitch estimated",
        ("Segway: equation (6)", "Segway: pitch of one run"),
        claims_in("Segway: what holds")("(6)"),
    ),
    Item(
        "(17) to (19)",
        "Σ2 is observable while the platform turns; φ is not without turning, and never with Σ1",
        "Rank along a trajectory",
        RANKS("Σ2 observes", "Without a yaw rate", "Σ1 never"),
    ),
    Item(
        "(20) to (22)",
        "the stacked gradients have rank 9",
        "Generic rank by Lie derivatives",
        RANKS("(20)–(22)"),
        corrected=RANKS("With ∇L_f0 f1 h"),
    ),
    Item("(23)", "the discrete filter converges while the platform turns", "Simulated motions", MOTIONS("(23)")),
    Item("Figure 4 (a)", "bound of φ, sinusoidal yaw rate", "Figure 4", BOUNDS("(a)")),
    Item("Figure 4 (b)", "bound of φ without yaw rate", "Figure 4", BOUNDS("(b)")),
    Item(
        "Figure 4 (c)",
        "bounds of four yaw rates overlap",
        "Bound of the roll: constant yaw rates",
        BOUNDS("(c) biases 0.1 °/s, moving body: bounds of 5 to 20 °/s overlap at 60 s"),
        causes=BOUNDS(
            "(c) biases 0.1 °/s, moving body: bounds go with 1 / yaw rate",
            "(c) biases known: bounds of 5 to 20 °/s overlap at 60 s",
        ),
    ),
    Item("Figure 5", "photographs of the set-up", because="they show no result"),
    Item(
        "Figures 6, 7",
        "fixture: Σ2 follows the roll, Σ1 drifts",
        "Figures 6 to 8",
        FIXTURE("distances: Σ2 follows", "orientation: Σ2 follows"),
    ),
    Item(
        "Figure 8",
        "fixture: θ does not drift",
        "Figures 6 to 8",
        FIXTURE("distances: θ", "orientation: θ"),
    ),
    Item(
        "Figures 9, 10",
        "indoors Σ2 is free of drift, Σ1 diverges",
        "Ride indoor_circle",
        INDOOR("Σ1 drifts", "Σ2 does not drift"),
    ),
    Item(
        "Figure 11", "indoors θ does not drift as integration does", "Ride indoor_circle", INDOOR("θ1 does not drift")
    ),
    Item(
        "Figures 12, 13",
        "outdoors Σ2 is free of drift, Σ1 diverges",
        "Ride outdoor",
        OUTDOOR("Σ1 drifts", "Σ2 does not drift"),
    ),
    Item("Figure 14", "outdoors θ does not drift as integration does", "Ride outdoor", OUTDOOR("θ1 does not drift")),
    Item(
        "Table I",
        "errors of five riders indoors",
        ("Table I, indoor_circle", "Skill, indoor_circle"),
        INDOOR("Every error is at or below"),
        causes=INDOOR(CAMERA, "A camera with white noise only: every error"),
    ),
    Item(
        "Table I, [19]",
        "accuracy like that of the method with force sensors",
        "Table I, indoor_circle",
        INDOOR("Σ2 is as accurate as the published method"),
        causes=INDOOR(CAMERA, "A camera with white noise only: as accurate"),
    ),
    Item("Figure 15", "pitch and pitch rate on an extreme road", "Ride pitch"),
    Item(
        "Figure 16",
        "up to 20° of pitch do not significantly degrade φ",
        "Ride pitch",
        claims_in("Pitch")("Up to 20° of pitch"),
        causes=PITCHING("Exact sensors leave more than half"),
    ),
    Item(
        "Figure 17",
        "nearly straight ride: the estimate stays satisfactory",
        ("Ride straight", "Figure 17 (a)"),
        STRAIGHT("Σ1 drifts", "The largest error of φ is below 5°"),
    ),
    Item(
        "Section V-C",
        "under pitch the estimate degrades at most to integration",
        "Ride pitch",
        PITCHING("Σ2 is no worse than integration"),
        causes=PITCHING("With process noise for pitch Σ2 is no worse"),
    ),
    Item("Section V-C", "yaw cannot be estimated without drift", "Ride indoor_circle", BOTH("Yaw is not observed")),
    Item(
        "not in the paper",
        "the covariance is right where the filter's assumptions hold",
        "Consistency with ideal assumptions",
        IDEAL("sigma2, midpoint, 100 Hz"),
    ),
    Item(
        "not in the paper",
        "with the published step too, at 100 Hz",
        "Consistency with ideal assumptions",
        IDEAL("sigma2, euler, 100 Hz"),
        causes=IDEAL("sigma2, euler, 500 Hz"),
    ),
    Item(
        "not in the paper",
        "the roll is worth estimating: better than zero on rides outdoors, which roll by 6°",
        "Skill, outdoor",
        OUTDOOR("The roll is estimated better"),
    ),
    Item(
        "not in the paper",
        "the same in the indoor circle of table I",
        "Skill, indoor_circle",
        INDOOR("The roll is estimated better"),
        causes=INDOOR("The roll is smaller than the posterior bound"),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        "Beside the bound: a camera",
        claims_in("Beside the bound: what")("With the noise drawn anew"),
    ),
)
"""In the paper's order."""
