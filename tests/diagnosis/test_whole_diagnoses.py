"""One whole diagnosis for each kind of verdict, on the linear two masses: seconds each, all stages of it.

Of a learned law, and by other constants, where slow.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.values import Values, as_values
from savgs_ident.diagnosis.candidates import WITHIN
from savgs_ident.diagnosis.diagnose import Watch, baseline_problem, diagnose_dwells, nobody
from savgs_ident.diagnosis.evidence import DiagnosisProblem, FittedHypotheses
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings, Verdict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role
from savgs_ident.effects.effect import Effect, effect_at, generic_effects
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.validation.foreign_laws import SecondOrderFilter
from savgs_ident.validation.varied_constants import VARIED, vary_constants

from ..relaxed import as_users_have_it

FREQUENCY = np.array([0.7, 1.0, 1.4, 1.9, 2.6, 4.0, 6.0, 8.0, 12.0])
STROKE, ORDERS, NOISE = 0.01, 3, 1e-3
TRUTH = {"m_s": 321.0, "k": 6.3e4, "c": 2.2e3, "k_t": 2.79e5}
CHANNELS = ("road_height", *(each.name for each in TwoMass.channels))
ALL = generic_effects(TwoMass.ports)
OFFERED = (
    "guide_viscous",
    "suspension_stiffness",
    "potentiometer_delay",
    "accelerometer_gain",
    "tyre_stiffness",
)


class CubicDamping(AbstractForceLaw):
    """A force against the velocity that grows with its cube: no law of the catalogue."""

    name: ClassVar[str] = "cubic_damping"
    family: ClassVar[Family] = Family.DAMPING
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {"coefficient": 3000.0}

    def force(self, v: Values, signals: PortSignals, state: jnp.ndarray) -> jnp.ndarray:
        return -v["coefficient"] * signals.velocity**3


GUIDE, ACCELEROMETER = (
    next(port for port in TwoMass.ports if port.name == name) for name in ("guide", "accelerometer")
)
FOREIGN = effect_at("guide_cubic", GUIDE, CubicDamping(), {"coefficient": 3000.0})


FILTERED = effect_at("filtered", ACCELEROMETER, SecondOrderFilter(), {"time": 2.1e-3, "damping_ratio": 1.4})


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with as_users_have_it():
        yield


def _recorded(
    *effects: Effect,
    miss: float = 0.0,
    numbers: Mapping[str, float] = TRUTH,
    frequency: NDArray[np.float64] = FREQUENCY,
    noise: float = NOISE,
) -> HarmonicResponse:
    """Dwells of the plant with effects of typical size; ``miss`` is a relative error of every test by itself."""
    random, model = np.random.default_rng(5), TwoMass()
    for each in effects:
        model = model + each
    own = [parameter for each in effects for parameter in each.parameters]
    p = as_values((PARAMETERS.with_values(numbers) + ParameterTable(tuple(own))).as_dict())
    road = np.zeros((frequency.size, 2), complex)
    road[:, 1] = STROKE
    excitation = Excitation(jnp.asarray(frequency), {"road_height": jnp.asarray(road)})
    solution = simulate_periodic(model, p, excitation, PeriodicSettings(nodes=256))
    assert all(status.ok for status in solution.status())
    seen = np.zeros((frequency.size, len(CHANNELS), ORDERS + 1), complex)
    seen[:, 0, :2] = road
    seen[:, 1:] = np.asarray(harmonics(model, p, solution, ORDERS))
    seen[:, 1:] *= np.exp(miss * random.standard_normal((frequency.size, len(CHANNELS) - 1, 1)))
    sd = noise * np.abs(seen[:, :, 1])
    drawn = random.standard_normal(seen.shape) + 1j * random.standard_normal(seen.shape)
    seen[:, 1:] += (sd[:, :, None] * drawn)[:, 1:]
    return HarmonicResponse(
        tests=tuple(f"dwell_{f}Hz" for f in frequency),
        channels=CHANNELS,
        frequency=frequency,
        frequency_sd=np.zeros(frequency.size),
        harmonics=seen,
        covariance=sd[:, :, None, None, None] ** 2 * np.ones(ORDERS + 1)[:, None, None] * np.eye(2),
        valid=np.ones(seen.shape, bool),
        peak_to_peak=np.zeros(sd.shape),
        peak_to_peak_sd=np.zeros(sd.shape),
        noise_sd=sd,
        periods=np.full(frequency.size, 20),
    )


def _diagnosed(
    response: HarmonicResponse, watch: Watch = nobody, names: tuple[str, ...] = OFFERED
) -> Diagnosis:
    settings = DiagnosisSettings(
        "two_mass", free=("k", "c"), orders=ORDERS, periodic=PeriodicSettings(nodes=128, adaptations=0)
    )
    offered = {name: ALL[name] for name in names}
    problem, data = baseline_problem(response, TwoMass(), PARAMETERS, offered, settings)
    return diagnose_dwells(
        problem, data, response, PlantModel(TwoMass(), PARAMETERS), settings, {}, watch=watch
    )


def _varied() -> tuple[dict[str, dict[float, Verdict]], Watch]:
    """Verdicts by other constants, filled by what watches a diagnosis."""
    varied: dict[str, dict[float, Verdict]] = {}

    def watch(problem: DiagnosisProblem, fitted: FittedHypotheses) -> None:
        varied.update(vary_constants(problem, fitted, {}, (0.5, 1.0, 2.0)))

    return varied, watch


def _missing(found: Diagnosis) -> float:
    """The recalibrated gap beyond the noise [1]."""
    return float(np.sqrt(max(found.shrink.recalibrated**2 - found.shrink.floor**2, 0.0)))


def test_nothing_is_missing() -> None:
    found = _diagnosed(_recorded())
    assert found.verdict.kind == "none"
    assert found.converged
    assert _missing(found) < DEFAULTS.material_share
    assert found.parameters["k"] == pytest.approx(TRUTH["k"], rel=0.01)


@pytest.mark.slow
def test_the_odds_of_nothing_are_in_proportion_to_its_prior() -> None:
    varied, watch = _varied()
    _diagnosed(_recorded(), watch)
    # Effects too small to matter count too, and do not share its prior; that a tolerance does not hold shares it.
    odds = [each.probability / (1.0 - each.probability) for each in varied["prior_none"].values()]
    assert odds[2] - odds[1] == pytest.approx(2.0 * (odds[1] - odds[0]), rel=0.05)
    assert odds[2] > 3.5 * odds[0]


def test_an_effect_is_named() -> None:
    found = _diagnosed(_recorded(ALL["guide_viscous"]))
    assert (found.verdict.kind, found.verdict.effects) == ("effect", ("guide_viscous",))
    assert found.verdict.law_known
    assert found.shrink.closed_by_effect > 0.98
    (damping,) = found.candidates[0].parameters
    assert damping.lo < ALL["guide_viscous"].parameters[0].value < damping.hi
    # Its force is in proportion to its coefficient, and so is the error of that.
    error = 0.5 * (damping.hi - damping.lo) / WITHIN / damping.value
    assert len(found.loops) == 3
    for loop in found.loops:
        np.testing.assert_allclose(loop.law_sd, error * np.abs(loop.law), atol=1e-6 * np.abs(loop.law).max())
        assert not loop.nearest.size


@pytest.mark.parametrize("times", [1.4, pytest.param(2.3, marks=pytest.mark.slow)])
def test_a_number_far_off_its_sheet_is_the_effect_that_does_the_same(times: float) -> None:
    """Calibration takes up the first. That a tolerance does not hold is nothing unknown where it is an effect."""
    found = _diagnosed(_recorded(numbers=TRUTH | {"k_t": times * PARAMETERS["k_t"].value}))
    assert (found.verdict.kind, found.verdict.effects) == ("effect", ("tyre_stiffness",))
    assert found.verdict.probability > 0.9
    assert found.shrink.after < 1.3 * found.shrink.floor


@pytest.mark.slow
@pytest.mark.parametrize("tolerances", [-9.0, 12.0])
def test_a_number_that_is_off_beside_an_effect_is_said_with_it(tolerances: float) -> None:
    """The catalogue has no change of the unsprung mass."""
    sheet = PARAMETERS["m_u"]
    numbers = TRUTH | {"m_u": sheet.value + tolerances * sheet.tolerance}
    found = _diagnosed(_recorded(ALL["guide_viscous"], numbers=numbers))
    assert found.verdict.effects == ("guide_viscous",)
    assert found.verdict.probability > 0.9
    off = re.search(
        r"Besides, the model needs `m_u` ([0-9.]+) tolerances (above|below)", found.verdict.sentence
    )
    assert off is not None
    assert float(off[1]) == pytest.approx(abs(tolerances), rel=0.1)
    assert off[2] == ("above" if tolerances > 0.0 else "below")


def test_a_single_test_is_refused() -> None:
    with pytest.raises(InputError, match="one test only"):
        _diagnosed(_recorded(ALL["guide_viscous"], frequency=FREQUENCY[3:4]))


@pytest.mark.slow
@pytest.mark.parametrize(("dwells", "noise"), [(3, NOISE), (9, 3.0 * NOISE)])
def test_what_is_strong_is_named_from_few_tests_and_in_noise(dwells: int, noise: float) -> None:
    frequency = FREQUENCY[:: FREQUENCY.size // dwells]
    found = _diagnosed(_recorded(ALL["guide_viscous"], frequency=frequency, noise=noise))
    assert found.verdict.effects == ("guide_viscous",)
    assert any("held-out tests are rough" in each for each in found.warnings) == (dwells < 4)


@pytest.mark.slow
def test_nothing_is_named_in_noise_where_nothing_is_missing() -> None:
    for frequency in (FREQUENCY, FREQUENCY[::3]):
        assert _diagnosed(_recorded(frequency=frequency, noise=3.0 * NOISE)).verdict.kind == "none"


TWO = (ALL["guide_viscous"], ALL["potentiometer_delay"])


def test_two_effects_are_named() -> None:
    found = _diagnosed(_recorded(*TWO))
    assert found.verdict.kind == "several"
    assert set(found.verdict.effects) == {each.name for each in TWO}
    assert found.shrink.closed_by_effect > 0.98


@pytest.mark.slow
def test_two_effects_would_be_named_by_other_constants() -> None:
    varied, watch = _varied()
    found = _diagnosed(_recorded(*TWO), watch)
    verdicts = [each for by_factor in varied.values() for each in by_factor.values()]
    assert len(verdicts) == 3 * len(VARIED)
    assert {each[1.0] for each in varied.values()} == {found.verdict}
    assert {(each.kind, each.effects, each.ports) for each in verdicts} == {
        (found.verdict.kind, found.verdict.effects, found.verdict.ports)
    }


@pytest.mark.slow
def test_a_law_that_the_catalogue_does_not_have_is_learned_at_its_port() -> None:
    varied, watch = _varied()
    found = _diagnosed(_recorded(FOREIGN), watch)
    assert {each[1.0] for each in varied.values()} == {found.verdict}
    assert (found.verdict.kind, found.verdict.ports) == ("effect", ("guide",))
    assert not found.verdict.law_known
    assert tuple(map(str, found.verdict.families)) == ("guide/damping",)
    assert found.shrink.closed_by_effect > 0.9
    assert found.learned is not None
    for loop in found.loops:
        truth = -3000.0 * loop.velocity**3
        learned, formula = (np.sqrt(np.mean((each - truth) ** 2)) for each in (loop.law, loop.nearest))
        print(
            loop.frequency_hz, learned, formula, np.sqrt(np.mean(truth**2)), np.sqrt(np.mean(loop.law_sd**2))
        )
    # What a force with the cube of the velocity does not need is not in the law.
    assert 1 <= sum(each.value != 0.0 for each in found.learned.parameters) <= 4


SIZES = {
    **dict.fromkeys(("guide_preload", "guide_stribeck", "guide_saturating_friction"), 1.0),
    **dict.fromkeys(("guide_oscillator", "guide_stiffness", "guide_stiffening"), 1.0),
    **dict.fromkeys(("mount_compliance", "mount_massive_compliance", "mount_resonance"), 1.0),
    **dict.fromkeys(("accelerometer_gain", "accelerometer_lag", "accelerometer_delay"), 1.0),
    **dict.fromkeys(("guide_coulomb", "guide_asymmetry", "tyre_friction"), 0.3),
    **dict.fromkeys(("guide_lower_stop", "guide_upper_stop"), 0.05),
    "mount_backlash": 0.1,
    "inertia_m_s_offset": 3.0,
    "road_scale": 1.0,
    "road_harmonics": 4.0,
}
"""An effect of every law that suits the plant, but for those of other tests here, and its typical sizes [1]."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "times"), SIZES.items(), ids=SIZES)
def test_every_law_of_the_catalogue_is_named_where_it_is_true(name: str, times: float) -> None:
    """Not a sum of functions, which could do the same at its port or at another one."""
    effect, null = ALL[name], ALL[name].null
    sized = [
        replace(each, value=null[each.name] + times * (each.value - null[each.name]))
        if each.name in null
        else each
        for each in effect.parameters
    ]
    recorded = _recorded(replace(effect, parameters=tuple(sized)))
    found = _diagnosed(recorded, names=tuple(dict.fromkeys((name, *OFFERED))))
    assert (found.verdict.kind, found.verdict.effects) == ("effect", (name,))
    assert found.verdict.law_known
    assert found.verdict.ports == (effect.port.location,)


