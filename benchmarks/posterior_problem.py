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
from benchmarks.outcome import Progress
from savgs_ident.inference.harmonic_question import Question, density_of, locate, plan
from savgs_ident.inference.near_mode import Surrogate, identity_map
from savgs_ident.inference.problem import Problem
from savgs_ident.inference.sample import expand_about_draws
from savgs_ident.inference.samplers.chains import SamplingSettings
from savgs_ident.inference.samplers.emcee import pcn_steps
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig

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
        straight: Surrogate = eqx.tree_at(lambda each: each.map, self.surrogate, identity_map(size))
        return straight

    def draw(self, count: int, seed: int) -> Float[np.ndarray, "w n+2"]:
        """Independent points of the posterior."""
        ends, _, _ = pcn_steps(self.surrogate, seed, np.zeros((count, self.surrogate.centre.size)), _ROUNDS)
        return self.surrogate.points(ends)


def pose_posterior(dwells_hz: Sequence[float], progress: Progress) -> PosteriorProblem:
    """The posterior of the paper's four parameters given the shipped dwells at these frequencies [Hz]."""
    measured = response_of(read_dwells(dwells_hz))
    question = Question(measured, RigModel(read_rig(default_rig_path()), MODELS["simtr"]), {}, FREE)
    task = plan(question, SamplingSettings())
    case = density_of(task)
    mode = locate(case, task, question, progress)
    expansion = expand_about_draws(case, mode.linearisation_point, SamplingSettings().seed, progress)
    return PosteriorProblem(task.problem, task.excitation, expansion.surrogate)
