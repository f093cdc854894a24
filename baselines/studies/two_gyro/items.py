"""Tables, figures and statements of the two-gyroscope paper, and what of the study answers each."""

from __future__ import annotations

from ..coverage import INDOOR, OUTDOOR, Item, both

BOUNDS, RANKS, MOTIONS = "Bounds:", "Observability:", "Simulated motions:"
KINEMATICS = "Kinematics: what"
STRAIGHT, PITCHING = "What holds, straight", "What holds, pitch"
CAMERA = (INDOOR, "The camera's alignment error makes more than half")

ITEMS = (
    Item("Figures 1 to 3", "pictures, frames and block diagram", because="they show no result"),
    Item(
        "(3) to (15)",
        "kinematics of platform and body; both models are precise without pitch",
        shown=("Kinematics: largest error",),
        decided=((KINEMATICS, "Level"),),
    ),
    Item(
        "(6)",
        "a Segway: roll negligible, pitch estimated",
        shown=("Segway: equation (6)", "Segway: pitch of one run"),
        decided=(("Segway: what holds", "(6)"),),
    ),
    Item(
        "(17) to (19)",
        "Σ2 is observable while the platform turns; φ is not without turning, and never with Σ1",
        shown=("Rank along a trajectory",),
        decided=((RANKS, "Σ2 observes"), (RANKS, "Without a yaw rate"), (RANKS, "Σ1 never")),
    ),
    Item(
        "(20) to (22)",
        "the stacked gradients have rank 9",
        shown=("Generic rank by Lie derivatives",),
        decided=((RANKS, "(20)–(22)"),),
        corrected=((RANKS, "With ∇L_f0 f1 h"),),
    ),
    Item(
        "(23)",
        "the discrete filter converges while the platform turns",
        shown=("Simulated motions",),
        decided=((MOTIONS, "(23)"),),
    ),
    Item("Figure 4 (a)", "bound of φ, sinusoidal yaw rate", shown=("Figure 4",), decided=((BOUNDS, "(a)"),)),
    Item("Figure 4 (b)", "bound of φ without yaw rate", shown=("Figure 4",), decided=((BOUNDS, "(b)"),)),
    Item(
        "Figure 4 (c)",
        "bounds of four yaw rates overlap",
        shown=("Bound of the roll: constant yaw rates",),
        decided=((BOUNDS, "(c) biases 0.1 °/s, moving body: bounds of 5 to 20 °/s overlap at 60 s"),),
        causes=(
            (BOUNDS, "(c) biases 0.1 °/s, moving body: bounds go with 1 / yaw rate"),
            (BOUNDS, "(c) biases known: bounds of 5 to 20 °/s overlap at 60 s"),
        ),
    ),
    Item("Figure 5", "photographs of the set-up", because="they show no result"),
    Item(
        "Figures 6, 7",
        "fixture: Σ2 follows the roll, Σ1 drifts",
        shown=("Figures 6 to 8",),
        decided=(("Fixture: what", "distances: Σ2 follows"), ("Fixture: what", "orientation: Σ2 follows")),
    ),
    Item(
        "Figure 8",
        "fixture: θ does not drift",
        shown=("Figures 6 to 8",),
        decided=(("Fixture: what", "distances: θ"), ("Fixture: what", "orientation: θ")),
    ),
    Item(
        "Figures 9, 10",
        "indoors Σ2 is free of drift, Σ1 diverges",
        shown=("Ride indoor_circle",),
        decided=((INDOOR, "Σ1 drifts"), (INDOOR, "Σ2 does not drift")),
    ),
    Item(
        "Figure 11",
        "indoors θ does not drift as integration does",
        shown=("Ride indoor_circle",),
        decided=((INDOOR, "θ1 does not drift"),),
    ),
    Item(
        "Figures 12, 13",
        "outdoors Σ2 is free of drift, Σ1 diverges",
        shown=("Ride outdoor",),
        decided=((OUTDOOR, "Σ1 drifts"), (OUTDOOR, "Σ2 does not drift")),
    ),
    Item(
        "Figure 14",
        "outdoors θ does not drift as integration does",
        shown=("Ride outdoor",),
        decided=((OUTDOOR, "θ1 does not drift"),),
    ),
    Item(
        "Table I",
        "errors of five riders indoors",
        shown=("Table I, indoor_circle", "Skill, indoor_circle"),
        decided=((INDOOR, "Every error is at or below"),),
        causes=(CAMERA, (INDOOR, "A camera with white noise only: every error")),
    ),
    Item(
        "Table I, [19]",
        "accuracy like that of the method with force sensors",
        shown=("Table I, indoor_circle",),
        decided=((INDOOR, "Σ2 is as accurate as the published method"),),
        causes=(CAMERA, (INDOOR, "A camera with white noise only: as accurate")),
    ),
    Item("Figure 15", "pitch and pitch rate on an extreme road", shown=("Ride pitch",)),
    Item(
        "Figure 16",
        "up to 20° of pitch do not significantly degrade φ",
        shown=("Ride pitch",),
        decided=(("Pitch", "Up to 20° of pitch"),),
        causes=((PITCHING, "Exact sensors leave more than half"),),
    ),
    Item(
        "Figure 17",
        "nearly straight ride: the estimate stays satisfactory",
        shown=("Ride straight", "Figure 17 (a)"),
        decided=((STRAIGHT, "Σ1 drifts"), (STRAIGHT, "The largest error of φ is below 5°")),
    ),
    Item(
        "Section V-C",
        "under pitch the estimate degrades at most to integration",
        shown=("Ride pitch",),
        decided=((PITCHING, "Σ2 is no worse than integration"),),
        causes=((PITCHING, "With process noise for pitch Σ2 is no worse"),),
    ),
    Item(
        "Section V-C",
        "yaw cannot be estimated without drift",
        shown=("Ride indoor_circle",),
        decided=both("Yaw is not observed"),
    ),
    Item(
        "not in the paper",
        "the covariance is right where the filter's assumptions hold",
        shown=("Consistency with ideal assumptions",),
        decided=(("Consistency with ideal", "sigma2, midpoint, 100 Hz"),),
    ),
    Item(
        "not in the paper",
        "with the published step too, at 100 Hz",
        shown=("Consistency with ideal assumptions",),
        decided=(("Consistency with ideal", "sigma2, euler, 100 Hz"),),
        causes=(("Consistency with ideal", "sigma2, euler, 500 Hz"),),
    ),
    Item(
        "not in the paper",
        "the roll is worth estimating: better than zero on rides outdoors, which roll by 6°",
        shown=("Skill, outdoor",),
        decided=((OUTDOOR, "The roll is estimated better"),),
    ),
    Item(
        "not in the paper",
        "the same in the indoor circle of table I",
        shown=("Skill, indoor_circle",),
        decided=((INDOOR, "The roll is estimated better"),),
        causes=((INDOOR, "The roll is smaller than the posterior bound"),),
    ),
    Item(
        "not in the paper",
        "no error lies below its bound",
        shown=("Beside the bound: a camera",),
        decided=(("Beside the bound: what", "With the noise drawn anew"),),
    ),
)
"""In the paper's order."""
