"""How well a hypothesis agrees with a recording, how well its parameters are known, and what it is mistaken for.

Blocks of time are the independent units throughout: their scatter gives intervals that correlation between rows
does not make too narrow.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from savgs_ident.diagnosis.result import Confusable, Estimate, Shrink
from savgs_ident.diagnosis.score_test import Score, cosine
from savgs_ident.inference.find_map import LaplaceFit
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import slopes_at

ALIKE = 0.95
"""Cosine from which two laws are mistaken for one another."""

DRAWS = 2000
"""Resamples of the blocks."""


def relative_error(data: Data, force: NDArray[np.float64]) -> float:
    """Norm of measured less predicted force (m,) [N], relative to the measured."""
    return float(np.linalg.norm(data.measured - force) / np.linalg.norm(data.measured))


def share_closed(gap: float, left: float, floor: float) -> float:
    """Share of the explainable part of a gap that is closed; all three are relative errors."""
    return 1.0 - (left**2 - floor**2) / (gap**2 - floor**2)


def shrink_of(
    data: Data, before: NDArray[np.float64], recalibrated: NDArray[np.float64], after: NDArray[np.float64]
) -> Shrink:
    """The gap of three predictions [N], (m,) each."""
    floor = float(np.sqrt(np.sum(data.variance)) / np.linalg.norm(data.measured))
    gap, left = relative_error(data, before), relative_error(data, after)
    squares = [
        np.bincount(data.test, each)
        for each in ((data.measured - before) ** 2, (data.measured - after) ** 2, data.variance)
    ]
    drawn = np.random.default_rng(0).integers(data.tests, size=(DRAWS, data.tests))
    first, last, noise = (each[drawn].sum(axis=1) for each in squares)
    low, high = np.quantile(1.0 - (last - noise) / (first - noise), [0.025, 0.975])
    return Shrink(
        gap,
        relative_error(data, recalibrated),
        left,
        floor,
        share_closed(gap, left, floor),
        (float(low), float(high)),
    )


def estimates_of(data: Data, mode: LaplaceFit) -> tuple[Estimate, ...]:
    """All parameters of a mode, with 95 % intervals from the scatter of the scores over blocks.

    Neighbouring blocks may still agree in part: their products count by half (Newey and West, Econometrica 55,
    1987). As few as the blocks are, those that went into the parameters are not counted, and Student's law takes
    the place of the normal one.
    """
    free = max(data.tests - mode.x.size, 1)
    weighted = mode.slopes * ((data.measured - mode.prediction.rows) / mode.noise_scales.spread)[:, None]
    scores = np.stack([np.bincount(data.test, column) for column in weighted.T])
    across = scores[:, 1:] @ scores[:, :-1].T
    scatter = (scores @ scores.T + 0.5 * (across + across.T)) * data.tests / free
    covariance = mode.covariance() @ (scatter + np.eye(mode.x.size)) @ mode.covariance()
    wide = float(student.ppf(0.975, free))
    errors = wide * np.sqrt(np.diag(covariance)) * slopes_at(mode.coordinates, mode.x)
    found = zip(mode.coordinates, mode.values.values(), errors, strict=True)
    return tuple(
        Estimate(each.name, value, value - float(error), value + float(error), each.unit)
        for each, value, error in found
    )


def confusable_with(name: str, scores: Sequence[Score]) -> list[Confusable]:
    """Laws whose scores say that they look like the named one."""
    named = next(each for each in scores if each.term.name == name)
    alike = {each.term.name: abs(cosine(named, each)) for each in scores if each is not named}
    return [Confusable((name, other), size) for other, size in alike.items() if size > ALIKE]
