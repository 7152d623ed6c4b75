"""The posterior report: one page that an engineer reads from the top down.

Whether the numbers may be used comes first, then what was found in words, then numbers, then pictures, then how
they were computed and from what.
"""

import numpy as np

from savgs_ident.posterior.result import Marginal, Posterior
from savgs_ident.report.html import Picture, embed, render_page
from savgs_ident.report.numerals import DASH, count, decimal, interval, percentage
from savgs_ident.report.origin import Origin
from savgs_ident.report.posterior_bode import predictive_band, predictive_figure
from savgs_ident.report.posterior_corner import corner_figure
from savgs_ident.report.posterior_profiles import profile_figure
from savgs_ident.report.posterior_rows import diagnostic_row, marginal_row, order_rows, tolerance_row
from savgs_ident.report.posterior_traces import MOST_TRACES, SURPLUS_SHOWN, rank_surplus, trace_figure
from savgs_ident.report.posterior_words import (
    GOOD_R_HAT,
    SAMPLERS,
    chance_of_inside,
    checks,
    interval_words,
    predictive_sentence,
    reasons,
    scope_sentence,
    shift_in_sd,
    verdict_line,
)
from savgs_ident.report.readings import READINGS


def posterior_html(posterior: Posterior, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same posterior gives the same bytes."""
    identified, nuisance, tolerated = (
        posterior.of_role(role) for role in ("identified", "nuisance", "tolerated")
    )
    chains = next(iter(posterior.draws.values())).shape[0]
    return render_page(
        "posterior.html.j2",
        {
            "rig": posterior.rig.name,
            "effects": " and ".join(posterior.effects) or "no friction",
            "sampler": SAMPLERS[posterior.sampler],
            "origin": origin,
            "verdict": verdict_line(posterior),
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
            "bode": [_bode(posterior, c) for c in _compared(posterior)],
            "channels": [shown.title for shown in READINGS.values()],
            "orders": order_rows(posterior),
            "checks": checks(posterior),
            "diagnostics": [diagnostic_row(each) for each in (*identified, *nuisance)],
        },
    )


def _facts(posterior: Posterior) -> tuple[dict[str, object], ...]:
    """Four numbers that tell at a glance whether all is well."""
    c = posterior.convergence
    inside, total = posterior.predictive.count_inside
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
            "then": f"of {count(c.target_ess)} asked",
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
    told = "; ".join(interval_words(each) for each in posterior.of_role("identified"))
    return f"Corner plot of the posterior. {told}."


def _trace(posterior: Posterior, each: Marginal) -> Picture:
    worst = float(np.max(np.abs(rank_surplus(posterior.draws[each.name], each.autocorrelation))))
    words = (
        f"Trace and rank map of {each.name}: R-hat {each.r_hat:.3f}; no chain strays further than {worst:.1f}"
        " standard deviations of chance."
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


def _compared(posterior: Posterior) -> list[int]:
    """The channels whose first harmonic is compared anywhere."""
    return [c for c in range(len(READINGS)) if np.any(posterior.predictive.used[:, c, 1])]


def _bode(posterior: Posterior, c: int) -> Picture:
    band = predictive_band(posterior, c)
    compared = np.isfinite(band.measured)
    title = tuple(READINGS.values())[c].title
    words = (
        f"Magnitude and phase of the {title} over road frequency, measured against the 95 % predictive band:"
        f" {np.sum(band.inside & compared)} of {np.sum(compared)} first harmonics are inside."
    )
    return embed(predictive_figure(posterior, c), words)
