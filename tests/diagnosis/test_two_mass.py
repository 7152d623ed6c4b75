"""A diagnosis of the linear two-mass plant: nothing but generic laws at the ports that it declares."""

from collections.abc import Iterator, Mapping

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.diagnosis.learning import learn
from savgs_ident.diagnosis.localisation import localise
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.verdict import most_probable
from savgs_ident.effects.base import Family
from savgs_ident.effects.effect import Effect, generic_effects, typical_effect
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.two_mass import GUIDE, PARAMETERS, SUSPENSION, TwoMass
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.validation.foreign_forces import Clearance

from ..relaxed import as_users_have_it
from .simple_laws import assert_a_law_of_one_function
from .toy import forward_selection

FREQUENCY = np.array([0.7, 1.0, 1.4, 1.9, 2.6, 4.0, 8.0, 12.0])
STROKE, ORDERS, NOISE = 0.01, 5, 1e-3
TRUTH = {"m_s": 321.0, "k": 6.3e4, "c": 2.2e3, "k_t": 2.79e5}
"""The plant that is recorded, not the one of the sheet."""

CATALOGUE = generic_effects(TwoMass.ports)
LEFT_OUT = {
    "suspension_friction",
    "tyre_friction",
    "mount_massive_compliance",
    "mount_backlash",
    "mount_resonance",
}
"""Laws with states, for each of which programs are compiled: the fast tests look for one of them, not for all."""

FEWER = {name: effect for name, effect in CATALOGUE.items() if name not in LEFT_OUT}
SETTINGS = PeriodicSettings(nodes=192, adaptations=1)
CHANNELS = ("road_height", *(each.name for each in TwoMass.channels))

LOCATIONS = {
    "suspension",
    "guide",
    "tyre",
    "road",
    "inertia",
    "sensor.body_accel",
    "sensor.susp_deflection",
}


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with as_users_have_it():
        yield


def _recorded(there: Effect, numbers: Mapping[str, float]) -> HarmonicResponse:
    """Dwells of the plant with an effect, and noise of a thousandth of the first harmonic."""
    rng = np.random.default_rng(3)
    model = TwoMass() + there
    own = ParameterTable(there.parameters).with_values(numbers)
    road = np.zeros((FREQUENCY.size, 2), complex)
    road[:, 1] = STROKE
    excitation = Excitation(jnp.asarray(FREQUENCY), {"road_height": jnp.asarray(road)})
    p = as_values((PARAMETERS.with_values(TRUTH) + own).as_dict())
    solution = simulate_periodic(model, p, excitation, PeriodicSettings(nodes=384))
    assert all(status.ok for status in solution.status())
    seen = np.zeros((FREQUENCY.size, len(CHANNELS), ORDERS + 1), complex)
    seen[:, 0, :2] = road
    seen[:, 1:] = np.asarray(harmonics(model, p, solution, ORDERS))
    sd = NOISE * np.abs(seen[:, :, 1])
    noise = rng.standard_normal(seen.shape) + 1j * rng.standard_normal(seen.shape)
    seen[:, 1:] += (sd[:, :, None] * noise)[:, 1:]
    covariance = sd[:, :, None, None, None] ** 2 * np.ones(ORDERS + 1)[:, None, None] * np.eye(2)
    flat = np.zeros(sd.shape)
    return HarmonicResponse(
        tests=tuple(f"dwell_{f}Hz" for f in FREQUENCY),
        channels=CHANNELS,
        frequency=FREQUENCY,
        frequency_sd=np.zeros(FREQUENCY.size),
        harmonics=seen,
        covariance=covariance,
        valid=np.ones(seen.shape, bool),
        peak_to_peak=flat,
        peak_to_peak_sd=flat,
        noise_sd=sd,
        periods=np.full(FREQUENCY.size, 20),
    )


Case = tuple[DwellProblem, Search, LaplaceFit]


def _recalibrated(measured: HarmonicResponse, catalogue: Mapping[str, Effect]) -> Case:
    problem, data = dwell_problem(
        measured, TwoMass(), PARAMETERS, catalogue, free=("k", "c"), orders=ORDERS, settings=SETTINGS
    )
    search = search_of(problem, data)
    return problem, search, find_map(search, (), {}, problem.start({}))


@pytest.fixture(scope="module")
def rubbing() -> Case:
    """The plant without friction on recordings of one whose guide rubs."""
    return _recalibrated(_recorded(CATALOGUE["guide_coulomb"], {"guide_coulomb_coefficient": 0.02}), FEWER)


def _found_and_located(case: Case, location: str, alike: set[str]) -> None:
    problem, search, base = case
    assert base.status.ok
    places = problem.locations((), base.values, base.prediction.warm_start)
    assert {each.name for each in places} == LOCATIONS
    found = localise(search, base, places)
    assert max(found, key=lambda each: each.evidence).name == location
    findings = forward_selection(search, base, problem.candidates, problem.known)
    assert set(most_probable(findings).terms) <= alike
    assert len(most_probable(findings).terms) == 1


@pytest.mark.slow
def test_friction_is_found_and_located(rubbing: Case) -> None:
    """Where the load is constant, friction in proportion to it is the one that needs no load."""
    _found_and_located(rubbing, "guide", {"guide_coulomb", "guide_preload"})


@pytest.mark.slow
def test_a_mount_is_found_and_located_among_all_laws() -> None:
    measured = _recorded(CATALOGUE["mount_compliance"], {"mount_compliance_compliance": 1e-6})
    _found_and_located(_recalibrated(measured, CATALOGUE), "suspension", {"mount_compliance"})


@pytest.mark.slow
def test_a_clearance_whose_contact_takes_energy_is_learned_as_a_stop() -> None:
    """Its force is that of a spring and of a damper, both beyond the clearance alone."""
    clearance = typical_effect("clearance", SUSPENSION, Clearance(), {"gap": 2e-3, "dissipation": 2.0})
    stiffness = 0.1 * TRUTH["k"]
    problem, search, base = _recalibrated(_recorded(clearance, {"clearance_stiffness": stiffness}), {})
    guide, law = learn(problem, search.data, base, [GUIDE, SUSPENSION])
    assert (guide.port, law.port) == (GUIDE, SUSPENSION)
    assert law.mode.status.ok
    assert law.only is Family.STOP
    assert law.mode.evidence > base.evidence + 50.0
    assert guide.mode.evidence < law.mode.evidence - DEFAULTS.alarm_log_odds


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "port"),
    [
        ("road_scale", "road"),
        ("guide_viscous", "guide"),
        ("suspension_stiffness", "suspension"),
        ("potentiometer_delay", "sensor.susp_deflection"),
    ],
)
def test_what_is_simple_has_a_law_of_one_function_at_its_port(rubbing: Case, effect: str, port: str) -> None:
    problem, search, base = rubbing
    start = base.prediction.warm_start
    assert_a_law_of_one_function(problem, search.data, base.values, start, effect, port)
