"""The posterior report: one page that an engineer reads from the top down.

Whether the numbers may be used comes first, then the findings in words, the parameters, the pictures, the convergence
and the origin. Every cell of a table is a text that was rounded here to what its error justifies.
"""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from savgs_ident.core.presentation import Origin
from savgs_ident.inference.result import Marginal, Posterior
from savgs_ident.report.html import Picture, embed, render_page
from savgs_ident.report.posterior.figures import (
    MOST_TRACES,
    SURPLUS_SHOWN,
    corner_figure,
    profile_figure,
    rank_surplus,
    trace_figure,
)
from savgs_ident.report.posterior.predicted import predicted_of
from savgs_ident.report.posterior.text import (
    GOOD_R_HAT,
    NUISANCE_WORDS,
    SAMPLERS,
    before,
    chance_of_inside,
    checks,
    interval_words,
    predictive_sentence,
    reasons,
    scope_sentence,
    shift_in_sd,
    short,
    verdict_line,
)
from savgs_ident.report.text import (
    DASH,
    count,
    decimal,
    interval,
    numeral,
    percentage,
    signed,
    unit_text,
    with_error,
)

_LEAST_WIDE = 1.2


@dataclass(frozen=True)
class Strip:
    """Where two intervals lie on a common scale from 0 to 100 per cent, the one before the data and the one after.

    ``words`` says the same for those who cannot see it.
    """

    prior_from: float
    prior_wide: float
    from_: float
    wide: float
    words: str


@dataclass(frozen=True)
class MarginalRow:
    """An identified parameter or a scale of the likelihood."""

    name: str
    about: str
    median: str
    sd: str
    interval: str
    unit: str
    contraction: str
    place: Strip | None


@dataclass(frozen=True)
class ToleranceRow:
    """A parameter that was known to a tolerance, before and after."""

    name: str
    about: str
    before: str
    after: str
    unit: str
    shift: str
    contraction: str


@dataclass(frozen=True)
class DiagnosticRow:
    """How well one parameter was sampled; ``over_laplace`` is the ratio of the standard deviations."""

    name: str
    r_hat: str
    ess_bulk: str
    ess_tail: str
    autocorrelation: str
    over_laplace: str


def marginal_row(each: Marginal) -> MarginalRow:
    """One line of the table of identified parameters or of the likelihood's scales."""
    return MarginalRow(
        name=each.name,
        about=NUISANCE_WORDS.get(each.name, each.about) if each.role == "nuisance" else short(each.about),
        median=numeral(each.median, each.sd),
        sd=numeral(each.sd, each.sd),
        interval=interval(each.q025, each.q975, each.sd),
        unit=unit_text(each.unit),
        contraction=percentage(each.contraction),
        place=_strip(each),
    )


def tolerance_row(each: Marginal) -> ToleranceRow:
    """One line of the table of what was known to a tolerance."""
    return ToleranceRow(
        name=each.name,
        about=short(each.about),
        before=before(each),
        after=with_error(each.median, each.sd),
        unit=unit_text(each.unit),
        shift=signed(shift_in_sd(each), 1),
        contraction=percentage(each.contraction, 0),
    )


def diagnostic_row(each: Marginal) -> DiagnosticRow:
    """One line of the table of convergence by parameter."""
    return DiagnosticRow(
        name=each.name,
        r_hat=decimal(each.r_hat, 3),
        ess_bulk=count(each.ess_bulk),
        ess_tail=count(each.ess_tail),
        autocorrelation=decimal(each.autocorrelation, 1),
        over_laplace=decimal(each.sd / each.laplace_sd, 2) if each.laplace_sd > 0.0 else DASH,
    )


def _strip(each: Marginal) -> Strip | None:
    """None where nothing was known beforehand."""
    low, high = each.prior
    start, end = min(low, each.q025), max(high, each.q975)
    if not (isfinite(start) and isfinite(end) and end > start):
        return None

    def at(value: float) -> float:
        return 100.0 * (value - start) / (end - start)

    # A very narrow interval is still visible.
    wide = max(at(each.q975) - at(each.q025), _LEAST_WIDE)
    from_ = min(max(0.5 * (at(each.q975) + at(each.q025)) - 0.5 * wide, 0.0), 100.0 - wide)
    words = (
        f"before {interval(low, high, 0.01 * (high - low))}, after {interval(each.q025, each.q975, each.sd)}"
    )
    return Strip(round(at(low), 2), round(at(high) - at(low), 2), round(from_, 2), round(wide, 2), words)


