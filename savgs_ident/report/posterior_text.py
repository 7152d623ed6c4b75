"""A posterior in the terminal: whether it converged, the parameters, what it predicts, what it tells in words."""

from math import floor, log10

from rich.console import Group, RenderableType

from savgs_ident.posterior.result import Marginal, Posterior
from savgs_ident.report.fit_text import value_with_error
from savgs_ident.report.numerals import count, decimal, percentage
from savgs_ident.report.posterior_words import (
    correlation_sentence,
    predictive_sentence,
    reasons,
    scope_sentence,
    shift_in_sd,
    verdict_line,
)
from savgs_ident.report.terminal import plain, table

_NORMAL_95 = 1.959964


def posterior_text(posterior: Posterior) -> RenderableType:
    """Tables and sentences of a posterior, most important first."""
    why = reasons(posterior)
    correlation = correlation_sentence(posterior)
    parts = [
        *([plain(verdict_line(posterior), "bold")] if why else []),
        *(plain(f"- {reason}") for reason in why),
        *([plain("")] if why else []),
        _identified(posterior),
        *([plain(correlation)] if correlation else []),
        plain(_sampling(posterior)),
        plain(""),
        _nuisance(posterior),
        *_tolerances(posterior),
        plain("What the data tell", "bold"),
        *(plain(f"- {sentence}") for sentence in posterior.sentences),
        plain(f"- {scope_sentence(posterior)}"),
        plain(f"- {predictive_sentence(posterior)}"),
    ]
    return Group(*parts)


def _identified(posterior: Posterior) -> RenderableType:
    rows = [
        (
            each.name,
            value_with_error(each.median, each.sd),
            _interval(each),
            "" if each.unit == "1" else each.unit,
            percentage(each.contraction),
            count(min(each.ess_bulk, each.ess_tail)),
        )
        for each in posterior.of_role("identified")
    ]
    headers = ("parameter", "median ± 1 sd", "95 % interval", "unit", "shrunk", "ESS")
    return table("Identified parameters", headers, rows, texts=(0, 3))


def _sampling(posterior: Posterior) -> str:
    c = posterior.convergence
    state = "converged" if c.converged else "NOT converged"
    return (
        f"{posterior.sampler}: {state}, largest R-hat {decimal(c.r_hat_max, 3)},"
        f" smallest ESS {count(c.ess_min)} of {count(c.target_ess)} asked,"
        f" acceptance {percentage(c.acceptance, 0)}, {c.divergences} divergences,"
        f" Pareto k {decimal(c.pareto_k, 2)}, {c.evaluations} exact evaluations ({posterior.wall_s:.1f} s)"
    )


def _nuisance(posterior: Posterior) -> RenderableType:
    rows = [
        (each.name, value_with_error(each.median, each.sd), _interval(each))
        for each in posterior.of_role("nuisance")
    ]
    return table("Scales of the likelihood", ("scale", "median ± 1 sd", "95 % interval"), rows)


def _tolerances(posterior: Posterior) -> list[RenderableType]:
    known = posterior.of_role("tolerated")
    if not known:
        return []
    moved = [each for each in known if abs(shift_in_sd(each)) >= 0.5]
    title = (
        f"Known to a tolerance and estimated along: {len(known)},"
        f" of which {len(moved)} moved by half a tolerance or more"
    )
    if not moved:
        return [plain(title), plain("")]
    rows = [
        (
            each.name,
            _before(each),
            value_with_error(each.median, each.sd),
            each.unit,
            f"{shift_in_sd(each):+.1f}",
        )
        for each in sorted(moved, key=lambda each: -abs(shift_in_sd(each)))
    ]
    headers = ("parameter", "before ± 1 sd", "after ± 1 sd", "unit", "moved\n[sd]")
    return [table(title, headers, rows, texts=(0, 3))]


def _before(each: Marginal) -> str:
    low, high = each.prior
    return value_with_error(0.5 * (low + high), (high - low) / (2.0 * _NORMAL_95))


def _interval(each: Marginal) -> str:
    places = min(max(1 - floor(log10(each.sd)), 0), 12) if each.sd > 0.0 else 6
    return f"{each.q025:.{places}f} to {each.q975:.{places}f}"
