"""Straight-line functions against SciPy rotations."""

import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.physics.straight_line import straight_line
from poise.filters.core import rotation


def test_straight_lines_compute_what_arrays_compute():
    rng = np.random.default_rng(3)
    function = straight_line(lambda q, v: (rotation.rotate(q, v), rotation.log(q)), q=4, v=3)
    for _ in range(20):
        q, v = rotation.random(rng), rng.normal(size=3)
        turned, logarithm = function(q.tolist(), v.tolist())
        np.testing.assert_allclose(turned, Rotation.from_quat(np.roll(q, -1)).apply(v), atol=1e-14)
        np.testing.assert_allclose(logarithm, Rotation.from_quat(np.roll(q, -1)).as_rotvec(), atol=1e-13)