def test_every_law_that_suits_the_plant_is_among_those() -> None:
    elsewhere = {"guide_viscous", "tyre_stiffness"}
    laws = {ALL[name].law.name for name in (*SIZES, *elsewhere)}
    assert laws == {each.law.name for each in ALL.values()}


@pytest.mark.slow
def test_a_sensor_by_another_law_is_not_a_lag_beside_something_else() -> None:
    """The lag leaves next to nothing, and a second effect would take that up."""
    found = _diagnosed(_recorded(FILTERED), names=(*OFFERED, "accelerometer_lag"))
    assert (found.verdict.kind, found.verdict.effects) == ("effect", ("accelerometer_lag",))
    assert tuple(map(str, found.verdict.families)) == ("sensor.body_accel/dynamics",)
    assert not found.verdict.law_known
    assert found.shrink.closed_by_effect > 0.9


def test_what_follows_no_law_is_unknown() -> None:
    """Every test is off by itself: something is missing, and no law at any port says what."""
    found = _diagnosed(_recorded(miss=0.03))
    assert _missing(found) > 3.0 * DEFAULTS.material_share
    assert found.verdict.kind == "unknown"
    assert found.shrink.closed_by_effect < 0.5
    assert "no law learned at a port predicts held-out tests better" in found.verdict.sentence
