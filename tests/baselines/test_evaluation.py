"""The table of errors: names, metrics, stand-ins for the truth, what cannot be run."""

import numpy as np
import pytest

import poise
from poise.baselines.comparison.data_sets import HAND_CHANNELS, contenders
from poise.baselines.error_table import agreement, summary
from poise.baselines.evaluation import evaluate
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation
from poise.filters.core.metrics import DEGREES, direction_error, rms
from poise.filters.support.rows import RESULT


@pytest.fixture(scope="module")
def trajectory():
    return simulate_hand("fast", seed=1, duration=6.0)


def value(table, estimator, metric, quantity="up"):
    chosen = table[(table.estimator == estimator) & (table.metric == metric) & (table.quantity == quantity)]
    assert len(chosen) == 1
    return chosen["value"].iloc[0]


def test_the_table_holds_the_errors_that_the_metrics_define(trajectory):
    table = evaluate(["mekf", "mekf-9", "tilt"], trajectory)
    assert tuple(table.columns) == RESULT
    up = poise.run("mekf", trajectory).pose["up"]
    expected = rms(direction_error(up, trajectory.truth["up"]), trajectory.mask) * DEGREES
    assert value(table, "mekf", "inclination") == pytest.approx(expected, rel=1e-12)
    assert value(table, "mekf-9", "total", "orientation") >= value(table, "mekf-9", "inclination") - 1e-9
    assert value(table, "mekf", "inclination") < value(table, "tilt", "inclination")
    assert set(table[table.quantity == "orientation"].estimator) == {"mekf-9"}
    assert not ((table.quantity == "orientation") & (table.metric == "inclination")).any()
    assert value(table, "mekf", "nis", "innovation") > 0.0
    assert table.attrs["skipped"] == []


def test_estimators_are_adjusted_to_the_rate_of_each_trajectory(trajectory):
    slow = trajectory.resampled(50.0).replace(metadata={**trajectory.metadata, "name": "slow"})
    table = evaluate({"named": "mekf", "made": poise.make_estimator("mekf", dt=0.5)}, [trajectory, slow])
    for name in (trajectory.name, "slow"):
        part = table[table.trajectory == name]
        assert value(part, "named", "inclination") == value(part, "made", "inclination")


def test_without_truth_a_reference_stands_in_and_is_named(trajectory):
    blind = trajectory.replace(truth={})
    table = evaluate({"mekf": "mekf", "mekf-9": "mekf-9", "twin": "mekf-9"}, blind, reference="mekf-9")
    assert value(table, "twin", "inclination to mekf-9") == pytest.approx(0.0, abs=1e-6)
    assert value(table, "mekf", "inclination to mekf-9") > 0.0
    assert set(table[table.estimator == "mekf-9"].metric) == {"nis"}
    assert not (table.metric == "inclination").any()
    assert set(evaluate("mekf", blind).metric) == {"nis"}
    assert table.attrs["references"] == {blind.name: "mekf-9"}


def six_axes(trajectory):
    return trajectory.replace(measurements={k: v for k, v in trajectory.measurements.items() if k != "imu/mag"})


def test_missing_channels_and_packages_are_listed_and_warned_of(trajectory, monkeypatch):
    six = six_axes(trajectory)
    with pytest.warns(UserWarning, match="mekf-9 was not run on .*: no channel imu/mag"):
        table = evaluate(["mekf", "mekf-9"], six)
    assert table.attrs["skipped"] == [("mekf-9", six.name, "no channel imu/mag")]

    def missing(name, **parameters):
        raise ImportError("pip install vqf")

    monkeypatch.setattr("poise.baselines.run.make_estimator", missing)
    with (
        pytest.warns(UserWarning, match="vqf was not run"),
        pytest.raises(ValueError, match="nothing could be run: vqf: pip install vqf"),
    ):
        evaluate("vqf", trajectory)


class Broken:
    """An estimator of a user that fails in some way."""

    dt, name = 0.01, "broken"

    def __init__(self, error):
        self.error = error
        self.channels = poise.make_estimator("mekf").channels
        self.outputs = poise.make_estimator("mekf").outputs

    def with_dt(self, dt):
        return self

    def init(self, measurement):
        raise self.error

    def step(self, state, measurement):
        raise self.error


