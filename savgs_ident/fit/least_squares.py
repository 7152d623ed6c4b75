"""The fit: from a measured response to identified parameters with their covariance.

    fit = fit_least_squares(measured, rig, effects=MODELS["simtr"], free=FREE)
    fit.by_name["mu_r"].value, fit.by_name["mu_r"].stderr

The free parameters are told by the data alone; parameters known to a tolerance are estimated along under
their priors. Each start is solved cold and minimised on its own time nodes; the best is minimised once more
on nodes adapted to it.
"""

import time
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import CATALOGUE, build_model, model_parameters
from savgs_ident.fit.covariance import UNTOLD, spread_of
from savgs_ident.fit.identifiability import TOLD, untold_groups, verdict_of
from savgs_ident.fit.minimise import Minimiser, Minimum, Progress
from savgs_ident.fit.next_dwell import propose_dwells
from savgs_ident.fit.problem import Problem, tolerated_parameters, used_parameters
from savgs_ident.fit.profile import lower_bound
from savgs_ident.fit.result import Estimate, Fit, Verdict
from savgs_ident.fit.settings import FitSettings
from savgs_ident.fit.target import harmonic_target, peak_to_peak_target
from savgs_ident.model.values import as_values
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.measured import measured_excitation
from savgs_ident.simulate.periodic import adapt, harmonics, simulate_periodic

FREE = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""The four parameters that the paper identifies."""

EXPLAINED = 2.0
"""A first start that ends with chi2 per datum below this has explained the data; no other is needed."""

_SHIFT = 0.4
"""Distance of further starts from the first in every free coordinate: about a factor of one and a half."""


def fit_least_squares(
    measured: HarmonicResponse,
    rig: Rig,
    *,
    effects: tuple[str, ...],
    free: tuple[str, ...],
    settings: FitSettings | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit ``free`` parameters of a rig with ``effects`` to a measured response.

    ``progress`` is told what is going on. Raises :class:`InputError` for names that do not exist or that the
    model does not use, and for a response that cannot be used. Look at ``trusted`` of the result.
    """
    began = time.perf_counter()
    settings, tell = settings or FitSettings(), progress or _silent
    table = model_parameters(rig, effects)
    problem = _problem(measured, rig, table, effects, free, settings)
    excitation = measured_excitation(measured, rig.parameters["psi_nominal"].value)

    tell("solving the model as given")
    first = simulate_periodic(problem.model, problem.fixed, excitation, settings.periodic)
    as_given = np.asarray(harmonics(problem.fixed, first, problem.orders))
    tell("preparing the fit")
    minimiser = Minimiser(problem, first)
    first_u, *others = _starts(problem, table, settings)
    tried = [minimiser.minimise(first_u, first, settings.steps, tell)]
    for u in others:
        if tried[0].status.ok and tried[0].cost < EXPLAINED * problem.target.entries:
            break
        tell("trying another start")
        tried.append(_from_start(minimiser, u, excitation, settings, tell))
    best = min(tried, key=lambda each: each.cost if np.isfinite(each.cost) else np.inf)
    tell("refining on nodes adapted to the result")
    best = _refined(minimiser, best, settings, tell)

    verdict = _verdict(minimiser, best, settings, table, tell)
    return _result(
        rig, effects, table, problem, measured, settings, excitation, as_given, tried, best, verdict, began
    )


def _silent(line: str) -> None:
    del line


def _problem(
    measured: HarmonicResponse,
    rig: Rig,
    table: ParameterTable,
    effects: Sequence[str],
    free: tuple[str, ...],
    settings: FitSettings,
) -> Problem:
    model = build_model(rig, effects)
    used = used_parameters(model, table)
    for name in free:
        if name not in table:
            raise InputError(
                f"there is no parameter '{name}'", remedy="choose among: " + ", ".join(sorted(used))
            )
        if name not in used:
            raise InputError(
                f"the model does not depend on '{name}'", remedy="choose among: " + ", ".join(sorted(used))
            )
    tolerated = () if settings.fixed_tolerances else tolerated_parameters(model, table, free)
    fixed = as_values(table.as_dict())
    by_harmonics = settings.quantity == "harmonics"
    target = harmonic_target(measured, settings.orders) if by_harmonics else peak_to_peak_target(measured)
    orders = target.used.shape[-1] - 1
    free_vector = FreeVector(table, free, tolerated)
    return Problem(model, free_vector, fixed, target, orders, settings.periodic.iterations)


