"""A sweep predicted from steady motions: against an oscillator that is swept, and against the rig in time."""

from types import SimpleNamespace
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from savgs_ident.diagnosis import sweep_gap as module
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.problem import ModelPoint
from savgs_ident.diagnosis.sweep_gap import (
    along,
    first_harmonic,
    frequencies_of,
    sweep_shrink,
    swept_motions,
)
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.observations import Data
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.responses.sweeps import estimate_sweep_response
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.validation.virtual_motions import sweep_readings

from .conftest import rig_problem

CHANNELS = ("sprung_accel", "susp_deflection")
RATE, OWN, DAMPING = 0.05, 2.0 * np.pi * 2.3, 0.25
STEADY = np.linspace(0.5, 3.0, 51)
DWELLS = np.array([0.5, 0.9, 1.4, 1.8, 2.0, 2.2, 2.4, 2.7, 3.5, 4.5, 6.0])


def _oscillator(frequency: np.ndarray) -> np.ndarray:
    omega = 2.0 * np.pi * frequency
    return OWN**2 / (OWN**2 - omega**2 + 2j * DAMPING * OWN * omega)


def _swept(frequency: np.ndarray) -> np.ndarray:
    """An oscillator that is swept from rest, against the phase of what drives it, at some frequencies [Hz]."""

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        # In the frame of the phase: x = Re(X exp(i phase)), X complex.
        omega = 2.0 * np.pi * RATE * t
        slope = 2.0 * np.pi * RATE
        amplitude, velocity = x
        force = OWN**2 * (1.0 - amplitude) - 2.0 * DAMPING * OWN * (velocity + 1j * omega * amplitude)
        return np.array([velocity, force - 2j * omega * velocity - (1j * slope - omega**2) * amplitude])

    times = frequency / RATE
    found = solve_ivp(
        rates, (0.0, 60.0), np.array([1.0 + 0j, 0j]), t_eval=times, rtol=1e-9, atol=1e-11, max_step=0.05
    )
    return np.asarray(found.y[0])


def test_peaks_come_late_in_a_sweep() -> None:
    frequency = np.linspace(0.6, 2.9, 60)
    swept = _swept(frequency)
    reported = along(STEADY, _oscillator(STEADY)[:, None], frequency, np.full(60, RATE))[:, 0]
    steady = _oscillator(frequency)
    assert np.abs(swept - steady).max() > 0.02
    assert np.abs(swept - reported).max() < 0.1 * np.abs(swept - steady).max()


def _sweep(
    low: float = 0.06, high: float = 2.95, channels: tuple[str, ...] = ("sprung_accel",)
) -> SweepResponse:
    frequency = np.linspace(low, high, 50)
    count = len(channels)
    return SweepResponse(
        test="sweep",
        channels=channels,
        time=frequency / RATE,
        frequency=frequency,
        frequency_sd=np.zeros(50),
        sweep_rate=np.full(50, RATE),
        window_s=np.ones(50),
        input_amplitude=np.full(50, 0.01375),
        response=np.repeat(_oscillator(frequency)[:, None], count, axis=1),
        response_sd=np.full((50, count), 0.01),
        valid=np.ones((50, count), bool),
    )


def test_motions_are_found_at_the_dwells_in_range_and_between() -> None:
    found = frequencies_of(DWELLS, _sweep(), DEFAULTS.sweep_dwells)
    assert found is not None
    assert found.size == DWELLS.size
    assert (np.diff(found) > 0.0).all()
    assert set(DWELLS[DWELLS < 2.95]) <= set(found.tolist())
    assert found[-1] == pytest.approx(2.95)
    assert frequencies_of(DWELLS[4:], _sweep(), DEFAULTS.sweep_dwells) is None
    assert frequencies_of(DWELLS[4:], _sweep(), 4) is not None


def test_where_all_dwells_lie_in_the_sweep_it_is_compared_as_far_as_they_reach() -> None:
    found = frequencies_of(DWELLS[:7], _sweep(), DEFAULTS.sweep_dwells)
    assert found is not None
    assert found.tolist() == DWELLS[:7].tolist()


