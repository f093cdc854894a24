"""Names of estimators, and what importing the package costs."""

import subprocess
import sys

import pytest

import poise
from poise.baselines.registry import KINDS
from poise.baselines.weights_io import WEIGHTS
from poise.filters.core.estimator import Estimator


def test_every_entry_tells_what_it_is():
    listed = poise.list_estimators(experimental=True)
    assert list(dict.fromkeys(info.kind for info in listed.values())) == list(KINDS)
    for name, info in listed.items():
        assert info.name == name
        assert info.description
        assert "\n" not in info.description
        assert info.channels
        assert all("/" in channel for channel in info.channels)
        assert info.outputs
        assert info.source


@pytest.mark.parametrize("name", poise.list_estimators(experimental=True))
def test_every_estimator_is_what_the_list_says(name):
    info = poise.list_estimators(experimental=True)[name]
    if info.kind == "external":
        pytest.importorskip(name.split("-")[0])
    estimator = poise.make_estimator(name, dt=0.02)
    assert isinstance(estimator, Estimator)
    assert estimator.dt == 0.02
    assert {channel.name for channel in estimator.channels} == set(info.channels)
    assert {quantity.name for quantity in estimator.outputs} == set(info.outputs)
    if "orientation" in info.outputs:
        assert "imu/mag" in info.channels, "nothing else tells the heading"


def test_what_loses_to_its_own_filter_is_listed_on_request_only():
    everything, usual = poise.list_estimators(experimental=True), poise.list_estimators()
    assert everything["mekf+innovation"].experimental
    assert set(everything) - set(usual) == {name for name, info in everything.items() if info.experimental}


def test_unknown_names_list_the_valid_ones():
    with pytest.raises(ValueError, match=r"unknown estimator 'bounded', did you mean .*mahony"):
        poise.make_estimator("bounded")
    with pytest.raises(ValueError, match="unknown parameters \\['colour'\\] of 'mekf'"):
        poise.make_estimator("mekf", colour=1)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        poise.nothing  # noqa: B018


def test_the_public_face_is_light_to_import():
    heavy = ("pybullet", "torch", "stable_baselines3", "numba", "matplotlib", "pandas", "scipy")
    code = (
        "import sys, poise; poise.list_estimators(); dir(poise); "
        f"loaded = set({heavy}) & set(sys.modules); assert not loaded, loaded"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_public_name_can_be_had():
    for name in poise.__all__:
        assert getattr(poise, name) is not None


def test_a_file_of_weights_is_an_estimator_by_its_path():
    for weights, name in (("gru", "gru"), ("mekf_noise", "mekf+noise")):
        made = poise.make_estimator(str(WEIGHTS / f"{weights}.safetensors"), dt=0.02)
        named = poise.make_estimator(name, dt=0.02)
        assert type(made) is type(named)
        assert made.outputs == named.outputs
        assert made.dt == 0.02
    with pytest.raises(FileNotFoundError, match=r"no weights 'nothing\.safetensors'"):
        poise.make_estimator("nothing.safetensors")
    with pytest.raises(ValueError, match="describes no estimator of `poise train`, but 'gain policy'"):
        poise.make_estimator(str(WEIGHTS / "external_acceleration_policy.safetensors"))
