"""What the benchmarks measure with: errors, harmonics of an integrated period, processes."""

import sys

import numpy as np
import pytest

from benchmarks.motion import SAMPLES, period_harmonics, settling_periods
from benchmarks.processes import run_process
from benchmarks.task import ORDERS, Task, errors_percent
from savgs_ident.core.values import as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.dynamics import section_curves
from savgs_ident.plants.quarter_car.rig import Rig


@pytest.fixture
def task(rig: Rig) -> Task:
    effects = MODELS["simtr"]
    values = as_values(model_parameters(rig, effects).as_dict())
    curves = section_curves(values)
    model = build_model(rig, effects)
    return Task(model, values, np.array([0.8, 3.0]), 0.01375, 1.5, curves, np.zeros(5))


def test_error_counts_from_the_first_harmonic_and_leaves_the_mean_out() -> None:
    reference = np.zeros((2, 2, ORDERS + 1), dtype=np.complex128)
    reference[..., 1] = 2.0j
    response = reference.copy()
    response[:, :, 0] = 5.0
    response[0, 1, 7] = 0.02
    response[1, 0, 1] += 0.1
    np.testing.assert_allclose(errors_percent(response, reference), [1.0, 5.0], rtol=1e-12)


def test_acceleration_of_a_sampled_motion(task: Task) -> None:
    """z'' = Re sum_k a_k exp(2 pi i k f t), k = 0..5, from its velocity alone, a mean acceleration included."""
    random = np.random.default_rng(3)
    wanted = random.standard_normal((2, 6)) + 1j * random.standard_normal((2, 6))
    wanted[:, 0] = wanted[:, 0].real
    order, turns = np.arange(1, 6), np.arange(SAMPLES + 1) / SAMPLES
    states = np.zeros((2, SAMPLES + 1, 5))
    for dwell, frequency in enumerate(task.frequency):
        swing = wanted[dwell, 1:] / (2j * np.pi * order * frequency)
        periodic = (np.exp(2j * np.pi * turns[:, None] * order) @ swing).real
        states[dwell, :, 2] = periodic + wanted[dwell, 0].real * turns / frequency
    found = period_harmonics(task, states)[:, 0]
    # The trapezoidal rule takes x / tan(x), x = pi k / N, for 1 on a ramp: 1 - x^2 / 3.
    excess = 2.0 / 3.0 * (np.pi * np.arange(ORDERS + 1) / SAMPLES) ** 2
    expected = wanted[:, :1] * excess + np.pad(wanted, ((0, 0), (0, ORDERS - 5)))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_acceleration_of_a_periodic_motion_is_exact(task: Task) -> None:
    states = np.zeros((2, SAMPLES + 1, 5))
    turns = np.arange(SAMPLES + 1) / SAMPLES
    states[:, :, 2] = np.sin(2.0 * np.pi * 3.0 * turns)
    found = period_harmonics(task, states)[:, 0]
    wanted = np.zeros((2, ORDERS + 1), dtype=np.complex128)
    wanted[:, 3] = 2.0 * np.pi * 3.0 * task.frequency
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_deflection_at_the_drawing_is_zero(task: Task) -> None:
    found = period_harmonics(task, np.zeros((2, SAMPLES + 1, 5)))
    np.testing.assert_allclose(found, 0.0, atol=1e-12)


def test_settling_takes_whole_periods() -> None:
    np.testing.assert_array_equal(settling_periods(np.array([0.5, 2.0, 6.0]), 2.1), [2.0, 5.0, 13.0])


@pytest.mark.skipif(sys.platform == "win32", reason="memory of a process is measured on POSIX")
def test_process_is_measured() -> None:
    small = run_process(["-c", "print('done')"])
    large = run_process(["-c", "block = bytearray(200_000_000); block[::4096] = bytes(len(block[::4096]))"])
    assert (small.code, small.output.strip()) == (0, "done")
    assert large.peak_mb - small.peak_mb == pytest.approx(200.0, abs=20.0)
    waited = run_process(["-c", "import time, sys; time.sleep(0.5); sys.exit(3)"])
    assert waited.code == 3
    assert waited.seconds > 0.5