def posterior_html(posterior: Posterior, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same posterior gives the same bytes."""
    identified, nuisance = (posterior.of_role(role) for role in ("identified", "nuisance"))
    tolerated = posterior.known_before
    chains = next(iter(posterior.draws.values())).shape[0]
    return render_page(
        "posterior.html.j2",
        {
            "rig": posterior.model.plant_name,
            "effects": " and ".join(posterior.effects) or "no friction",
            "sampler": SAMPLERS[posterior.sampler],
            "origin": origin,
            "verdict": verdict_line(posterior),
            "explained": posterior.explained,
            "reasons": reasons(posterior),
            "sentences": (*posterior.sentences, scope_sentence(posterior)),
            "facts": _facts(posterior),
            "identified": [marginal_row(each) for each in identified],
            "nuisance": [marginal_row(each) for each in nuisance],
            "tolerated": [tolerance_row(each) for each in sorted(tolerated, key=_moved, reverse=True)],
            "moved": sum(_moved(each) > 1.0 for each in tolerated),
            "corner": embed(corner_figure(posterior), _corner_words(posterior)),
            "traced": "all chains" if chains <= MOST_TRACES else f"{MOST_TRACES} of the {chains} chains",
            "surplus": f"{SURPLUS_SHOWN:g}",
            "traces": [_trace(posterior, each) for each in (*identified, *nuisance)],
            "profiles": _profiles(posterior),
            "predictive": predictive_sentence(posterior),
            "predicted": predicted_of(posterior),
            "checks": checks(posterior),
            "diagnostics": [diagnostic_row(each) for each in (*identified, *nuisance)],
        },
    )


def _facts(posterior: Posterior) -> tuple[dict[str, object], ...]:
    """Four numbers for a first look."""
    c = posterior.convergence
    inside, total = posterior.count_inside
    share = percentage(inside / total) if total else DASH
    return (
        {
            "name": "Converged",
            "value": "yes" if c.converged else "no",
            "then": SAMPLERS[posterior.sampler].split(" ")[0],
            "bad": not c.converged,
        },
        {
            "name": "Effective sample size",
            "value": count(c.ess_min),
            "then": f"target {count(c.target_ess)}",
            "bad": not c.ess_min >= c.target_ess,
        },
        {
            "name": "Largest R-hat",
            "value": decimal(c.r_hat_max, 3),
            "then": "1 is perfect",
            "bad": not (c.converged or c.r_hat_max <= GOOD_R_HAT),
        },
        {
            "name": "Inside the 95 % band",
            "value": share,
            "then": f"{inside} of {total}",
            "bad": inside < chance_of_inside(total)[0],
        },
    )


def _moved(each: Marginal) -> float:
    return abs(shift_in_sd(each))


def _corner_words(posterior: Posterior) -> str:
    texts = "; ".join(interval_words(each) for each in posterior.of_role("identified"))
    return f"Corner plot of the posterior. {texts}."


def _trace(posterior: Posterior, each: Marginal) -> Picture:
    worst = float(np.max(np.abs(rank_surplus(posterior.draws[each.name], each.autocorrelation))))
    words = (
        f"Trace and rank map of {each.name}: R-hat {each.r_hat:.3f}; the largest excess of a chain is {worst:.1f}"
        " standard deviations."
    )
    return embed(trace_figure(posterior, each), words)


def _profiles(posterior: Posterior) -> list[Picture]:
    pictures = []
    for each in posterior.of_role("identified"):
        if each.profile is not None:
            ends = interval(float(each.profile.values[0]), float(each.profile.values[-1]), each.sd)
            highest = float(np.max(each.profile.rise))
            words = f"Profile, marginal and Laplace parabola of {each.name} from {ends}; it rises to {highest:.1f}."
            pictures.append(embed(profile_figure(posterior, each, each.profile), words))
    return pictures
