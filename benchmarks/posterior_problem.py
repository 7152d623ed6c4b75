"""The posterior that is sampled, and draws of it to start from and to evaluate a likelihood at.

Both are taken from the surrogate to second order, with which the exact model agrees about most draws. That
they come for nothing is to the peer's advantage.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float

from benchmarks.campaign import read_dwells, response_of
from benchmarks.outcome import Tell
from savgs_ident.core.rig import default_rig_path, read_rig
from savgs_ident.effects.registry import MODELS
from savgs_ident.fit.least_squares import FREE
from savgs_ident.fit.problem import Problem
from savgs_ident.posterior.expand import expand
from savgs_ident.posterior.sample import Question, case_of, locate, plan
from savgs_ident.posterior.settings import SamplingSettings
from savgs_ident.posterior.shear import no_shear
from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.posterior.walk import walk
from savgs_ident.simulate.excitation import Excitation

_ROUNDS = 20
"""Walks, one after the other, from the mode to a draw that has forgotten it."""


class PosteriorProblem(NamedTuple):
    """A problem, what drives its dwells, and a surrogate of its posterior."""

    problem: Problem
    excitation: Excitation
    surrogate: Surrogate

    @property
    def straight(self) -> Surrogate:
        """The same density over v, of which points are an affine map: point = centre + scale v."""
        size = self.surrogate.slope.shape[1]
        straight: Surrogate = eqx.tree_at(lambda each: each.shear, self.surrogate, no_shear(size))
        return straight

    def draw(self, count: int, seed: int) -> Float[np.ndarray, "w n+2"]:
        """Independent points of the posterior."""
        ends, _, _ = walk(self.surrogate, seed, np.zeros((count, self.surrogate.centre.size)), _ROUNDS)
        return self.surrogate.points(ends)


def pose_posterior(dwells_hz: Sequence[float], tell: Tell) -> PosteriorProblem:
    """The posterior of the paper's four parameters given the shipped dwells at these frequencies [Hz]."""
    measured = response_of(read_dwells(dwells_hz))
    question = Question(measured, read_rig(default_rig_path()), {}, MODELS["simtr"], FREE)
    task = plan(question, SamplingSettings())
    case = case_of(task)
    mode = locate(case, task, question, tell)
    return PosteriorProblem(task.problem, task.excitation, expand(case, mode.foothold, tell).surrogate)
