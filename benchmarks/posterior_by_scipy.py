"""emcee as most would set it up: its own move, and a likelihood that integrates every dwell by scipy.

A run of any use would take months, so its figure is put together from its two parts: how long an evaluation
of the likelihood takes (:mod:`benchmarks.scipy_likelihood`) and how many evaluations make an independent draw
(:mod:`benchmarks.stretch_moves`).
"""

from collections.abc import Sequence

from benchmarks.outcome import Outcome, Progress
from benchmarks.posterior_problem import pose_posterior
from benchmarks.scipy_likelihood import time_likelihood
from benchmarks.stretch_moves import LONG_ENOUGH, Stretching, stretch


def measure(dwells_hz: Sequence[float], integrations: int, most_steps: int, progress: Progress) -> Outcome:
    """Effective draws per second, extrapolated."""
    posed = pose_posterior(dwells_hz, progress)
    stretching = stretch(posed, most_steps, progress)
    return extrapolated(stretching, time_likelihood(posed, integrations, progress), integrations)


def extrapolated(stretching: Stretching, evaluation_s: float, integrations: int) -> Outcome:
    """Effective draws per second of one process, from an autocorrelation time and the time of an evaluation."""
    length = stretching.steps / stretching.autocorrelation
    doubt = f"; {LONG_ENOUGH:.0f} times were wanted, so take it for a rough figure"
    notes = (
        f"posterior by scipy: EXTRAPOLATED, no such run was made. An evaluation is the sum of the dwells' mean "
        f"times in {integrations} integrations of single dwells at draws of the posterior, in one process; "
        "emcee can share walkers among processes, one a core, which would gain the number of cores at most.",
        f"posterior by scipy: the autocorrelation time is that of {stretching.steps} steps of emcee's stretch "
        f"move on the surrogate, {length:.0f} times as many{'' if stretching.trusted else doubt}.",
    )
    return Outcome(
        {
            "scipy_likelihood_s": evaluation_s,
            "stretch_autocorrelation": stretching.autocorrelation,
            "posterior_ess_per_s_scipy": 1.0 / (stretching.autocorrelation * evaluation_s),
        },
        notes,
    )
