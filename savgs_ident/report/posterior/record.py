"""The object of ``posterior.json``."""

from savgs_ident.core.files import warning_record
from savgs_ident.core.presentation import Origin
from savgs_ident.inference.result import Marginal, Posterior


def posterior_record(posterior: Posterior, origin: Origin) -> dict[str, object]:
    """The contract's keys first, then further results and the origin.

    ``parameters`` holds all marginals, the identified ones first, then the likelihood's scales, then what was
    known to a tolerance.
    """
    convergence, (inside, compared) = posterior.convergence, posterior.count_inside
    return {
        "parameters": {each.name: _marginal(each) for each in posterior.marginals},
        "sampler": posterior.sampler,
        "wall_s": posterior.wall_s,
        "ess_min": convergence.ess_min,
        "converged": convergence.converged,
        "divergences": convergence.divergences,
        "acceptance": convergence.acceptance,
        "schema": 1,
        "explained": posterior.explained,
        "reasons": posterior.reasons,
        "sentences": posterior.sentences,
        "r_hat_max": convergence.r_hat_max,
        "target_ess": convergence.target_ess,
        "pareto_k": convergence.pareto_k,
        "heaviest_weight": convergence.heaviest_weight,
        "evaluations": convergence.evaluations,
        "unsolved": convergence.unsolved,
        "draws": dict(zip(("chains", "length"), next(iter(posterior.draws.values())).shape, strict=True)),
        "predictive": {
            "inside": inside,
            "compared": compared,
            "share": inside / compared if compared else None,
            "expected": 0.95,
        },
        "correlation": _correlation(posterior),
        "nuisance": [each.name for each in posterior.of_role("nuisance")],
        "effects": posterior.effects,
        "origin": origin.record,
        "warnings": [warning_record(warning) for warning in origin.warnings],
    }


def _marginal(each: Marginal) -> dict[str, object]:
    return {
        "median": each.median,
        "sd": each.sd,
        "q025": each.q025,
        "q975": each.q975,
        "unit": each.unit,
        "ess_bulk": each.ess_bulk,
        "ess_tail": each.ess_tail,
        "r_hat": each.r_hat,
        "role": each.role,
        "prior": each.prior,
        "contraction": each.contraction,
        "laplace": {"value": each.laplace_value, "sd": each.laplace_sd},
        "autocorrelation": each.autocorrelation,
        "profile": each.profile and {"values": each.profile.values, "rise": each.profile.rise},
    }


def _correlation(posterior: Posterior) -> dict[str, dict[str, float]]:
    names = tuple(each.name for each in posterior.of_role("identified"))
    rows = posterior.correlation(names).tolist()
    return {name: dict(zip(names, row, strict=True)) for name, row in zip(names, rows, strict=True)}
