"""What PyBullet prints on import does not land in anybody's output."""

from __future__ import annotations

import subprocess
import sys

IMPORT = "from poise.envs.quiet_pybullet import pybullet"


def test_nothing_but_our_own_output() -> None:
    code = f"print('before'); {IMPORT}; print('after', pybullet.DIRECT)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "before\nafter 2\n"


def test_a_closed_output_is_no_obstacle() -> None:
    code = f"import os; os.close(1); {IMPORT}; assert pybullet.connect(pybullet.DIRECT) >= 0; os._exit(7)"
    assert subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE).returncode == 7
