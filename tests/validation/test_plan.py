"""A plan of a campaign: its errors are those of differences, its dwells better than others, its limits true."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import savgs_ident as si
from savgs_ident.core.transforms import WIDTH
from savgs_ident.recordings.recording import classify_test

from ..relaxed import with_kept_programs

NOISE = {"body_accel": 0.05, "susp_deflection": 1e-4}
SAMPLES, ORDERS = 4000, 3
FREQUENCIES = (0.8, 1.5, 2.2, 3.0, 5.0, 9.0)


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with with_kept_programs():
        yield


def _model() -> si.PlantModel:
    return si.PlantModel(si.TwoMass(), si.TwoMass.parameters)


@pytest.fixture(scope="module")
def planned() -> si.CampaignPlan:
    return si.plan(
        _model(),
        frequencies=FREQUENCIES,
        amplitudes=(0.005, 0.01),
        noise=NOISE,
        tests=4,
        target=0.005,
        samples=SAMPLES,
        orders=ORDERS,
    )


def _moving() -> list[str]:
    """What is estimated: the free parameters, and those that are known to a tolerance."""
    return ["k", "c", *(each.name for each in _model().table.entries if each.tolerance > 0.0)]


def _rows(model: si.PlantModel, tests: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Simulated harmonics in standard deviations of their noise."""
    sd = np.array([NOISE[each.name] for each in model.channels]) * np.sqrt(2.0 / SAMPLES)
    found = [si.simulate(model, (f,), orders=ORDERS, amplitude=a).harmonics[0, :, 1:] for f, a in tests]
    scaled = np.array(found) / sd[:, None]
    return np.concatenate([scaled.real.ravel(), scaled.imag.ravel()])


def _slopes(tests: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Slopes of the rows in the logarithms of what is estimated, by differences."""
    model, step, columns = _model(), 1e-4, []
    for name in _moving():
        value = model.table[name].value
        one, other = (model.with_values({name: value * (1.0 + each)}) for each in (step, -step))
        columns.append((_rows(one, tests) - _rows(other, tests)) / (2.0 * step))
    return np.stack(columns, axis=1)


def _information(tests: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Of the logarithms of what is estimated, beside what is known beforehand."""
    table, slopes = _model().table, _slopes(tests)
    sizes = [(table[name].value, table[name].tolerance) for name in _moving()]
    known = [(value / tolerance) ** 2 if tolerance else WIDTH**-2 for value, tolerance in sizes]
    return np.asarray(slopes.T @ slopes + np.diag(known))


def _errors(tests: list[tuple[float, float]]) -> dict[str, float]:
    sd = np.sqrt(np.diag(np.linalg.inv(_information(tests))))
    return dict(zip(_moving(), sd.tolist(), strict=True))


@pytest.mark.slow
def test_errors_are_those_of_differences(planned: si.CampaignPlan) -> None:
    for count in (1, 4):
        expected = _errors([(each.frequency_hz, each.programme.amplitude) for each in planned.tests[:count]])
        for name, error in zip(planned.free, planned.tests[count - 1].errors, strict=True):
            assert error == pytest.approx(expected[name], rel=0.02), (name, count)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["suspension_stiffening", "tyre_stiffness", "suspension_oscillator"])
def test_what_is_seen_of_an_effect_is_what_differences_say(planned: si.CampaignPlan, name: str) -> None:
    tests = [(each.frequency_hz, each.programme.amplitude) for each in planned.tests]
    model = _model()
    effect = model.catalogue[name]
    (amplitude,) = effect.null
    small = 1e-3 * next(each.smallest for each in planned.effects if each.name == name)
    column = (_rows((model + name).with_values({amplitude: small}), tests) - _rows(model, tests)) / small
    slopes = _slopes(tests)
    across = slopes.T @ column
    left = column @ column - across @ np.linalg.solve(_information(tests), across)
    smallest = next(each.smallest for each in planned.effects if each.name == name)
    assert smallest == pytest.approx(planned.visible / np.sqrt(left), rel=0.05)


@pytest.mark.slow
def test_no_other_first_dwell_comes_closer_to_what_is_asked_for(planned: si.CampaignPlan) -> None:
    def beyond(test: tuple[float, float]) -> float:
        found = _errors([test])
        return sum(max(np.log(found[name] / planned.target), 0.0) for name in planned.free)

    first = planned.tests[0]
    best = min(beyond((f, a)) for f in FREQUENCIES for a in (0.005, 0.01))
    assert beyond((first.frequency_hz, first.programme.amplitude)) == pytest.approx(best, abs=0.02)


@pytest.mark.slow
def test_the_campaign_identifies_what_it_was_planned_for(planned: si.CampaignPlan) -> None:
    assert planned.trusted
    large = [each.frequency_hz for each in planned.tests if each.programme.amplitude == 0.01]
    recorded = si.simulate_dwells(
        _model().with_values({"k": 6.1e4, "c": 2.05e3}),
        large,
        {"road_height": 0.01},
        NOISE,
        samples=SAMPLES,
        orders=ORDERS,
    )
    fit = si.fit(_model(), recorded, orders=ORDERS)
    for name, true in {"k": 6.1e4, "c": 2.05e3}.items():
        assert abs(fit[name].value - true) < 4.0 * fit[name].stderr


@pytest.mark.slow
def test_what_does_the_same_is_not_told_apart(planned: si.CampaignPlan) -> None:
    pairs = {frozenset(each) for each in planned.not_separated}
    assert frozenset(("accelerometer_lag", "accelerometer_delay")) in pairs
    by_name = {each.name: each for each in planned.effects}
    # A cubic spring makes third harmonics, which no gain does.
    assert by_name["suspension_stiffening"].apart > planned.visible


@pytest.mark.slow
def test_that_a_campaign_is_too_noisy_for_what_is_asked_is_said(planned: si.CampaignPlan) -> None:
    loud = si.plan(
        _model(),
        frequencies=FREQUENCIES[:2],
        noise={name: 100.0 * sd for name, sd in NOISE.items()},
        tests=1,
        target=1e-4,
        orders=1,
    )
    assert not loud.trusted
    assert "allow more tests" in loud.doubts[0]
    assert max(loud.errors.values()) > max(planned.errors.values())


@pytest.mark.slow
def test_its_list_is_of_dwells_that_readers_know(planned: si.CampaignPlan, tmp_path: Path) -> None:
    files = {path.name: path for path in planned.save(tmp_path)}
    assert set(files) == {"plan.json", "plan.csv", "plan.png", "plan.pdf"}
    lines = files["plan.csv"].read_text().splitlines()[1:]
    assert len(lines) == len(planned.tests)
    for line in lines:
        name, hertz, _ = line.split(",")
        kind, frequency = classify_test(name)
        assert kind == "dwell"
        assert frequency == pytest.approx(float(hertz), rel=5e-3)


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"noise": {"steering": 1.0}}, "no channel 'steering'"),
        ({"amplitudes": (0.0,)}, "moves nothing"),
        ({"target": 0.0}, "above zero"),
        ({"free": ("stiffnes",)}, "no parameter 'stiffnes'"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(given: dict[str, object], what: str) -> None:
    with pytest.raises(si.InputError) as caught:
        si.plan(_model(), frequencies=(1.0,), **given)  # type: ignore[arg-type]
    assert what in str(caught.value) or what in caught.value.remedy