def _starts(problem: Problem, table: ParameterTable, settings: FitSettings) -> list[Array]:
    """The rig's values, then points to alternating sides of them in the free coordinates."""
    first = problem.free.to_unconstrained(table.as_dict())
    count, starts = len(problem.free.identified), [first]
    for number in range(1, settings.starts):
        signs = [1.0 if (number >> (place % 4)) & 1 else -1.0 for place in range(count)]
        starts.append(first.at[:count].add(_SHIFT * jnp.asarray(signs)))
    return starts


def _from_start(
    minimiser: Minimiser, u: Array, excitation: Excitation, settings: FitSettings, tell: Progress
) -> Minimum:
    p = minimiser.problem.parameters(u)
    near = simulate_periodic(minimiser.problem.model, p, excitation, settings.periodic)
    return minimiser.minimise(u, near, settings.steps, tell)


def _refined(minimiser: Minimiser, best: Minimum, settings: FitSettings, tell: Progress) -> Minimum:
    if not np.isfinite(best.cost):
        return best
    problem, layout = minimiser.problem, best.solution.mesh.layout
    p = problem.parameters(best.u)
    near = adapt(problem.model, p, best.solution, layout, settings.periodic.iterations)
    return minimiser.minimise(best.u, near, settings.steps, tell)


def _verdict(
    minimiser: Minimiser, best: Minimum, settings: FitSettings, table: ParameterTable, tell: Progress
) -> Verdict:
    problem = minimiser.problem
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
        advice = _advice(minimiser, best, settings)
    return verdict_of(names, values, units, covariance, bounds, advice)


def _advice(minimiser: Minimiser, best: Minimum, settings: FitSettings) -> tuple[str, ...]:
    proposals = propose_dwells(minimiser, best, settings.periodic)
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


def _estimates(
    problem: Problem, best: Minimum, table: ParameterTable
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    values = problem.parameters(best.u)
    slope = np.asarray(problem.slopes(best.u))
    spread = spread_of(best.jacobian)
    covariance = spread.covariance * np.outer(slope, slope)
    estimates = []
    for place, name in enumerate(problem.free.names):
        told = spread.sd[place] < 0.1 * UNTOLD
        stderr = float(np.sqrt(covariance[place, place])) if told else np.inf
        free = name in problem.free.identified
        known = table[name]
        estimates.append(
            Estimate(name, float(values[name]), stderr, known.unit, free, known.value, known.tolerance)
        )
    return tuple(estimates), covariance


def _frictionless(
    problem: Problem, effects: Sequence[str], best: Minimum, excitation: Excitation, settings: FitSettings
) -> np.ndarray:
    """The same estimates with every effect at its null: the compiled model serves for SimQC too."""
    nulls = {name: value for effect in effects for name, value in CATALOGUE[effect].null.items()}
    p = dict(problem.parameters(best.u)) | as_values(nulls)
    solution = simulate_periodic(problem.model, p, excitation, settings.periodic)
    ok = np.array([status.ok for status in solution.status()])
    response = np.asarray(harmonics(p, solution, problem.orders))
    return np.where(ok[:, None, None], response, np.nan)


def _result(
    rig: Rig,
    effects: tuple[str, ...],
    table: ParameterTable,
    problem: Problem,
    measured: HarmonicResponse,
    settings: FitSettings,
    excitation: Excitation,
    as_given: np.ndarray,
    tried: list[Minimum],
    best: Minimum,
    verdict: Verdict,
    began: float,
) -> Fit:
    estimates, covariance = _estimates(problem, best, table)
    p = problem.parameters(best.u)
    rows = best.residual.size - len(problem.free.tolerated)
    identified = Rig(
        rig.name,
        table.with_values({each.name: each.value for each in estimates}),
        rig.damper_velocity,
        rig.damper_force,
        rig.provenance,
    )
    return Fit(
        rig=identified,
        effects=effects,
        estimates=estimates,
        covariance=covariance,
        chi2=float(best.residual[:rows] @ best.residual[:rows]),
        dof=problem.target.entries - len(problem.free.identified),
        prior_chi2=float(best.residual[rows:] @ best.residual[rows:]),
        status=best.status,
        dwell_status=best.solution.status(),
        verdict=verdict,
        measured=measured,
        orders=problem.orders,
        used=np.array(problem.target.used),
        predicted=np.array(harmonics(p, best.solution, problem.orders)),
        frictionless=_frictionless(problem, effects, best, excitation, settings),
        as_given=np.array(as_given),
        starts=tuple((each.cost, each.status) for each in tried),
        quantity=settings.quantity,
        wall_s=time.perf_counter() - began,
    )
