"""The verdict of a finished minimisation: errors, what trades off, how low it can go, which test would help."""

from dataclasses import replace

import numpy as np

from savgs_ident.fit.covariance import spread_of
from savgs_ident.fit.identifiability import TOLD, untold_groups, verdict_of
from savgs_ident.fit.minimise import Minimiser, Minimum, Progress
from savgs_ident.fit.next_dwell import propose_dwells
from savgs_ident.fit.problem import Problem
from savgs_ident.fit.profile import lower_bound
from savgs_ident.fit.result import Verdict
from savgs_ident.fit.task import Task

EXPLAINED = 2.0
"""chi2 per datum up to which the data count as explained."""


def judge(task: Task, minimiser: Minimiser, best: Minimum, tell: Progress) -> Verdict:
    """What the data tell about the free parameters at ``best``."""
    problem, table = task.problem, task.table
    names = problem.free.identified
    values = {name: float(value) for name, value in problem.parameters(best.u).items()}
    units = {name: table[name].unit for name in names}
    if not np.isfinite(best.jacobian).all():
        return Verdict(False, ("The fit broke down: nothing can be said about the parameters.",))
    covariance = _log_covariance(problem, best, values)
    bounds: dict[str, float] = {}
    advice: tuple[str, ...] = ()
    if np.sqrt(np.diag(covariance)).max() > TOLD:
        for group in untold_groups(names, covariance):
            name = group[-1]  # The others follow it along the line that they trade off along.
            tell(f"looking for a lower bound of {name}")
            bound = lower_bound(minimiser, best, name, tell)
            bounds |= {} if bound is None else {name: bound}
        tell("looking for a test that would help")
        advice = advice_of(task, minimiser, best)
    verdict = verdict_of(names, values, units, covariance, bounds, advice)
    return replace(verdict, sentences=(*_misfit(problem, best), *verdict.sentences))


def _misfit(problem: Problem, best: Minimum) -> tuple[str, ...]:
    rows = best.residual[: best.residual.size - len(problem.free.tolerated)]
    excess = float(rows @ rows) / max(problem.target.entries - len(problem.free.identified), 1)
    if excess <= EXPLAINED:
        return ()
    return (
        f"The model does not explain these data: chi2/dof = {excess:.3g}. The parameters make up for what is "
        "missing in it; their errors are those of the noise alone.",
    )


def advice_of(task: Task, minimiser: Minimiser, best: Minimum) -> tuple[str, ...]:
    """In words, which further dwells would tell every free parameter; one sentence."""
    proposals = propose_dwells(minimiser, best, task.settings.periodic)
    if not proposals:
        return ("No single further dwell that was considered would help.",)
    tests = "; ".join(f"{each.test} (to {100.0 * each.worst_sd:.2g} %)" for each in proposals)
    return (f"What would tell every free parameter: {tests}.",)


def _log_covariance(problem: Problem, best: Minimum, values: dict[str, float]) -> np.ndarray:
    """Covariance of the logarithms of the free parameters."""
    count = len(problem.free.identified)
    slope = np.asarray(problem.slopes(best.u))[:count]
    scale = slope / np.array([values[name] for name in problem.free.identified])
    return spread_of(best.jacobian).covariance[:count, :count] * np.outer(scale, scale)