@pytest.mark.parametrize(
    "error",
    [
        ValueError("interval 0.1 s is too long"),
        np.linalg.LinAlgError("singular"),
        FloatingPointError("overflow"),
        ZeroDivisionError("division"),
        ImportError("pip install something"),
        KeyError("imu/mag"),
        RuntimeError("diverged"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_estimator_that_fails_costs_no_other_its_row(trajectory, error):
    with pytest.warns(UserWarning, match="broken was not run"):
        table = evaluate({"broken": Broken(error), "mekf": "mekf"}, trajectory)
    assert set(table.estimator) == {"mekf"}
    ((label, name, reason),) = table.attrs["skipped"]
    assert (label, name) == ("broken", trajectory.name)
    assert str(error.args[0]) in reason


@pytest.mark.parametrize("rate", [10.0, 14.0])
def test_an_estimator_that_refuses_a_rate_is_skipped(trajectory, rate):
    slow = trajectory.resampled(rate)
    with pytest.warns(UserWarning, match="gru was not run"):
        table = evaluate(["gru", "mekf"], slow)
    assert set(table.estimator) == {"mekf"}


def test_a_clock_that_no_grid_explains_skips_the_recording_only(trajectory):
    generator = np.random.default_rng(0)
    times = np.cumsum(generator.uniform(0.3, 1.1, len(trajectory)))
    odd = trajectory.replace(time=times, metadata={**trajectory.metadata, "name": "odd"})
    with pytest.warns(UserWarning, match="mekf was not run on odd"):
        table = evaluate("mekf", [trajectory, odd])
    assert set(table.trajectory) == {trajectory.name}
    assert [name for _, name, _ in table.attrs["skipped"]] == ["odd"]
    with pytest.warns(UserWarning, match="not run on odd"), pytest.raises(ValueError, match="nothing could be run"):
        evaluate("mekf", odd)


@pytest.mark.parametrize(("channels", "chosen"), [(9, "mekf-9"), (6, "bounded-motion")])
def test_the_automatic_reference_is_one_that_the_recording_can_feed(trajectory, channels, chosen):
    blind = (trajectory if channels == 9 else six_axes(trajectory)).replace(truth={})
    table = evaluate(["mekf", "tilt"], blind, reference="auto")
    assert table.attrs["references"] == {blind.name: chosen}
    assert value(table, "tilt", f"inclination to {chosen}") > 0.0
    assert value(table, "tilt", "inclination to mekf") > 0.0
    dead = blind.replace(measurements={**blind.measurements, "imu/mag": np.zeros((len(blind), 3))})
    with pytest.warns(UserWarning, match="absent or off"):
        table = evaluate("mekf", dead, reference="auto")
    assert table.attrs["references"] == {blind.name: "bounded-motion"}


def test_a_reference_that_cannot_be_fed_leaves_the_pairs(trajectory):
    blind = six_axes(trajectory).replace(truth={})
    for reference in ("mekf-9", "onboard"):
        with pytest.warns(UserWarning, match="compared with each other"):
            table = evaluate(["mekf", "tilt"], blind, reference=reference)
        assert value(table, "tilt", "inclination to mekf") > 0.0


def test_the_device_s_own_orientation_is_a_reference(trajectory):
    measurements = trajectory.measurements | {"imu/onboard_orientation": trajectory.truth_of("orientation")}
    known, blind = evaluate("mekf", trajectory), trajectory.replace(measurements=measurements, truth={})
    table = evaluate("mekf", blind, reference="onboard")
    assert value(table, "mekf", "inclination to onboard") == pytest.approx(
        value(known, "mekf", "inclination"), rel=1e-6
    )


def test_without_truth_all_pairs_are_compared_and_nobody_is_ranked(trajectory):
    blind = trajectory.replace(truth={})
    wide = agreement(evaluate(["tilt", "mekf-9", "mekf"], blind))
    assert list(wide.index) == list(wide.columns) == ["tilt", "mekf-9", "mekf"]
    np.testing.assert_allclose(wide, wide.T, atol=1e-9)
    assert np.isnan(np.diag(wide)).all()
    heading = agreement(evaluate(["mekf-9", "vqf-9", "mekf"], blind), "heading")
    assert heading.loc["mekf-9", "vqf-9"] > 0.0
    assert "mekf" not in heading.index


class Half(Broken):
    """A perfect estimator for the first half of what it is given, silent afterwards."""

    name = "half"

    def __init__(self, up):
        super().__init__(None)
        self.up = up

    def run(self, measurements):
        from poise.filters.core.quantity import Estimate

        up = self.up.copy()
        up[len(up) // 2 :] = np.nan
        return Estimate({"up": up})


def test_an_estimator_that_is_silent_half_the_time_does_not_rank_first(trajectory):
    table = evaluate({"half": Half(trajectory.truth_of("up")), "mekf": "mekf", "tilt": "tilt"}, trajectory)
    wide = summary(table)
    assert list(wide.index) == ["mekf", "tilt", "half"]
    assert wide.loc["half", "valid"] == pytest.approx(0.5, abs=0.01)
    assert wide.loc["half", "mean"] < wide.loc["mekf", "mean"]


def test_an_estimator_that_ran_on_the_easy_half_does_not_rank_first(trajectory):
    still = trajectory.replace(measurements={**trajectory.measurements}, metadata={"name": "other"})
    still = still.replace(measurements={k: v for k, v in still.measurements.items() if k != "imu/mag"})
    with pytest.warns(UserWarning, match="mekf-9 was not run on other"):
        table = evaluate(["tilt", "mekf-9", "mekf"], [trajectory, still])
    wide = summary(table)
    assert wide.index[-1] == "mekf-9"
    assert wide.loc["mekf-9", "valid"] == pytest.approx(0.5)


@pytest.mark.parametrize("length", [3, 30, 90])
def test_a_printed_table_shows_metric_and_value_in_80_columns(trajectory, length):
    named = trajectory.replace(metadata={**trajectory.metadata, "name": "recording-" + "x" * length})
    table = evaluate({"mekf": "mekf", "an estimator of a rather long name, variant 3": "tilt"}, named)
    for shown in (table, table[table.metric == "inclination"]):
        lines = str(shown).splitlines()
        assert max(map(len, lines)) <= 80
        assert "metric" in lines[0]
        assert "value" in lines[0]
        text = f"{value(table, 'mekf', 'inclination'):.4g}"
        assert any(text in line and "inclination" in line for line in lines)
    assert "more rows" in str(table.loc[np.tile(table.index, 20)])


@pytest.mark.parametrize("heading", [-120.0, 60.0])
def test_a_reference_with_a_north_of_its_own_is_warned_of(trajectory, heading):
    turn = rotation.from_euler_zyx(np.radians(heading), np.array(0.0), np.array(0.0))
    truth = {"orientation": rotation.multiply(turn, trajectory.truth_of("orientation"))}
    # the iron of the device turns the heading of filters by a degree
    near = "|".join(f"{-heading + error:.0f}" for error in (-2.0, -1.0, 0.0, 1.0, 2.0))
    with pytest.warns(UserWarning, match=f"by a constant ({near})°; likely cause: the x axis"):
        evaluate(["mekf-9", "bounded-motion-9", "tilt"], trajectory.replace(truth=truth))


def test_two_sessions_with_equal_sensor_names_get_their_paths(trajectory, tmp_path):
    paths = []
    for session in ("monday", "tuesday/late"):
        folder = tmp_path / session
        folder.mkdir(parents=True)
        paths.append(trajectory[:200].replace(metadata={"name": "chest"}).save(folder / "chest.h5"))
    table = evaluate("tilt", paths)
    assert list(dict.fromkeys(table.trajectory)) == ["monday/chest", "tuesday/late/chest"]


def test_the_clock_of_the_reference_is_corrected_on_request(trajectory):
    """A truth that runs 20 ms ahead costs what the motion makes in 20 ms, and nothing once it is corrected."""
    ahead = 2
    truth = {"orientation": np.roll(trajectory.truth_of("orientation"), -ahead, axis=0)}
    moved = trajectory.replace(truth=truth, metadata={"name": "ahead"})[:-ahead]
    sound = value(evaluate("mekf", trajectory), "mekf", "inclination")
    recorded = evaluate("mekf", moved)
    corrected = evaluate("mekf", moved, reference_clock="corrected")
    assert value(recorded, "mekf", "inclination") > 1.5 * sound
    assert value(corrected, "mekf", "inclination") == pytest.approx(sound, rel=0.1)
    assert corrected.attrs["reference_clock"] == "corrected"
    with pytest.raises(ValueError, match="reference_clock must be one of"):
        evaluate("mekf", moved, reference_clock="right")


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [("imu/gyr", 180.0 / np.pi, "deg/s"), ("imu/acc", 1.0 / 9.80665, "readings in g"), ("imu/acc", -1.0, "Apple")],
)
def test_implausible_recordings_are_warned_of(trajectory, channel, factor, words):
    wrong = trajectory.replace(
        measurements={**trajectory.measurements, channel: factor * trajectory.measurements[channel]}
    )
    with pytest.warns(UserWarning, match=words):
        evaluate("tilt", wrong)


def test_bad_input_is_explained(trajectory):
    with pytest.raises(ValueError, match="did you mean 'mekf'"):
        evaluate("mekff", trajectory)
    with pytest.raises(ValueError, match="needs estimators and trajectories"):
        evaluate([], trajectory)
    with pytest.raises(ValueError, match="two trajectories are named"):
        evaluate("tilt", [trajectory, trajectory])
    with pytest.raises(ValueError, match=r"several estimators are named \['MEKF'\]"):
        evaluate([poise.make_estimator("mekf"), poise.make_estimator("mekf", dt=0.02)], trajectory)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        evaluate("tilt", "nowhere.mat")


def test_the_summary_averages_over_trajectories_not_groups(trajectory):
    parts = [
        trajectory[start:stop].replace(metadata={**trajectory.metadata, "name": f"part-{start}"})
        for start, stop in ((0, 200), (200, 400), (400, 600))
    ]
    table = evaluate(["tilt", "mekf"], parts)
    wide = summary(table, groups={"part-0": "a", "part-200": "b", "part-400": "b"})
    errors = table[(table.estimator == "tilt") & (table.metric == "inclination")]["value"].to_numpy()
    assert list(wide.index) == ["mekf", "tilt"]
    assert wide.loc["tilt", "mean"] == pytest.approx(errors.mean())
    assert wide.loc["tilt", "b"] == pytest.approx(errors[1:].mean())
    assert np.isfinite(wide.to_numpy()).all()


def test_the_benchmark_takes_what_the_data_suit():
    hand = contenders()
    assert {"mekf", "bounded-motion", "external-acceleration (mode 3)"} <= set(hand)
    listed = poise.list_estimators()
    assert all(set(listed[label.split(" (")[0]].channels) <= set(HAND_CHANNELS) for label in hand)
    six = contenders(channels=("imu/gyr", "imu/acc"))
    assert "mekf" in six
    assert "mekf-9" not in six
    assert set(contenders(["mekf-9"], channels=())) == {"mekf-9"}


def test_a_recording_without_a_scored_sample_is_a_reason_and_reasons_stand_once():
    motion = simulate_hand("slow", seed=0, duration=3.0)
    blank = motion.replace(mask=np.zeros(len(motion), bool))
    with (
        pytest.warns(UserWarning, match="not run on"),
        pytest.raises(ValueError, match="nothing could be run: mekf, tilt: no sample is scored"),
    ):
        evaluate(["mekf", "tilt"], blank, check=False)


@pytest.mark.parametrize("scored", [True, False])
def test_a_truth_without_a_known_sample_counts_as_none(trajectory, scored):
    late = np.arange(len(trajectory)) < 100
    unknown = {name: np.where(scored | late[:, None], np.nan, values) for name, values in trajectory.truth.items()}
    mask = late if not scored else np.ones(len(late), bool)
    with pytest.warns(UserWarning, match="truth is known at no sample that is scored"):
        table = evaluate(["mekf", "tilt"], trajectory.replace(truth=unknown, mask=mask))
    assert value(table, "mekf", "inclination to tilt") > 0.0
    assert np.isfinite(table["value"]).all()
