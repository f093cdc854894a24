"""Whatever the public functions are given: the right number, or an error that says what is wrong and what is accepted.

Every property is tried on a few examples every day, and on thousands in the slow set.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pandas
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import poise
from poise.baselines.registry import TRAINED
from poise.baselines.speed.fixtures import plausible_measurements
from poise.envs.data.trajectory import Trajectory
from poise.filters.registry import FILTERS

SAMPLES = 40
ENTRIES = {**FILTERS, **TRAINED}
SIX_AXES = ("external-acceleration", "mekf", "bounded-motion", "mahony", "tilt", "gyroscope-integration", "gru")
"""What is run: estimators of one IMU that need no other package."""
QUIET = {"deadline": None, "derandomize": True, "suppress_health_check": list(HealthCheck)}


def property_of(few: int, many: int) -> Callable[..., Any]:
    """A property, tried on ``few`` examples every day and on ``many`` in the slow set."""

    def made(check: Callable[..., None]) -> Any:
        strategies = check.strategies  # type: ignore[attr-defined]
        daily = settings(max_examples=few, **QUIET)(given(**strategies)(check))
        long = settings(max_examples=many, **QUIET)(given(**strategies)(check))

        @pytest.mark.parametrize("size", ["daily", pytest.param("slow", marks=pytest.mark.slow)])
        def test(size: str) -> None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                (daily if size == "daily" else long)()

        return test

    return made


def drawn_from(**strategies: Any) -> Callable[..., Any]:
    """What a check is called with."""

    def attach(check: Any) -> Any:
        check.strategies = strategies
        return check

    return attach


ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.floats(),
    st.floats(-10.0, 10.0),
    st.sampled_from([0.0, -0.0, 1e300, -1e300, 1e-300, np.float64(0.3), np.float32(0.3), np.int64(2), np.bool_(True)]),
    st.text(max_size=4),
    st.binary(max_size=3),
    st.complex_numbers(max_magnitude=2.0),
    st.lists(st.floats(-1.0, 1.0), max_size=4),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    st.sampled_from([{}, {"a": 1.0}, object, np.array([0.1, 0.2]), np.array("x"), np.ma.masked, [[1.0], [1.0, 2.0]]]),
)


def explains(error: Exception, *names: str) -> None:
    """The message names the argument and says what is accepted."""
    text = str(error)
    assert any(name in text for name in names), f"{error!r} names none of {names}"
    accepted = (
        "must",
        "there are",
        "accepted",
        "needed",
        "needs",
        "lack",
        "pass",
        "contradicts",
        "nothing could be run",
        "unknown ",
        "give ",
    )
    assert any(word in text for word in accepted), f"{error!r} does not say what is accepted"


@cache
def motion() -> dict[str, np.ndarray]:
    """Plausible samples of an IMU, one sample of each channel lost."""
    data = plausible_measurements(poise.make_estimator("mekf-9"), 1, SAMPLES)
    for values in data.values():
        values[7] = np.nan
    return data


def is_sound(estimate: Any, shape: tuple[int, ...]) -> None:
    """As many samples as there were; what is finite is a unit vector where it must be one."""
    for name, values in estimate.pose.items():
        assert values.shape[:-1] == shape, name
        assert not np.isinf(values).any(), name
    for name in ("up", "orientation"):
        if name in estimate.pose:
            size = np.linalg.norm(estimate.pose[name], axis=-1)
            np.testing.assert_allclose(size[np.isfinite(size)], 1.0, atol=1e-6)


def uncompiled(name: str) -> dict[str, bool]:
    """Arrays serve for a few samples: every set of parameters would be compiled."""
    return {"compiled": False} if ENTRIES[name].runner else {}


@cache
def parameters_of(name: str) -> tuple[str, ...]:
    """Parameters that an estimator takes."""
    entry = ENTRIES[name]
    maker = entry.made_by
    found = [each for each, value in inspect.signature(maker).parameters.items() if value.kind is not value.VAR_KEYWORD]
    outer = ("compiled", "keep_covariance") if entry.runner else ()
    return tuple(each for each in (*found, *outer) if each not in entry.fixed)


@st.composite
def estimator_and_parameter(draw: Any) -> tuple[str, str]:
    name = draw(st.sampled_from(sorted(ENTRIES)))
    return name, draw(st.sampled_from(parameters_of(name)))


@property_of(200, 4500)
@drawn_from(chosen=estimator_and_parameter(), value=ANYTHING)
def test_any_parameter_is_taken_or_explained(chosen: tuple[str, str], value: Any) -> None:
    name, parameter = chosen
    try:
        estimator = poise.make_estimator(name, **{parameter: value})
    except ImportError:
        return
    except ValueError as error:
        explains(error, parameter)
        return
    assert estimator.channels
    assert estimator.outputs
    if name in SIX_AXES and parameter != "compiled":
        still = poise.make_estimator(name, **{parameter: value}, **uncompiled(name))
        is_sound(poise.run(still, motion(), dt=still.dt), (SAMPLES,))


def is_unknown(name: Any) -> bool:
    return not isinstance(name, str) or name not in ENTRIES


@property_of(30, 300)
@drawn_from(name=st.one_of(st.text(max_size=8), ANYTHING).filter(is_unknown), parameter=st.text(min_size=1, max_size=6))
def test_any_name_is_known_or_explained(name: Any, parameter: str) -> None:
    with pytest.raises((ValueError, TypeError)) as caught:
        poise.make_estimator(name)
    explains(caught.value, "estimator")
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        poise.make_estimator("mekf", **{parameter: 1.0})
    explains(caught.value, repr(parameter), parameter)


def transposed(values: np.ndarray) -> Any:
    return values.T


SAME: dict[str, Callable[[np.ndarray], Any]] = {
    "as it is": lambda values: values,
    "list": lambda values: values.tolist(),
    "Fortran order": np.asfortranarray,
    "every second of twice": lambda values: np.repeat(values, 2, axis=0)[::2],
    "backwards view": lambda values: values[::-1].copy()[::-1],
    "read-only": lambda values: np.frombuffer(values.tobytes()).reshape(values.shape),
    "masked": lambda values: masked(values),
    "one of a batch": lambda values: values[:, None],
}
"""The same numbers in another form."""
WRONG: dict[str, Callable[[np.ndarray], Any]] = {
    "transposed": transposed,
    "one axis": lambda values: values[:, 0],
    "two columns": lambda values: values[:, :2],
    "no sample": lambda values: values[:0],
    "texts": lambda values: values.astype(str),
    "objects": lambda values: values.astype(object),
    "complex": lambda values: values.astype(complex),
    "booleans": lambda values: values > 0.0,
    "ragged": lambda values: [*values.tolist(), [1.0]],
    "None": lambda values: None,
    "a number": lambda values: 3.0,
    "a text": lambda values: "imu",
    "a shorter channel": lambda values: values[:-3],
}
HOSTILE: dict[str, Callable[[np.ndarray], Any]] = {
    "all lost": lambda values: np.full_like(values, np.nan),
    "zeros": np.zeros_like,
    "infinite": lambda values: np.where(np.arange(len(values))[:, None] == 5, np.inf, values),
    "a glitch": lambda values: np.where(np.arange(len(values))[:, None] == 5, 1e200, values),
    "huge": lambda values: 1e200 * values,
    "integers": lambda values: np.nan_to_num(values).astype(int),
    "single precision": lambda values: values.astype(np.float32),
    "one sample": lambda values: values[:1],
}


def masked(values: np.ndarray) -> np.ma.MaskedArray:
    """What is unknown is masked, with another number behind it."""
    return np.ma.array(np.where(np.isnan(values), 999.0, values), mask=np.isnan(values))


@property_of(60, 1200)
@drawn_from(
    name=st.sampled_from(SIX_AXES),
    channel=st.sampled_from(["imu/gyr", "imu/acc", "both"]),
    form=st.sampled_from([*SAME, *WRONG, *HOSTILE]),
)
def test_any_array_is_run_or_explained(name: str, channel: str, form: str) -> None:
    change = {**SAME, **WRONG, **HOSTILE}[form]
    data: dict[str, Any] = dict(motion())
    estimator = poise.make_estimator(name, **uncompiled(name))
    changed = ("imu/gyr", "imu/acc") if channel == "both" or form in SAME else (channel,)
    data |= {each: change(data[each]) for each in changed}
    lengths = {len(data[each.name]) if hasattr(data[each.name], "__len__") else 0 for each in estimator.channels}
    try:
        estimate = poise.run(estimator, data, dt=0.01)
    except (ValueError, TypeError) as error:
        assert form not in SAME
        assert form in WRONG or len(lengths) > 1
        explains(error, "channel", "measurements")
        return
    reads = {each.name for each in estimator.channels}
    assert form not in WRONG or not reads & set(changed) or (form == "a shorter channel" and len(lengths) == 1)
    is_sound(estimate, np.shape(data[next(iter(reads))])[:-1])
    if form in SAME:
        usual = poise.run(estimator, motion(), dt=0.01)
        for output, values in usual.pose.items():
            np.testing.assert_allclose(estimate.pose[output].reshape(values.shape), values, rtol=1e-12, atol=1e-12)


@property_of(60, 900)
@drawn_from(
    name=st.one_of(st.sampled_from(SIX_AXES), ANYTHING), dt=ANYTHING, data=st.one_of(st.just("motion"), ANYTHING)
)
def test_any_interval_is_taken_or_explained(name: Any, dt: Any, data: Any) -> None:
    estimator = name
    if isinstance(name, str) and name in SIX_AXES:
        estimator = poise.make_estimator(name, **uncompiled(name))
    arrays = motion() if isinstance(data, str) and data == "motion" else data
    try:
        estimate = poise.run(estimator, arrays, dt)
    except (ValueError, TypeError) as error:
        explains(error, "dt", "data", "estimator", "measurements")
        return
    assert abs(float(dt) - estimator.dt) < 1e-4
    is_sound(estimate, (SAMPLES,))


@cache
def trajectories() -> dict[str, Trajectory]:
    """A recording with the truth, one without, one with six axes only, and one that knows nothing."""
    from poise.envs.hand.sensing import simulate_hand

    known = simulate_hand("slow", seed=0, duration=2.0)
    blind = known.replace(truth={}, metadata={**known.metadata, "name": "blind"})
    six = {name: known.measurements[name] for name in ("imu/gyr", "imu/acc")}
    return {
        "known": known,
        "blind": blind,
        "six axes": blind.replace(measurements=six, metadata={**known.metadata, "name": "six"}),
        "odd": known.replace(measurements={"other/thing": np.zeros((len(known), 1))}, metadata={"name": "odd"}),
    }


@property_of(30, 500)
@drawn_from(
    estimators=st.one_of(st.lists(st.sampled_from([*SIX_AXES, "mekf-9", "nothing"]), max_size=3), ANYTHING),
    recordings=st.one_of(st.lists(st.sampled_from(["known", "blind", "six axes", "odd"]), max_size=2), ANYTHING),
    reference=st.one_of(st.none(), st.sampled_from(["auto", "onboard", "mekf-9", "tilt"]), ANYTHING),
)
def test_any_evaluation_is_done_or_explained(estimators: Any, recordings: Any, reference: Any) -> None:
    chosen = recordings
    if isinstance(recordings, list) and all(isinstance(each, str) for each in recordings):
        chosen = [trajectories()[each] for each in recordings]
    try:
        table = poise.evaluate(estimators, chosen, reference=reference)
    except (ValueError, TypeError, FileNotFoundError) as error:
        explains(error, "estimator", "trajector", "recording", "reference", "evaluate", "run")
        return
    assert isinstance(table, pandas.DataFrame)
    skipped = {name for name, _, _ in table.attrs["skipped"]}
    assert skipped | set(table["estimator"]) == ({estimators} if isinstance(estimators, str) else set(estimators))
    assert np.isfinite(table["value"][table["metric"] == "valid"]).all()


@cache
def files() -> dict[str, bytes]:
    """Files of the formats that can be read, by their content."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        saved = trajectories()["known"].save(Path(folder) / "one.h5").read_bytes()
    head = "DeviceTag:,D1\nFirmwareVersion:,1.6.0\nOutputRate:,60Hz\n\n"
    names = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z"
    rows = [f"{n},{16667 * n},0.1,0.2,9.8,1.0,2.0,3.0" for n in range(20)]
    return {"one.h5": saved, "one.csv": "\n".join([head + names, *rows, ""]).encode(), "none.txt": b"text\n" * 30}


@property_of(60, 1200)
@drawn_from(
    name=st.sampled_from(["one.h5", "one.csv", "none.txt"]),
    cut=st.floats(0.0, 1.0),
    places=st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 255)), max_size=6),
    calibration=st.one_of(st.none(), st.none(), ANYTHING),
)
def test_any_file_is_read_or_explained(
    name: str, cut: float, places: list[tuple[float, int]], calibration: Any
) -> None:
    import tempfile
    from pathlib import Path

    content = bytearray(files()[name])
    for place, value in places:
        content[int(place * (len(content) - 1))] = value
    kept = content if cut > 0.5 else content[: int(2.0 * cut * len(content))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording"
        path.write_bytes(bytes(kept))
        try:
            trajectory = poise.load_recording(path, calibration)
        except (ValueError, TypeError, FileNotFoundError) as error:
            # Of a damaged file it is enough to say which one, and why it cannot be read.
            assert str(path) in str(error) or "calibration" in str(error), error  # noqa: PT017
            return
    assert len(trajectory) > 0
    assert all(len(values) == len(trajectory) for values in trajectory.measurements.values())
