"""Named motions of everyday use: a device in the hand, tapped, buzzing, put down, or carried by somebody who walks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from .carried import Carried
from .hand_held import HandHeld, Over

ALONE = Over(
    clean_share=0.0,
    tremor_share=0.0,
    drift_share=0.0,
    taps_share=0.0,
    vibration_share=0.0,
    set_down_share=0.0,
    tissue_share=0.0,
)
"""No part over the motion."""
CALM = HandHeld(acceleration=(0.2, 2.0), rate=(0.2, 2.0), over=ALONE)
"""Motion that does not hide what lies over it."""
STILL = HandHeld(rest_shares=(1.0,) * 4, in_hand_share=1.0, over=ALONE)
"""A hand that holds the device as still as it can."""

EVERYDAY: Mapping[str, HandHeld | Carried] = MappingProxyType(
    {
        "hand-held": HandHeld(),
        "rotation": HandHeld(acceleration=(0.1, 3.0), rate=(1.0, 8.0), single_share=0.0, over=ALONE),
        "tremor": replace(STILL, over=replace(ALONE, tremor_share=1.0)),
        "drifting": replace(STILL, over=replace(ALONE, drift_share=1.0)),
        "taps": replace(CALM, over=replace(ALONE, taps_share=1.0)),
        "vibration": replace(CALM, over=replace(ALONE, vibration_share=1.0)),
        "set-downs": replace(
            CALM, rest_shares=(0.5,) * 4, in_hand_share=0.0, longest=(2.0, 8.0), over=replace(ALONE, set_down_share=1.0)
        ),
        "carried-walking": Carried(),
        "carried-running": Carried(running_share=1.0),
        "worn-walking": Carried(carriages=("pocket",), over=replace(ALONE, tissue_share=1.0)),
    }
)
"""Name → configuration; each begins with a second at rest."""

SUMMARIES: Mapping[str, str] = MappingProxyType(
    {
        "hand-held": "A device in the hand, as broad as recordings: turns, shakes, rests, every part below",
        "rotation": "Rotation by hand about all axes, 1 to 8 rad/s rms, as in BROAD",
        "tremor": "A still hand with physiological tremor, 8 to 12 Hz",
        "drifting": "A still hand that wanders slowly, up to 0.3 m/s rms below 0.2 Hz",
        "taps": "Calm motion with taps on the device, contacts of 0.5 to 8 ms",
        "vibration": "Calm motion while the device buzzes, 30 to 250 Hz",
        "set-downs": "Calm motion between rests on a table, with an impact each time",
        "carried-walking": "A phone in the hand, in a swinging hand or in a pocket of somebody who walks",
        "carried-running": "The same of somebody who runs",
        "worn-walking": "A sensor strapped to the thigh of somebody who walks, on soft tissue",
    }
)
"""Name → what it is."""
