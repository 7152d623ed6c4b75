"""A posterior in words: the texts that terminal and page share, and the report in the terminal.

The terminal shows whether the sampler converged, the parameters, the convergence and the posterior prediction.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from math import floor, log, log10, sqrt
from types import MappingProxyType

import numpy as np
from rich.console import Group, RenderableType

from savgs_ident.fit.result import OverWindows
from savgs_ident.inference.result import HarmonicPosterior, Marginal, MotionPosterior, Posterior
from savgs_ident.report.fit import value_with_error
from savgs_ident.report.text import DASH, count, counted, decimal, numeral, percentage, plain, table
from savgs_ident.responses.selection import by_kind

NUISANCE_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "noise_scale": (
            "Factor on the noise that was estimated from the recordings; 1 if that estimate is right."
        ),
        "discrepancy": (
            "Size of the small errors that the model may have, as a share of the response, at each of its ports and"
            " inputs, or of the force of a drive; 0 for a perfect model. They keep intervals from becoming absurdly"
            " narrow."
        ),
    }
)
"""What the scales of the likelihood mean."""

SAMPLERS: Mapping[str, str] = MappingProxyType(
    {"emcee": "emcee (an ensemble of walkers)", "nuts": "NUTS (Hamiltonian, gradient-based)"}
)
"""The samplers in words."""

GOOD_R_HAT = 1.01
"""R-hat up to which chains agree."""

NORMAL_95 = 1.959964
"""Half of the central 95 % interval of a normal distribution [sd]."""


@dataclass(frozen=True)
class Check:
    """One line of the convergence table: a quantity, its value, what it should be, what it means."""

    name: str
    value: str
    wanted: str
    meaning: str


def verdict_line(posterior: Posterior) -> str:
    """Whether the numbers may be used, first of all."""
    if posterior.trusted:
        return "Converged: these numbers may be used."
    if not posterior.explained:
        return "The model does not explain the data: look for what is missing with `diagnose`."
    return "Not converged: these numbers must not be used."


def reasons(posterior: Posterior) -> tuple[str, ...]:
    """Why not, at least one sentence where they may not."""
    given = posterior.reasons or ("The sampler gave no reason.",)
    return () if posterior.trusted else tuple(map(_as_sentence, given))


def scope_sentence(posterior: Posterior) -> str:
    """What was estimated from what."""
    identified, tolerated = len(posterior.of_role("identified")), len(posterior.known_before)
    along = (
        f"; {tolerated} more that are known to a tolerance or an order of magnitude were sampled too and marginalised"
        if tolerated
        else "; everything else was held at its value"
    )
    were = "was" if identified == 1 else "were"
    return f"{counted(identified, 'parameter')} {were} identified from {_compared(posterior)}{along}."


def _compared(posterior: Posterior) -> str:
    """With what the model was compared."""
    if isinstance(posterior, MotionPosterior):
        time = posterior.motion.row_times
        return f"{posterior.measured.size} rows of the drive's force over {time[-1] - time[0]:.3g} s"
    assert isinstance(posterior, HarmonicPosterior), posterior
    dwells, windows = by_kind(posterior)
    compared = [_dwells(dwells)] if dwells else []
    compared += [_windows(windows)] if windows else []
    return " and ".join(compared)


def _dwells(posterior: HarmonicPosterior) -> str:
    measured, used = posterior.measured, posterior.predictive.used
    orders = np.flatnonzero(np.any(used, axis=(0, 1)))
    span = f"orders {orders[0]} to {orders[-1]}" if orders.size > 1 else f"order {' '.join(map(str, orders))}"
    return (
        f"{counted(len(measured.tests), 'dwell')} between {measured.frequency[0]:.2f} and "
        f"{measured.frequency[-1]:.2f} Hz ({np.sum(used)} harmonics, {span})"
    )


def _windows(posterior: HarmonicPosterior) -> str:
    measured, used = posterior.measured, posterior.predictive.used
    frequency = OverWindows.of(measured, np.any(used, axis=1)).frequency
    return (
        f"{counted(len(measured.tests), 'window')} of tests that do not repeat ({np.sum(used)} harmonics at "
        f"{frequency.size} frequencies from {frequency[0]:.2g} to {frequency[-1]:.3g} Hz)"
    )


def chance_of_inside(total: int) -> tuple[int, int]:
    """How many of ``total`` harmonics lie inside 95 % regions if the model is right, two standard deviations."""
    middle, scatter = 0.95 * total, 2.0 * sqrt(0.95 * 0.05 * total)
    return round(max(middle - scatter, 0.0)), round(min(middle + scatter, total))


def predictive_sentence(posterior: Posterior) -> str:
    """How much of what was measured the posterior would have predicted, and what that says about the model."""
    inside, total = posterior.count_inside
    if not total:
        return "No measured harmonic was compared with a prediction."
    what = "rows of force" if isinstance(posterior, MotionPosterior) else "harmonics"
    low, high = chance_of_inside(total)
    verdict = ""
    if inside < low:
        verdict = " That is fewer than chance allows: the model misses something."
    if inside > high:
        verdict = (
            " That is more than chance allows: the model errs by less than small errors of every model may."
            if posterior.explained
            else " That is more than chance allows: errors as large as this model would have to make are allowed for."
        )
    return (
        f"Of {total} measured {what} {inside} ({percentage(inside / total)}) lie where 95 % of the repetitions"
        f" lie that the posterior predicts; for a perfect model it would be {low} to {high}.{verdict}"
    )


def correlation_sentence(posterior: Posterior) -> str | None:
    """The identified parameters that trade off most; None for fewer than two, or where none moves."""
    names = tuple(
        each.name for each in posterior.of_role("identified") if np.ptp(posterior.draws[each.name]) > 0.0
    )
    if len(names) < 2:
        return None
    matrix = posterior.correlation(names)
    one, other = max(combinations(range(len(names)), 2), key=lambda pair: abs(matrix[pair]))
    return f"Strongest correlation: {names[one]} with {names[other]}, {matrix[one, other]:+.2f}."


def shift_in_sd(each: Marginal) -> float:
    """How far the median has moved from the middle of the prior interval, in prior standard deviations [1].

    Of what is known to an order of magnitude those of the logarithm.
    """
    low, high, median = *each.prior, each.median
    if each.role == "typical":
        low, high, median = log(low), log(high), log(median)
    return (median - 0.5 * (low + high)) / ((high - low) / (2.0 * NORMAL_95))


def checks(posterior: Posterior) -> tuple[Check, ...]:
    """How the sampling went, line by line."""
    c = posterior.convergence
    chains, length = next(iter(posterior.draws.values())).shape
    slowest = max(posterior.of_role("identified"), key=lambda each: each.autocorrelation)
    return (
        Check(
            "Chains",
            f"{chains} of {count(length)} draws",
            DASH,
            "Independent chains; all must have the same distribution.",
        ),
        Check(
            "Largest R-hat",
            decimal(c.r_hat_max, 3),
            f"at most {GOOD_R_HAT}, a little more for what is known to a tolerance",
            "Spread of all chains together over the spread within each, by ranks; 1 when they agree.",
        ),
        Check(
            "Smallest effective sample size",
            count(c.ess_min),
            f"at least {count(c.target_ess)}",
            "Number of independent draws of the same precision, for the median (bulk) and for the ends of"
            " the 90 % interval (tail), whichever is less, over the identified parameters.",
        ),
        Check(
            "Autocorrelation time",
            f"{decimal(slowest.autocorrelation, 1)} draws ({slowest.name})",
            "far below the length of a chain",
            "Number of draws after which draws are independent; the largest of the identified parameters.",
        ),
        *_sampler_checks(posterior),
        Check(
            "Time taken",
            f"{decimal(posterior.wall_s, 1)} s",
            DASH,
            "From the measured response to the last draw.",
        ),
    )


def _sampler_checks(posterior: Posterior) -> tuple[Check, ...]:
    """What the sampler reports of its proposals."""
    c, gradient = posterior.convergence, posterior.sampler == "nuts"
    return (
        Check(
            "Acceptance",
            percentage(c.acceptance),
            "not near 0",
            "Share of proposed moves that the exact model accepted.",
        ),
        Check(
            "Divergences",
            count(c.divergences) if gradient else "not applicable",
            "0",
            "Diverging trajectories of the gradient-based sampler: regions of the posterior that it did not sample.",
        ),
        Check(
            "Pareto k",
            decimal(c.pareto_k, 2),
            "below 0.7",
            "Shape of the tail of exact over approximate density at the proposals; above 0.7 the proposals do not"
            " cover the posterior, unless that ratio is nearly the same everywhere.",
        ),
        Check(
            "Heaviest weight",
            decimal(c.heaviest_weight, 2),
            "below 1.1 where Pareto k is not below 0.7",
            "The largest of these ratios over their mean.",
        ),
        Check(
            "Exact evaluations",
            count(c.evaluations),
            DASH,
            "How often the full model was solved, for all that was measured each time.",
        ),
        Check(
            "Not solved",
            count(c.unsolved),
            "few",
            "Proposals at which the solver found no motion of the model; they were rejected.",
        ),
    )


def short(about: str) -> str:
    """What a parameter is, in a few words."""
    return about.split(",")[0]


def interval_words(each: Marginal) -> str:
    """A marginal in a few words, for those who cannot see a picture."""
    return (
        f"{each.name}: median {numeral(each.median, each.sd)}, standard deviation {numeral(each.sd, each.sd)}"
    )


def _as_sentence(text: str) -> str:
    """``text`` with a capital at its head and a full stop at its end."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


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
        plain(
            "Identifiability" if not why else "Identifiability, by numbers that are not to be trusted", "bold"
        ),
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
        f" smallest ESS {count(c.ess_min)} (target {count(c.target_ess)}),"
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
    known = posterior.known_before
    if not known:
        return []
    moved = [each for each in known if abs(shift_in_sd(each)) >= 0.5]
    title = (
        f"Known beforehand, to a tolerance or an order of magnitude, and sampled too: {len(known)},"
        f" of which {len(moved)} changed by half a tolerance or more"
    )
    if not moved:
        return [plain(title), plain("")]
    rows = [
        (
            each.name,
            before(each),
            value_with_error(each.median, each.sd),
            each.unit,
            f"{shift_in_sd(each):+.1f}",
        )
        for each in sorted(moved, key=lambda each: -abs(shift_in_sd(each)))
    ]
    headers = ("parameter", "before ± 1 sd", "after ± 1 sd", "unit", "change\n[sd]")
    return [table(title, headers, rows, texts=(0, 3))]


def before(each: Marginal) -> str:
    """What was known of a parameter before the data."""
    low, high = each.prior
    if each.role == "typical":
        middle = sqrt(low * high)
        return f"about {numeral(middle, 0.1 * middle)}, within a factor {numeral(high / middle, 0.1 * high / middle)}"
    return value_with_error(0.5 * (low + high), (high - low) / (2.0 * NORMAL_95))


def _interval(each: Marginal) -> str:
    places = min(max(1 - floor(log10(each.sd)), 0), 12) if each.sd > 0.0 else 6
    return f"{each.q025:.{places}f} to {each.q975:.{places}f}"
