"""Runs of agents become tables and figures; runs that cannot be compared are refused."""

import csv
import dataclasses
import json

import numpy as np
import pytest

from poise.baselines.gain_policy.compared.runs import (
    CURVE,
    SETS,
    TuneRun,
    common_curve,
    comparison,
    curves_figure,
    profiles_figure,
    scores_of_runs,
)

NAMES = [f"hand-{number}" for number in range(6)]


def write_run(folder, agent="ppo", seed=0, better=0.5, names=NAMES, command="tune", filter="mekf"):
    folder.mkdir(parents=True)
    args = {"filter": filter, "agent": agent, "seed": seed}
    (folder / "args.json").write_text(json.dumps({"command": command, "seed": seed, "args": args}))
    (folder / SETS).write_text(json.dumps({"simulated": names}))
    noise = np.random.default_rng(seed).normal(scale=0.02, size=len(names))
    with (folder / "results.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["estimator", "trajectory", "quantity", "metric", "value", "unit"])
        for number, name in enumerate(names):
            published = 1.0 + number
            shares = {"published": 1.0, "constant": 0.9, "policy": 1.0 - better + noise[number], "oracle": 0.4}
            for gains, share in shares.items():
                writer.writerow([gains, name, "up", "inclination", published * share, "deg"])
    (folder / CURVE).write_text("steps,gain\n0,nan\n100,0.0\n200,0.1\n")
    return TuneRun.read(folder)


@pytest.fixture
def runs(tmp_path):
    return [
        write_run(tmp_path / f"{agent}-{seed}", agent, seed, better)
        for agent, better in (("ppo", 0.5), ("sac", 0.05))
        for seed in range(5)
    ]


def test_a_table_of_agents(runs):
    ppo, sac = comparison(runs, draws=200)
    assert (ppo["agent"], ppo["seeds"], ppo["trajectories"]) == ("ppo", 5, 6)
    assert ppo["published (deg)"] == pytest.approx(3.5)
    assert ppo["best constant (deg)"] == pytest.approx(3.15)
    means = [np.mean(list(run.errors["policy"].values())) for run in runs if run.agent == "ppo"]
    assert ppo["worst seed (deg)"] == pytest.approx(max(means), abs=1e-3)
    value, low, high = (float(each.strip("[],")) for each in ppo["saved, IQM"].split())
    assert low <= value <= high
    assert value == pytest.approx(0.5, abs=0.02)
    assert high - low < 0.05
    assert ppo["better than constant"].startswith("1.000")
    assert float(sac["better than constant"].split()[0]) < 0.1
    assert float(sac["saved more than constant"].split()[2].strip("]")) < 0.0
    assert comparison(runs, draws=20) == comparison(runs[::-1], draws=20)


def test_figures(runs, tmp_path):
    from poise.baselines.plots import save

    (axes,) = profiles_figure(runs, "simulated").axes
    assert [line.get_label() for line in axes.lines][:2] == ["ppo", "sac"]
    ppo, sac = (line.get_ydata() for line in axes.lines[:2])
    assert (ppo >= sac - 1e-9).all()
    assert save(curves_figure(runs), tmp_path / "curves.png").stat().st_size > 1000


def test_a_curve_is_the_interquartile_mean_over_seeds(runs):
    first, second = (
        dataclasses.replace(run, curve=[{"steps": 0.0, "gain": 0.0}, {"steps": 10.0, "gain": 8.0}]) for run in runs[:2]
    )
    others = [
        dataclasses.replace(run, curve=[{"steps": 0.0, "gain": 0.0}, {"steps": 10.0, "gain": 1.0}]) for run in runs[2:5]
    ]
    (axes,) = curves_figure([first, second, *others]).axes
    np.testing.assert_allclose(axes.lines[0].get_ydata()[[0, -1]], [0.0, (1.0 + 1.0 + 8.0) / 3])


def test_runs_of_the_script_are_read_too(tmp_path):
    assert write_run(tmp_path / "plain", command="plain_ppo").errors["policy"]


def test_curves_meet_where_all_are_known():
    one = [{"steps": 0.0, "gain": float("nan")}, {"steps": 10.0, "gain": 1.0}, {"steps": 20.0, "gain": 2.0}]
    two = [{"steps": 0.0, "gain": 0.0}, {"steps": 15.0, "gain": 3.0}]
    steps, values = common_curve([one, two])
    np.testing.assert_allclose([steps[0], steps[-1]], [10.0, 15.0])
    np.testing.assert_allclose(values[:, 0], [1.0, 2.0])
    np.testing.assert_allclose(values[:, -1], [1.5, 3.0])


def test_runs_that_cannot_be_compared_are_refused(runs, tmp_path):
    other = write_run(tmp_path / "other", "ppo", 9, names=NAMES[:3])
    with pytest.raises(ValueError, match="was tested on other trajectories"):
        comparison([*runs, other])
    twin = write_run(tmp_path / "twin", "ppo", 0)
    with pytest.raises(ValueError, match="must differ in their seeds"):
        comparison([*runs, twin])
    with pytest.raises(ValueError, match="has no results of 'nothing'"):
        scores_of_runs(runs, "nothing", "simulated")
    with pytest.raises(ValueError, match="at least one run"):
        comparison([])


def test_folders_that_are_no_runs_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"is not a finished run of poise tune: it has no args\.json"):
        TuneRun.read(tmp_path)
    with pytest.raises(ValueError, match="of the command 'train'"):
        write_run(tmp_path / "train", command="train")
    run = write_run(tmp_path / "run")
    (run.folder / "results.csv").write_text("estimator,trajectory,value\npolicy,hand-0,abc\n")
    with pytest.raises(ValueError, match="could not convert"):
        TuneRun.read(run.folder)
    (run.folder / SETS).unlink()
    with pytest.raises(FileNotFoundError, match=SETS):
        TuneRun.read(run.folder)