def test_the_gap_is_relative_to_the_response_and_leaves_out_what_no_dwell_reaches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    excitation, dwells = Excitation(jnp.asarray(DWELLS), {}), np.arange(len(DWELLS))
    given = {"excitation": excitation, "dwells": dwells, "channels": CHANNELS, "constants": DEFAULTS}
    plant = cast(Any, SimpleNamespace(**given))
    sweep = _sweep()

    def reported(point: ModelPoint, known: float) -> Any:
        return None if point.terms else np.full((len(DWELLS), 2), known)

    def as_dwells(frequencies: Any, steady: Any, frequency: Any, rate: Any) -> Any:
        low = frequency < 0.5
        return np.where(low[:, None], 99.0, steady[0, 0] * np.repeat(sweep.response, 2, axis=1))

    monkeypatch.setattr(module, "swept_motions", lambda point, sweep, frequencies: point.values["gain"])
    monkeypatch.setattr(module, "first_harmonic", reported)
    monkeypatch.setattr(module, "along", as_dwells)
    baselines = [ModelPoint(plant, (), {"gain": gain}) for gain in (1.2, 0.9)]
    found = sweep_shrink(sweep, [*baselines, ModelPoint(plant, ("lag",), {})])
    assert found is not None
    assert (found.before, found.recalibrated) == (pytest.approx(0.2), pytest.approx(0.1))
    assert np.isnan(found.after)
    seen = sweep.response[sweep.frequency >= 0.5]
    assert found.floor == pytest.approx(0.01 * np.sqrt(2.0 * seen.size / np.sum(np.abs(seen) ** 2)))
    assert np.isnan(sweep_shrink(sweep, baselines).after)  # type: ignore[union-attr]
    assert sweep_shrink(_sweep(channels=("motor_current",)), baselines) is None


@pytest.mark.slow
def test_the_rig_swept_in_time_answers_as_predicted(rig: Rig, nominal_campaign) -> None:
    """Within a hundredth of the response, where a dwell as slow would be off by more near the peak."""
    campaign = load_campaign(nominal_campaign)
    measured = estimate_response(campaign, 9)
    plant, _ = rig_problem(measured, rig, dict(CATALOGUE))
    model = build_model(rig, MODELS["simtr"])
    times, readings = sweep_readings(model, plant.values({}), 60.0, 3.0, 500.0)
    road = 0.01375 * np.sin(np.pi * RATE * times**2)
    channels = {
        name: RecordedChannel(name, RIG_LAYOUT.si_unit(name), times, values)
        for name, values in zip(
            ("road_height", "sprung_accel", "susp_deflection"), (road, *readings), strict=True
        )
    }
    sweep = estimate_sweep_response(Recording("sweep", "sweep", None, channels), "road_height")
    frequencies = frequencies_of(np.asarray(plant.excitation.frequency), sweep, DEFAULTS.sweep_dwells)
    assert frequencies is not None
    baseline = ModelPoint(plant, (), {})
    found = first_harmonic(baseline, swept_motions(baseline, sweep, frequencies))
    assert found is not None
    reported = along(frequencies, found, sweep.frequency, sweep.sweep_rate)
    rows = (sweep.frequency > frequencies[0]) & (sweep.frequency < frequencies[-1])
    for place, name in enumerate(("sprung_accel", "susp_deflection")):
        seen = sweep.response[rows, sweep.channel(name)]
        assert np.linalg.norm(seen - reported[rows, place]) < 0.01 * np.linalg.norm(seen)


@pytest.mark.slow
def test_what_a_corrected_model_does_in_a_sweep_is_found_from_the_baselines_motions(
    plant_and_data: tuple[DwellProblem, Data],
) -> None:
    """The same as from a cold start of a model of its own, but for where nodes fall."""
    plant, _ = plant_and_data
    values = {"mount_compliance": 2e-6, "mount_damping": 500.0}
    slow = plant.excitation.frequency * 0.9
    motions = swept_motions(ModelPoint(plant, (), {}), _sweep(), np.asarray(slow))
    found = first_harmonic(ModelPoint(plant, ("mount_compliance",), values), motions)
    without = first_harmonic(ModelPoint(plant, (), {}), motions)
    assert found is not None
    assert without is not None
    model, p = plant.model(("mount_compliance",)), plant.values(values)
    cold = simulate_periodic(model, p, motions.excitation, plant.settings, plant.layout)
    own = np.asarray(harmonics(model, p, cold, plant.orders))[:, :, 1] / 0.01375
    assert np.abs(found - own).max() < 5e-3 * np.abs(own).max()
    assert np.abs(found - without).max() > 0.1 * np.abs(own).max()
