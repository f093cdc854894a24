"""What others bring works on every environment: stable-baselines3, rl-zoo3, a single-file script, TorchRL."""

import importlib.util
import pickle
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import yaml
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env as check_env_sb3
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

import poise
from poise.envs import list_environments

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
ZOO = EXAMPLES / "rl_zoo3_ppo.yml"
GAIN = "poise/HandMotionGain-v0"
SHORT = {"duration": 1.0}
SETS = [
    ("poise/HandMotion-v0", SHORT),
    ("poise/HandMotion-v0", {"score": "relative_orientation", "rate": 50.0, "gesture": "mixed", **SHORT}),
    ("poise/Replay-v0", SHORT),
    ("poise/BicycleFixture-v0", SHORT),
    ("poise/RiderBicycle-v0", {"score": "bicycle/roll", "fidelity": "lumped", **SHORT}),
    (GAIN, SHORT),
    (GAIN, {"filter": "mekf", "reward": "improvement", "interval": 0.2, **SHORT}),
    (GAIN, {"filter": "bounded-motion", "gains": ("velocity",), "reward": "error", "consistency": 0.1, **SHORT}),
    ("poise/ReplayGain-v0", {"privileged": True, **SHORT}),
    ("poise/RiderBicycleGain-v0", {"rides": 1, **SHORT}),
    ("poise/RiderBicycleGain-v0", {"filter": "two-gyro", "rides": 1, "reward": "relative", **SHORT}),
]
NAMES = [f"{identity.removeprefix('poise/')}-{number}" for number, (identity, _) in enumerate(SETS)]


def test_every_environment_is_tried():
    assert {identity for identity, _ in SETS} == set(list_environments())


@pytest.mark.parametrize(("identity", "options"), SETS, ids=NAMES)
def test_checkers_and_pickles(identity, options):
    env = gymnasium.make(identity, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # an unbounded part of an observation, for critics only, is what the first checker warns of
        warnings.filterwarnings("ignore", message=".*A Box observation space m")
        # angles are in radians
        warnings.filterwarnings("ignore", message=".*(For Box action spaces, we|We) recommend")
        check_env(env.unwrapped, skip_render_check=True)
        check_env_sb3(env.unwrapped, warn=True)
    env.reset(seed=3)
    action = np.asarray(env.unwrapped.neutral_action)
    env.step(action)
    twin = pickle.loads(pickle.dumps(env.unwrapped))
    for one, two in zip(env.step(action)[:2], twin.step(action)[:2], strict=True):
        np.testing.assert_equal(one, two)
    env.close()
    twin.close()


@pytest.mark.parametrize(("identity", "options"), SETS, ids=NAMES)
def test_stable_baselines_trains_saves_and_loads(identity, options, tmp_path):
    envs = make_vec_env(identity, 2, seed=0, env_kwargs=options)
    boxes = isinstance(envs.observation_space, gymnasium.spaces.Box)
    keys = None if boxes else [name for name in envs.observation_space.spaces if name != "new_sample"]
    normalised = VecNormalize(envs, norm_obs_keys=keys)
    model = PPO("MlpPolicy" if boxes else "MultiInputPolicy", normalised, n_steps=8, batch_size=8, n_epochs=1, seed=0)
    model.learn(16)
    seen = normalised.reset()
    model.save(tmp_path / "model")
    normalised.save(tmp_path / "normalisation.pkl")
    again = PPO.load(tmp_path / "model", device="cpu")
    np.testing.assert_array_equal(*(each.predict(seen, deterministic=True)[0] for each in (model, again)))
    read = VecNormalize.load(str(tmp_path / "normalisation.pkl"), envs)
    raw = normalised.get_original_obs()
    np.testing.assert_equal(read.normalize_obs(raw), normalised.normalize_obs(raw))
    normalised.close()


@pytest.mark.parametrize("identity", [GAIN, "poise/HandMotion-v0"])
def test_torchrl_rolls_out(identity):
    from torchrl.envs import GymEnv

    env = GymEnv(identity, duration=1.0)
    env.set_seed(0)
    rollout = env.rollout(5)
    assert rollout["next", "reward"].shape == (5, 1)
    assert np.isfinite(rollout["next", "reward"].numpy()).all()
    env.close()


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "words",
    [
        [GAIN, "--option", "duration=1.0", "--option", "motions=2"],
        ["poise/HandMotion-v0", "--option", "score=relative_orientation", "--history", "2", "--gamma", "0"],
        ["Pendulum-v1"],
    ],
)
def test_a_single_file_that_knows_only_the_id(words, tmp_path):
    common = [
        "--steps",
        "128",
        "--envs",
        "2",
        "--rollout",
        "32",
        "--evaluate",
        "10",
        "--curve",
        str(tmp_path / "curve.csv"),
    ]
    curve = example("ppo_single_file").main([*words, *common])
    assert [steps for steps, _ in curve] == [64, 128]
    assert all(np.isfinite(reward) for _, reward in curve)
    assert (tmp_path / "curve.csv").read_text().startswith("steps,reward\n64,")
    assert example("ppo_single_file").main([*words, *common]) == curve


def test_plain_ppo_leaves_runs_that_are_compared(tmp_path, capsys):
    from poise.scripts.main import main

    words = ["--steps", "1", "--episodes", "4", "--seeds", "0", "1", "--runs", str(tmp_path)]
    first, second = example("plain_ppo").main(words)
    assert len(first.curve) == 1
    assert first.errors["published"] == second.errors["published"]
    assert first.errors["policy"] != second.errors["policy"]
    assert main(["tune", "--report", str(first.folder), str(second.folder), "--runs", str(tmp_path)]) == 0
    assert "PPO default, 1 steps" in capsys.readouterr().out


@pytest.mark.slow
def test_plain_ppo_beats_the_published_gains(tmp_path):
    (run,) = example("plain_ppo").main(["--steps", "25000", "--episodes", "16", "--runs", str(tmp_path)])
    published, constant, ppo = (
        np.mean(list(run.errors[gains].values())) for gains in ("published", "constant", "policy")
    )
    assert ppo < 0.9 * published
    assert constant < published


def test_the_zoo_knows_every_environment_that_it_configures():
    import rl_zoo3.import_envs
    import rl_zoo3.train  # noqa: F401

    configured = yaml.safe_load(ZOO.read_text().replace("!!float ", ""))
    assert set(configured) <= set(list_environments())
    assert {"poise/HandMotionGain-v0", "poise/HandMotion-v0"} <= set(configured)
    assert all(each["policy"] in ("MlpPolicy", "MultiInputPolicy") for each in configured.values())


@pytest.mark.slow
def test_the_zoo_trains_and_enjoys(tmp_path):
    common = ["--algo", "ppo", "--env", GAIN, "--gym-packages", "poise", "-f", str(tmp_path), "--seed", "0"]
    common += ["--env-kwargs", "duration:2.0"]
    train = ["--conf-file", str(ZOO), "-n", "600", "--eval-freq", "-1", "--hyperparams", "n_steps:32", "n_envs:2"]
    enjoy = ["--no-render", "-n", "60"]
    for name, own in (("train", train), ("enjoy", enjoy)):
        done = subprocess.run([sys.executable, "-m", f"rl_zoo3.{name}", *common, *own], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-2000:]
    assert "Mean reward" in done.stdout


def test_the_package_is_what_the_zoo_imports():
    assert GAIN in gymnasium.registry
    assert poise.__name__ == "poise"
