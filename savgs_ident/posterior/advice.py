"""Which further dwell would tell what the posterior does not."""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.identifiability import TOLD
from savgs_ident.fit.judge import advice_of
from savgs_ident.fit.minimise import Minimiser
from savgs_ident.fit.task import Task
from savgs_ident.posterior.mode import Mode
from savgs_ident.posterior.words import log_covariance


def advise(task: Task, mode: Mode, draws: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Sentences on dwells that would help; none if all identified parameters are told.

    ``draws`` (s,) are in SI, by name.
    """
    covariance = log_covariance(task.problem.free.identified, draws)
    if np.sqrt(np.diag(covariance)).max() <= TOLD:
        return ()
    minimiser = Minimiser(task.problem)
    known = minimiser.evaluate(jnp.asarray(mode.foothold.point[:-2]), mode.foothold.solution)
    return advice_of(task, minimiser, known)
