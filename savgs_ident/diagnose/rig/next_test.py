"""The next test: the one that would best tell two hypotheses apart that this campaign hardly can.

Both are taken as fitted to this campaign and predict further ones: another lift of the cam, another angle of the
link, more payload, or the link swung while the road stands still. The difference that the rival could not make up by
moving its parameters as far as this campaign allows, in units of the noise, is the significance to expect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.coordinates import slopes_at
from savgs_ident.diagnose.engine.parallel import in_parallel
from savgs_ident.diagnose.engine.prediction import Prediction
from savgs_ident.diagnose.result import NextTest
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.model.effect import AbstractSeries, Port
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import PeriodicSolution

DWELLS = 4
"""Dwells of a proposed test."""

PROPOSED = 2
"""Tests that are proposed for a pair."""


@dataclass(frozen=True)
class Condition:
    """How the rig is run: the cam's lift and the link's angle changed, the link swung, payload added.

    ``lift`` is a factor [1], ``turn`` is added to the link angle [rad], about which it swings by ``swing`` [rad] to
    either side; ``payload`` [kg] is added to the sprung mass.
    """

    text: str
    lift: float = 1.0
    turn: float = 0.0
    swing: float = 0.0
    payload: float = 0.0


CONDITIONS = (
    Condition("the same programme again"),
    Condition("half the cam's lift", lift=0.5),
    Condition("1.4 times the cam's lift", lift=1.4),
    Condition("the link at 60 deg", turn=-np.pi / 6.0),
    Condition("the link at 120 deg", turn=np.pi / 6.0),
    Condition("50 kg of payload", payload=50.0),
    Condition("the road standing still and the link swung by 10 deg", lift=0.0, swing=np.pi / 18.0),
)


def next_tests(search: Search, plant: RigPlant, one: Mode, other: Mode) -> tuple[NextTest, ...]:
    """The tests that separate two hypotheses best, most significant first."""
    pair = " + ".join(one.terms) or "none", " + ".join(other.terms) or "none"
    drafts = sorted(_drafts(search, plant, one, other), key=lambda each: -each.raw)[:PROPOSED]
    found = []
    for draft in drafts:
        hertz = ", ".join(f"{f:.3g}" for f in np.sort(np.asarray(plant.excitation.frequency)[draft.tests]))
        text = f"dwells at {hertz} Hz, {draft.condition.text}"
        found.append(NextTest(text, pair, _expected(search, plant, other, draft)))
    return tuple(sorted(found, key=lambda each: -each.expected_sigma))


class _Draft(NamedTuple):
    """A test under a condition: its most telling dwells, what the hypotheses differ by, rival's motions.

    ``raw`` is the significance that the rival's own freedom has not been taken from yet.
    """

    condition: Condition
    tests: NDArray[np.intp]
    miss: NDArray[np.float64]
    raw: float
    near: Any


def _drafts(search: Search, plant: RigPlant, one: Mode, other: Mode) -> list[_Draft]:
    """A draft for every condition under which both hypotheses can be solved."""

    def draft(condition: Condition) -> _Draft | None:
        found, rival = (predicted(plant, mode, condition) for mode in (one, other))
        if not (found.solved and rival.solved):
            return None
        miss = found.rows - rival.rows
        by_test = np.bincount(search.data.test, miss**2 / search.data.variance)
        tests = np.argsort(by_test)[::-1][:DWELLS]
        return _Draft(condition, tests, miss, float(np.sqrt(by_test[tests].sum())), rival.near)

    return [each for each in in_parallel(draft, CONDITIONS) if each is not None]


def predicted(
    plant: RigPlant,
    mode: Mode,
    condition: Condition,
    names: Sequence[str] = (),
    near: PeriodicSolution | None = None,
) -> Prediction:
    """A hypothesis under a condition, with slopes in the named parameters, from motions ``near`` it if known."""
    near = _begin(mode, condition) if near is None else near
    excitation = plant.excitation
    link = jnp.asarray(excitation.link).at[:, 0].add(condition.turn)
    # Where the link was not recorded it has no harmonics, and JAX leaves out what would be added to them.
    there = excitation._replace(
        road=condition.lift * excitation.road, link=link.at[:, 1].add(condition.swing)
    )
    moved = eqx.tree_at(lambda each: each.excitation, near, there)
    values = _loaded(mode.values, plant, condition.payload)
    if condition.lift == 0.0:
        values |= _of_a_road_at_rest(mode.terms, plant)
    return replace(plant, excitation=there, corrections={}).predict(mode.terms, values, names, moved)


def _begin(mode: Mode, condition: Condition) -> PeriodicSolution:
    """Where to look for the motion of a hypothesis from: its own, or rest."""
    near: PeriodicSolution = mode.prediction.near
    if condition.lift > 0.0:
        return near
    rest = Trajectory(*(jnp.zeros_like(part) for part in near.trajectory))
    return eqx.tree_at(lambda each: each.trajectory, near, rest)


def _of_a_road_at_rest(terms: Sequence[str], plant: RigPlant) -> dict[str, float]:
    """Null values of what the terms do to the road: a cam at rest has no shape; a plate still gives way."""
    effects = [plant.catalogue[name] for name in terms]
    moving = [each for each in effects if each.port is Port.ROAD and not isinstance(each, AbstractSeries)]
    return {name: null for each in moving for name, null in each.null.items()}


def _expected(search: Search, plant: RigPlant, other: Mode, draft: _Draft) -> float:
    """Significance of a draft once the rival has moved its parameters as far as the campaign allows."""
    names = [each.name for each in other.coordinates]
    rival = predicted(plant, other, draft.condition, names, draft.near)
    chosen = np.isin(search.data.test, draft.tests)
    slopes = (rival.slopes * slopes_at(other.coordinates, other.x))[chosen]
    spread = np.diag(search.data.variance[chosen]) + slopes @ other.covariance() @ slopes.T
    miss = draft.miss[chosen]
    return float(np.sqrt(miss @ np.linalg.solve(spread, miss)))


def _loaded(values: Mapping[str, float], plant: RigPlant, payload: float) -> dict[str, float]:
    sprung = values.get("m_s", plant.rig.parameters["m_s"].value)
    return dict(values) | {"m_s": sprung + payload}
