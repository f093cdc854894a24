"""Pages of environments are those of the classes, and say everything about every argument."""

import subprocess
import sys
from pathlib import Path

import pytest

from poise.envs import list_environments
from poise.envs.registration import accepted_arguments, environment_class
from poise.scripts.pages.environments import arguments_of, markdown, name_of, page, write_pages

PAGES = Path(__file__).resolve().parents[3] / "docs" / "environments"
FARAMA = ("# ", "## Action Space", "## Observation Space", "## Arguments", "## Version History")


def test_pages_are_up_to_date(tmp_path):
    # a process of its own: other tests may register kinds of sensors
    words = [sys.executable, "-m", "poise.scripts.main", "list", "--environments", str(tmp_path)]
    subprocess.run(words, capture_output=True, check=True)
    assert {each.name for each in tmp_path.iterdir()} == {each.name for each in PAGES.iterdir()}
    for path in tmp_path.iterdir():
        said = "run: poise list --environments docs/environments"
        assert path.read_text(encoding="utf-8") == (PAGES / path.name).read_text(encoding="utf-8"), said


@pytest.mark.parametrize("identity", list_environments())
def test_a_page_has_the_form_of_gymnasium(identity):
    text = (PAGES / name_of(identity)).read_text(encoding="utf-8")
    assert all(f"\n{part}" in f"\n{text}" for part in FARAMA)
    assert ":class:" not in text
    assert "``" not in text


@pytest.mark.parametrize("identity", list_environments())
def test_every_argument_is_described(identity):
    rows = arguments_of(environment_class(identity))
    assert [row["argument"] for row in rows] == [f"`{name}`" for name in accepted_arguments(identity)]
    assert [row["argument"] for row in rows if not row["meaning"]] == []


def test_pages_of_former_environments_go(tmp_path):
    (tmp_path / "Old-v0.md").write_text("gone")
    written = write_pages(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(written)
    gain = page("poise/HandMotionGain-v0")
    assert '`gymnasium.make_vec("poise/HandMotionGain-v0", num_envs)`, computed together' in gain
    assert "| the published gains |" in gain
    assert "## Reference Scores" not in page("poise/Replay-v0")


def test_roles_become_code():
    assert markdown("of :class:`.Thing` and ``x``, :func:`~a.b.c`") == "of `Thing` and `x`, `a.b.c`"
