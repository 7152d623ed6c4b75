"""The benchmarks by name, and the run of those that were asked for."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.outcome import Outcome, Progress
from benchmarks.task import DWELLS_HZ

NAMES = (
    "response", "harmonicbalance", "scipy", "diffrax", "shooting", "fit", "posterior", "posterior-scipy",
    "collocation", "mcap", "readers", "diagnosis", "sindy", "closed-loop", "campaigns",
)  # fmt: skip
"""What can be asked for."""

PEERS = ("harmonicbalance", "scipy", "diffrax", "shooting")


class Size(NamedTuple):
    """How much is run.

    Attributes:
        dwells_hz: dwells [Hz].
        recording_minutes: length of the recordings that are read.
        target_ess: effective sample size that the posterior's samplers are to reach.
        integrations: of single dwells by scipy, for the time of a likelihood.
        stretch_steps: of emcee's own move, at most.
        trials: folders of blind trials on which the diagnosis is compared.
        campaigns: how many are identified side by side.
    """

    dwells_hz: tuple[float, ...]
    recording_minutes: float
    target_ess: float
    integrations: int
    stretch_steps: int
    trials: tuple[Path, ...]
    campaigns: int = 32


def run_suite(names: Sequence[str], size: Size, progress: Progress) -> Outcome:
    """Run the named benchmarks; a peer brings our own figures along, to be compared with."""
    outcome = _processes(names, size, progress)
    if {"response", *PEERS} & set(names):
        outcome += _responses(names, size.dwells_hz, progress)
    # What follows compiles, and what times compilation has gone before.
    if "posterior-scipy" in names:
        from benchmarks import posterior_by_scipy

        outcome += posterior_by_scipy.measure(size.dwells_hz, size.integrations, size.stretch_steps, progress)
    if "collocation" in names:
        from benchmarks import cross_check

        outcome += cross_check.measure(size.dwells_hz, progress)
    if "sindy" in names:
        from benchmarks import diagnosis_peers

        outcome += diagnosis_peers.measure(size.trials, progress)
    if "closed-loop" in names:
        from benchmarks import closed_loop

        outcome += closed_loop.measure(progress)
    return outcome + Outcome(speedups(outcome.figures) | posterior_speedup(outcome.figures, size.dwells_hz))


def _processes(names: Sequence[str], size: Size, progress: Progress) -> Outcome:
    outcome = Outcome()
    if "fit" in names:
        from benchmarks.processes import measure_fit

        outcome += measure_fit(progress)
    if {"posterior", "posterior-scipy"} & set(names):
        from benchmarks.posterior_process import measure_posterior

        outcome += measure_posterior(size.target_ess, progress)
    if "diagnosis" in names:
        from benchmarks.processes import measure_diagnosis

        outcome += measure_diagnosis(progress)
    if "mcap" in names:
        from benchmarks.processes import measure_mcap

        outcome += measure_mcap(size.recording_minutes, progress)
    if "readers" in names:
        from benchmarks.processes import measure_readers

        outcome += measure_readers(size.recording_minutes, progress)
    if "campaigns" in names:
        from benchmarks import campaigns

        outcome += campaigns.measure(progress, size.campaigns)
    return outcome


def _responses(names: Sequence[str], dwells_hz: tuple[float, ...], progress: Progress) -> Outcome:
    from benchmarks import by_diffrax, by_harmonicbalance, by_package, by_scipy, by_shooting
    from benchmarks.task import make_task

    task = make_task(dwells_hz)
    integrate = by_diffrax.make_integrator(task)
    progress("reference: tight time integration")
    reference = by_diffrax.integrate_reference(task, integrate)
    progress("this package")
    outcome = by_package.measure(task, reference)
    if "diffrax" in names:
        progress("diffrax")
        outcome += by_diffrax.measure(task, integrate, reference)
    if "scipy" in names:
        outcome += by_scipy.measure(task, reference, progress)
    if "harmonicbalance" in names:
        outcome += by_harmonicbalance.measure(task, reference, progress)
    if "shooting" in names:
        outcome += by_shooting.measure(task, reference, progress)
    return outcome


def speedups(figures: Mapping[str, float]) -> dict[str, float]:
    """How many times longer each measured peer takes than this package, for value and for gradient.

    A peer's gradient is taken as one run and four more, by finite differences.
    """
    ratios = {}
    for peer in PEERS:
        theirs = figures.get(f"{peer}_ms_per_frequency")
        if theirs is not None:
            ratios[f"speedup_{peer}"] = theirs / figures["response_ms_per_frequency"]
            ours = figures["response_ms_per_frequency"] * figures["gradient_over_value_cold"]
            ratios[f"speedup_gradient_{peer}"] = 5.0 * theirs / ours
    return ratios


def posterior_speedup(figures: Mapping[str, float], dwells_hz: Sequence[float]) -> dict[str, float]:
    """How many times longer emcee takes for an effective draw with a likelihood by scipy.

    The package's processes sample all dwells of the campaign; a peer that had fewer is not compared with them.
    """
    ours, theirs = (figures.get(f"posterior_ess_per_s_{each}") for each in ("emcee", "scipy"))
    if ours is None or theirs is None or tuple(dwells_hz) != DWELLS_HZ:
        return {}
    return {"speedup_posterior_scipy": ours / theirs}
