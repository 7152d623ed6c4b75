"""A motion in any recording, and the force of its drive: at any rate, from any clock, and without a second cycle."""

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.driven_motion import ROWS_HZ
from savgs_ident.responses.recorded_motion import FAST_HZ, recorded_motion, recorded_speed

SEED = 3


def _recording(
    time: NDArray[np.float64], repeats: bool, noise: float, lag: float = 0.0, stretched: float = 0.0
) -> Recording:
    """A mass of 3 kg with a friction of 2 N, led on a sum of sines of 4 s, or of none that repeat."""
    rates = (0.25, 0.75, 1.5) if repeats else (0.2371, 0.7093, 1.4177)
    random = np.random.default_rng(SEED)
    stamps = time + stretched * random.uniform(-1.0, 1.0, time.size) * (time[1] - time[0])

    def led(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        w = 2.0 * np.pi * np.array(rates)[:, None]
        sizes = np.array([0.1, 0.04, 0.02])[:, None]
        x, v, a = sizes * np.sin(w * t), sizes * w * np.cos(w * t), -sizes * w**2 * np.sin(w * t)
        return x.sum(0), v.sum(0), a.sum(0)

    x, _, _ = led(stamps)
    _, v, a = led(time + lag)
    force = 3.0 * a + 2.0 * np.sign(v) + noise * random.standard_normal(time.size)
    channels = {
        "x": RecordedChannel("x", "m", stamps, x),
        "drive": RecordedChannel("drive", "N", time + lag, force),
    }
    return Recording("run", "other", None, channels)


@pytest.mark.parametrize("rate", [80.0, 250.0, 1000.0])
@pytest.mark.parametrize("repeats", [True, False])
def test_its_noise_is_that_of_the_force_at_any_rate(rate: float, repeats: bool) -> None:
    """White noise of one sample, after the low-pass and thinning of the rows."""
    time, noise = np.arange(round(40.0 * rate)) / rate, 0.05
    motion = recorded_motion(_recording(time, repeats, noise), "x", "drive", "here")
    white = noise * np.random.default_rng(1).standard_normal(time.size)
    wanted = float(np.std(motion.rows(white)))
    assert motion.noise == pytest.approx(wanted, rel=0.25)
    assert motion.period == pytest.approx(4.0 if repeats else time.size / rate, rel=1e-9)
    assert [each.code for each in motion.warnings] == ([] if repeats else ["noise_assumed"])


def test_clocks_that_are_uneven_or_apart_are_brought_together() -> None:
    """By a third of a step of jitter, and a drive whose clock begins later: the same motion to a thousandth."""
    time = np.arange(8000) / 200.0
    plain = recorded_motion(_recording(time, True, 0.0), "x", "drive", "here")
    moved = recorded_motion(_recording(time, True, 0.0, lag=0.0125, stretched=0.3), "x", "drive", "here")
    shift = 0.0125
    there = np.interp(
        plain.step * np.arange(plain.position.size),
        shift + moved.step * np.arange(moved.position.size),
        moved.position,
    )
    inner = slice(400, -400)
    assert np.max(np.abs(there - plain.position)[inner]) < 1e-3 * np.max(np.abs(plain.position))


def test_what_cannot_be_used_is_refused_with_its_place() -> None:
    time = np.arange(400) / 200.0
    with pytest.raises(InputError, match=r"here.*channel 'velocity': was not recorded"):
        recorded_motion(_recording(time, True, 0.1), "velocity", "drive", "here")
    with pytest.raises(InputError, match="is too short"):
        recorded_motion(_recording(time[:100], True, 0.1), "x", "drive", "here")


def _standing_at_times(count: float) -> tuple[Recording, NDArray[np.bool_], NDArray[np.float64]]:
    """The same mass where it stands for a third of the time, and the friction then is whatever holds it.

    Its position is read in steps of ``count`` [m]. Beside it whether it moves and at which speed [m/s], (n,) each.
    """
    time = np.arange(20000) / 1000.0
    wave = np.sin(2.0 * np.pi * 0.31 * time)
    v = np.sign(wave) * np.maximum(np.abs(wave) - 0.5, 0.0)
    x = np.concatenate([[0.0], np.cumsum(0.5e-3 * (v[1:] + v[:-1]))])
    held = 1.9 * np.sin(2.0 * np.pi * 1.7 * time)
    force = 3.0 * np.gradient(v, 1e-3) + np.where(v == 0.0, held, 2.0 * np.sign(v))
    force += 0.05 * np.random.default_rng(SEED).standard_normal(time.size)
    channels = {
        "x": RecordedChannel("x", "m", time, count * np.round(x / count)),
        "drive": RecordedChannel("drive", "N", time, force),
    }
    return Recording("run", "other", None, channels), v != 0.0, v


@pytest.mark.parametrize("count", [1e-5, 2e-5])
def test_where_the_motion_does_not_show_which_way_it_goes_no_row_is_compared(count: float) -> None:
    recording, moves, v = _standing_at_times(count)
    motion = recorded_motion(recording, "x", "drive", "here")
    assert "slower_than_resolved" in [each.code for each in motion.warnings]
    assert np.mean(motion.still[~moves]) > 0.98
    assert not motion.still[np.abs(v) > 0.3 * np.abs(v).max()].any()
    columns = np.stack([motion.rows(motion.acceleration), motion.rows(np.sign(v))], axis=1)
    force = motion.rows(motion.drive)
    assert len(force) == motion.row_times.size == motion.blocks.size < 0.75 * 20.0 * ROWS_HZ
    assert np.array_equal(np.unique(motion.blocks), np.arange(motion.blocks.max() + 1))
    found, errors = _least_squares(columns / motion.noise, force / motion.noise)
    truth = np.array([3.0, 2.0])
    assert np.all(np.abs(found - truth) < 4.0 * errors)
    assert np.all(errors < 0.02 * truth)
    assert np.mean(((force - columns @ found) / motion.noise) ** 2) < 1.3


def test_what_hardly_moves_for_its_sensor_is_refused() -> None:
    recording, _, _ = _standing_at_times(0.1)
    with pytest.raises(InputError, match="slower than its sensor resolves nearly all the time"):
        recorded_motion(recording, "x", "drive", "here")


def _least_squares(
    columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimates and their standard errors for rows of unit variance."""
    covariance = np.linalg.inv(columns.T @ columns)
    return covariance @ columns.T @ rows, np.sqrt(np.diag(covariance))


def test_a_slow_steady_motion_is_compared_though_its_noise_turns_it_round() -> None:
    """At the speed's own noise, a fifth of which is left in the mean of 25 samples: it is known which way it goes."""
    time, random = np.arange(4000) / 100.0, np.random.default_rng(SEED)
    speed = 0.1 + 0.1 * random.standard_normal(time.size)
    channels = {
        "v": RecordedChannel("v", "m/s", time, speed),
        "drive": RecordedChannel("drive", "N", time, 2.0 + 0.05 * random.standard_normal(time.size)),
    }
    motion = recorded_speed(Recording("run", "other", None, channels), "v", "drive", "here")
    assert motion.still.mean() < 0.2


@pytest.mark.parametrize("times", [16.0, 64.0])
def test_a_motion_that_is_so_many_times_as_fast_has_as_many_rows_and_the_same_noise(times: float) -> None:
    """That of a shaker beside that of a slow axis: rows and blocks of the same samples, of the same force."""
    time = np.arange(20000) / 500.0
    slow = _recording(time, False, 0.05)
    channels = {
        name: RecordedChannel(name, each.unit, each.time / times, each.values)
        for name, each in slow.channels.items()
    }
    known = recorded_motion(slow, "x", "drive", "here")
    found = recorded_motion(Recording("run", "other", None, channels), "x", "drive", "here")
    assert known.time_scale == 1.0
    x = slow.channels["x"].values
    power = np.abs(np.fft.rfft(x - x.mean())) ** 2
    middle = times * np.average(np.fft.rfftfreq(x.size, 1.0 / 500.0), weights=power)
    assert 0.5 * FAST_HZ < middle * found.time_scale <= FAST_HZ
    spacing = found.every * found.step / found.time_scale
    assert spacing == pytest.approx(1.0 / ROWS_HZ, rel=0.3)
    same = known.rows(known.drive), found.rows(found.drive)
    assert abs(np.std(same[0]) / np.std(same[1]) - 1.0) < 0.02
