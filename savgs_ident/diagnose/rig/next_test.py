"""The next test: the one that would best tell two hypotheses apart that this campaign hardly can.

Both are taken as fitted to this campaign and predict further ones: another lift of the cam, another angle of the
link, more payload. The difference that the rival could not make up by moving its parameters as far as this campaign
allows, in units of the noise, is the significance to expect.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.coordinates import slopes_at
from savgs_ident.diagnose.result import NextTest
from savgs_ident.diagnose.rig.plant import RigPlant

DWELLS = 4
"""Dwells of a proposed test."""

PROPOSED = 2
"""Tests that are proposed for a pair."""


@dataclass(frozen=True)
class Condition:
    """How the rig is run: the cam's lift and the link's angle changed, payload added.

    ``lift`` is a factor [1], ``turn`` is added to the link angle [rad], ``payload`` [kg] to the sprung mass.
    """

    text: str
    lift: float = 1.0
    turn: float = 0.0
    payload: float = 0.0


CONDITIONS = (
    Condition("the same programme again"),
    Condition("half the cam's lift", lift=0.5),
    Condition("1.4 times the cam's lift", lift=1.4),
    Condition("the link at 60 deg", turn=-np.pi / 6.0),
    Condition("the link at 120 deg", turn=np.pi / 6.0),
    Condition("50 kg of payload", payload=50.0),
)


def next_tests(search: Search, plant: RigPlant, one: Mode, other: Mode) -> tuple[NextTest, ...]:
    """The tests that separate two hypotheses best, most significant first."""
    pair = " + ".join(one.terms) or "none", " + ".join(other.terms) or "none"
    found = []
    for condition in CONDITIONS:
        significance, tests = _expected(search, plant, one, other, condition)
        if significance > 0.0:
            hertz = ", ".join(f"{f:.3g}" for f in np.sort(np.asarray(plant.excitation.frequency)[tests]))
            found.append(NextTest(f"dwells at {hertz} Hz, {condition.text}", pair, significance))
    return tuple(sorted(found, key=lambda each: -each.expected_sigma)[:PROPOSED])


def _expected(
    search: Search, plant: RigPlant, one: Mode, other: Mode, condition: Condition
) -> tuple[float, NDArray[np.intp]]:
    """Significance of the most telling dwells under a condition, and which these are; 0 where it cannot be run."""
    excitation = plant.excitation
    there = excitation._replace(
        road=condition.lift * excitation.road,
        link=jnp.asarray(excitation.link).at[:, 0].add(condition.turn),
    )
    elsewhere = replace(plant, excitation=there)

    def at(mode: Mode) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
        near = eqx.tree_at(lambda each: each.excitation, mode.prediction.near, there)
        values = _loaded(mode.values, plant, condition.payload)
        found = elsewhere.predict(mode.terms, values, [each.name for each in mode.coordinates], near)
        return found.rows, found.slopes * slopes_at(mode.coordinates, mode.x), found.solved

    rows, _, solved = at(one)
    rival, slopes, also = at(other)
    nothing = np.zeros(0, np.intp)
    if not (solved and also):
        return 0.0, nothing
    data, miss = search.data, rows - rival
    by_test = np.bincount(data.test, miss**2 / data.variance)
    tests = np.argsort(by_test)[::-1][:DWELLS]
    chosen = np.isin(data.test, tests)
    freedom = slopes[chosen] @ other.covariance() @ slopes[chosen].T
    spread = np.diag(data.variance[chosen]) + freedom
    return float(np.sqrt(miss[chosen] @ np.linalg.solve(spread, miss[chosen]))), tests


def _loaded(values: Mapping[str, float], plant: RigPlant, payload: float) -> dict[str, float]:
    sprung = values.get("m_s", plant.rig.parameters["m_s"].value)
    return dict(values) | {"m_s": sprung + payload}
