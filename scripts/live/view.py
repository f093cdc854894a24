"""Show motion and estimates in the browser: a recording, an environment, or samples while they arrive.

The truth is solid, estimates are translucent. The page has play, pause, time and speed, errors and angles as curves,
the choice of estimators, forces, trails, and the virtual controller of the thesis on game controllers.
"""

from __future__ import annotations

import signal
import threading
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import tyro

from ...filters.support.optional import extra
from ..output import Output
from ..targets import check_file
from .curves import TRUTH
from .lines import LineFormat

if TYPE_CHECKING:
    from ...envs.data.trajectory import Trajectory
    from .motion import Motion, Subject


@dataclass
class Args:
    """Arguments of ``poise view``."""

    source: tyro.conf.Positional[str] = "hand-motion"
    """a recording, an environment (hand-motion, rider-bicycle or an id), or lines of samples from a serial device, a
    named pipe or - for standard input"""
    estimators: tuple[str, ...] = ()
    """names of estimators, see `poise list estimators`; by default some that the channels allow"""
    options: tuple[str, ...] = ()
    """arguments of the environment, as name=value (gesture=fast scenario=slalom)"""
    seed: int = 0
    """of the episode"""
    live: bool = False
    """show an environment while it is simulated, and a text file while lines are added to it"""
    udp: int | None = None
    """show samples that arrive as lines in UDP datagrams on this port"""
    rate: float | None = None
    """rate of lines of samples, Hz; by default estimated from the first 50 stamps"""
    columns: tuple[str, ...] = ()
    """columns of lines of samples, see `poise stream`"""
    units: tuple[str, ...] = ()
    """units of lines of samples where they are not SI, as kind=unit"""
    format: LineFormat = "auto"
    """of lines of samples"""
    baud: int = 115200
    """rate of a serial device"""
    site: str | None = None
    """in a recording of several sensors, the one to show"""
    calibration: Path | None = None
    """record of `poise calibrate` for a recording of raw readings"""
    port: int = 8080
    """port of the page; the next free one if it is taken"""
    host: str = "127.0.0.1"
    """address that the page is served on; 0.0.0.0 for all of this machine"""
    browser: bool = True
    """open the page in the browser"""
    at: float | None = None
    """begin at this time of the motion, s, paused"""
    plot: str | None = None
    """which curves are shown, such as roll or inclination"""
    beside: bool = False
    """show truth and estimates side by side, which is the default without truth"""
    screenshot: Path | None = None
    """write a picture of the page (.png) or a film of the scene (.webp, .gif) with a headless Chromium, and
    exit"""
    until: float | None = None
    """end of the film, s; that of the motion by default"""


def run(args: Args) -> int:
    """Show motion until interrupted."""
    from .picture import FILMS

    sources = () if args.source == "-" else (Path(args.source),)
    check_file("screenshot", args.screenshot, sources, (".png", *FILMS))
    with extra("view"):
        from .viewer import Viewer

    with Output("view", args) as out, interrupted_by_signals(), opened(args, out) as found:
        title, subject, motion, newer, addable, more = found
        if not motion.figures:
            raise ValueError(
                f"{title} has neither a true attitude nor an estimate of one; name --estimators that fit to it"
            )
        viewer = Viewer(
            subject, motion, title, host=args.host, port=args.port, live=newer is not None, addable=addable, more=more
        )
        try:
            # without truth there is nothing in the middle that the others could be compared with
            viewer.begin(args.at, args.plot, beside=args.beside or TRUTH not in motion.figures)
            if args.screenshot is not None:
                return picture(viewer, args, out)
            out.say(f"{title} at {viewer.url} (Ctrl-C ends)")
            if args.browser:
                webbrowser.open(viewer.url)
            viewer.run(newer or (lambda: None))
        except KeyboardInterrupt:
            out.say("")
        finally:
            viewer.close()
    return 0


def picture(viewer: Any, args: Args, out: Output) -> int:
    """Write a picture of the page."""
    from .picture import take_film, take_picture

    assert args.screenshot is not None
    viewer.player.playing = False
    if args.screenshot.suffix.lower() != ".png":
        until = viewer.player.end if args.until is None else args.until
        out.say(f"film: {take_film(viewer, args.screenshot, until)}")
        return 0
    thread = threading.Thread(target=viewer.run, daemon=True)
    thread.start()
    out.say(f"picture: {take_picture(viewer, args.screenshot)}")
    viewer.stopped.set()
    thread.join()
    return 0


@contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Let a termination end like Ctrl-C."""

    def interrupt(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class Opened(NamedTuple):
    """What is shown.

    Attributes:
        title: of the page.
        subject: what moves.
        motion: so far.
        newer: gives the motion that has grown; None: it does not grow.
        addable: names of estimators that may be added.
        more: subject and motion with other estimators, by their names.
    """

    title: str
    subject: Subject
    motion: Motion
    newer: Callable[[], Motion | None] | None = None
    addable: Sequence[str] = ()
    more: Callable[[Sequence[str]], tuple[Subject, Motion]] | None = None


@contextmanager
def opened(args: Args, out: Output) -> Iterator[Opened]:
    """What the arguments ask for, ready to be shown.

    Raises:
        ValueError: an unknown environment, estimator or option, or a recording that cannot be read.
        FileNotFoundError: the source is neither a file nor an environment.
    """
    from .growing import environment_blocks, fed, line_blocks

    lines = args.udp is not None or args.source == "-"
    path = Path(args.source)
    device = path.exists() and not (path.is_file() or path.is_dir())
    if lines or device or (args.live and path.exists()):
        with fed(line_blocks(args), args.estimators) as found:
            yield Opened("samples", *found)
    elif path.exists():
        yield whole(path.name, recording(args, out), args)
    else:
        env_id, env = environment(args)
        with closing(env):
            if args.live:
                with fed(environment_blocks(env, args.seed), with_tuned_filter(args, env).estimators) as found:
                    yield Opened(env_id, *found)
                return
            from ...envs.record import record
            from .shown import tuned_episode

            out.say(f"recording {env_id}, seed {args.seed} (--live shows it at once)")
            trajectory = tuned_episode(env, args.seed) or record(env, seed=args.seed, progress=True)
        yield whole(env_id, trajectory, with_tuned_filter(args, env))


def whole(title: str, trajectory: Trajectory, args: Args) -> Opened:
    """A finished trajectory with its estimates, to which others may be added.

    Raises:
        ValueError: an estimator does not fit to it.
    """
    from ...baselines.registry import list_estimators
    from .shown import finished, usual_estimators

    shown = finished(trajectory, args.estimators or usual_estimators(tuple(trajectory.measurements)))
    addable = [name for name, info in list_estimators().items() if set(info.channels) <= set(trajectory.measurements)]
    return Opened(title, *shown, None, addable, partial(finished, trajectory))


def environment(args: Args) -> tuple[str, Any]:
    """Id of an environment, and the environment.

    Raises:
        FileNotFoundError: there is neither a file nor an environment of this name.
        ValueError: an unknown option.
    """
    from ...envs.registration import make_environment, register_environments
    from ..record import environment_id, options_of

    register_environments()
    try:
        env_id = environment_id(args.source)
    except ValueError as reason:
        raise FileNotFoundError(2, f"no such file, and {reason}", args.source) from None
    return env_id, make_environment(env_id, **options_of(args.options))


def with_tuned_filter(args: Args, env: Any) -> Args:
    """The arguments with the estimators of an environment of gains, where none are named."""
    from .shown import tuned_estimators

    return args if args.estimators else replace(args, estimators=tuned_estimators(env))


def recording(args: Args, out: Output) -> Trajectory:
    """A recording, one of its sensors.

    Raises:
        ValueError: it cannot be read.
    """
    from ..recordings.load import load_all, plain_warnings, sensors_of

    with plain_warnings():
        loaded, _ = load_all([Path(args.source)], args.calibration, args.site)
        trajectory = loaded[0]
        ride = (
            any(name.startswith("bicycle/") for name in trajectory.truth)
            or "bicycle_imu/gyr" in trajectory.measurements
        )
        sensors = [trajectory] if ride else [sensor for one in loaded for sensor in sensors_of(one)]
        if len(sensors) > 1:
            names = ", ".join(str(each.metadata.get("sensor") or each.name) for each in sensors)
            out.say(f"showing the first of {names}; name another one by its file, or by --site")
        return sensors[0].reference_clock_corrected()
