"""An effect's intervals from the curvature at the mode are those of the profile likelihood."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from savgs_ident.diagnosis.candidates import WITHIN
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.model_selection import recalibrate
from savgs_ident.diagnosis.public import SIMTR, problem_of_dwells
from savgs_ident.inference.find_map import find_map, refine
from savgs_ident.inference.laplace_fit import LaplaceFit
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import AbstractCoordinate
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from .conftest import Measure

FIXED = 1e-7
"""Width of the prior of a parameter that is held, of its prior as it was."""

LEVEL = 1e-3
"""Rise of the log density that a step promises below which a mode is found."""

LEAST, MOST = 0.9, 0.99
"""What an interval said to hold 95 % may hold by the profile."""


def _held(term: Term, name: str, value: float) -> Term:
    """The term with one parameter all but fixed."""

    def one(each: AbstractCoordinate) -> AbstractCoordinate:
        return replace(each, centre=value, scale=FIXED * each.scale) if each.name == name else each

    return replace(term, amplitudes=tuple(map(one, term.amplitudes)), shapes=tuple(map(one, term.shapes)))


def _drop(problem: DiagnosisProblem, mode: LaplaceFit, term: Term, place: int, x: float) -> float:
    """By how much the log density falls from ``mode`` with one coordinate held at ``x``, the others let go."""
    covariance = mode.covariance()
    start = mode.x + covariance[:, place] / covariance[place, place] * (x - mode.x[place])
    values = {each.name: each.value(at) for each, at in zip(mode.coordinates, start.tolist(), strict=True)}
    held = mode.coordinates[place]
    there = find_map(
        problem.search,
        (_held(term, held.name, held.value(x)),),
        values,
        mode.prediction.warm_start,
        level=LEVEL,
    )
    assert there.status.ok
    moved = there.x.copy()
    moved[place] = x
    top, low = (each.noise_scales.value - 0.5 * at @ at for each, at in ((mode, mode.x), (there, moved)))
    return float(top - low)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recording", "effect"),
    [
        ("stribeck_rail", "rail_stribeck"),
        ("mount_compliance", "mount_compliance"),
    ],
)
def test_the_profile_falls_at_the_ends_of_an_interval_as_it_should(
    measure_few: Measure, rig: Rig, recording: str, effect: str
) -> None:
    problem = recalibrate(
        *problem_of_dwells(measure_few(recording), RigModel(rig, SIMTR.baseline), SIMTR), {}, lambda _: None
    )
    (term,) = (each for each in problem.plant.candidates if each.name == effect)
    own = {each.name for each in term.coordinates}
    start = problem.base.values | {each.name: each.centre + 0.5 * each.scale for each in term.amplitudes}
    mode = refine(
        problem.search, find_map(problem.search, (term,), start, problem.base.prediction.warm_start), (term,)
    )
    mode = find_map(problem.search, (term,), mode.values, mode.prediction.warm_start, level=LEVEL)
    sd = np.sqrt(np.diag(mode.covariance()))
    for place in (index for index, each in enumerate(mode.coordinates) if each.name in own):
        ends = (mode.x[place] + side * WITHIN * sd[place] for side in (-1.0, 1.0))
        beyond = [0.5 * chi2.sf(2.0 * _drop(problem, mode, term, place, end), 1) for end in ends]
        assert LEAST <= 1.0 - sum(beyond) <= MOST, mode.coordinates[place].name
