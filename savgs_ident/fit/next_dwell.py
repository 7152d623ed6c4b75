"""Which further dwell would tell what the data so far do not.

Every candidate dwell has sensitivities; added to the information of the fit they give the standard errors
that a campaign with that dwell would reach. Candidates are faster and slower dwells and other cam strokes,
with the noise of the dwells at hand.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.covariance import spread_of
from savgs_ident.fit.identifiability import TOLD
from savgs_ident.fit.minimise import Minimiser, Minimum
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic


class Candidate(NamedTuple):
    """A family of dwells: what it is in words, and what drives the rig in each."""

    label: str
    excitation: Excitation


class Proposal(NamedTuple):
    """A dwell that would help: in words, and the worst standard error of the free logarithms with it [1]."""

    test: str
    worst_sd: float


def candidates(excitation: Excitation) -> tuple[Candidate, ...]:
    """Families with as many dwells as were recorded: faster, slower, smaller and larger strokes."""
    frequency = np.asarray(excitation.frequency)
    count = frequency.size
    faster = np.linspace(frequency.max(), 2.0 * frequency.max(), count + 1)[1:]
    slower = np.linspace(0.4 * frequency.min(), frequency.min(), count + 1)[:-1]
    families = [
        Candidate("a faster dwell", _still_link(excitation, faster, 1.0)),
        Candidate("a slower dwell", _still_link(excitation, slower, 1.0)),
        Candidate("a dwell at 0.7 of the cam stroke", _still_link(excitation, frequency, 0.7)),
        Candidate("a dwell at 1.4 of the cam stroke", _still_link(excitation, frequency, 1.4)),
    ]
    return tuple(families)


def _still_link(excitation: Excitation, frequency: NDArray[np.float64], stroke: float) -> Excitation:
    """The recorded strokes at other frequencies and sizes, with the link at rest."""
    road = jnp.zeros_like(excitation.road).at[:, 1].set(stroke * jnp.abs(excitation.road[:, 1]))
    link = jnp.zeros_like(excitation.link).at[:, 0].set(excitation.link[:, 0])
    return Excitation(jnp.asarray(frequency), road, link)


def propose_dwells(minimiser: Minimiser, best: Minimum, settings: PeriodicSettings) -> tuple[Proposal, ...]:
    """The best dwell of every family that would tell all free parameters; empty if none would."""
    free = len(minimiser.problem.free.identified)

    def worst(jacobian: NDArray[np.float64]) -> float:
        return float(spread_of(jacobian).sd[:free].max())

    leaders = []
    for candidate in candidates(best.solution.excitation):
        proposals = _proposals(minimiser, best, candidate, settings, worst)
        leader = min(proposals, key=lambda each: each.worst_sd, default=None)
        if leader is not None and leader.worst_sd <= TOLD:
            leaders.append(leader)
    return tuple(leaders)


def _proposals(
    minimiser: Minimiser,
    best: Minimum,
    candidate: Candidate,
    settings: PeriodicSettings,
    worst: Callable[[NDArray[np.float64]], float],
) -> list[Proposal]:
    problem = minimiser.problem
    p = problem.parameters(best.u)
    layout = best.solution.mesh.layout
    solution = simulate_periodic(problem.model, p, candidate.excitation, settings, layout)
    found = minimiser.evaluate(best.u, solution)
    dwells = candidate.excitation.frequency.size
    priors = len(problem.free.tolerated)
    rows = found.jacobian[: found.jacobian.shape[0] - priors].reshape(dwells, -1, found.jacobian.shape[1])
    proposals = []
    for dwell, status in enumerate(solution.status()):
        if status.ok and np.isfinite(rows[dwell]).all():
            sd = worst(np.concatenate([best.jacobian, rows[dwell]]))
            hertz = float(candidate.excitation.frequency[dwell])
            proposals.append(Proposal(f"{candidate.label}, {hertz:.2g} Hz", sd))
    return proposals
