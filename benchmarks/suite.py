"""The benchmarks by name, and the run of those that were asked for."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from benchmarks.outcome import Outcome, Tell

NAMES = ("response", "harmonicbalance", "scipy", "diffrax", "fit", "mcap")
"""What can be asked for."""

PEERS = ("harmonicbalance", "scipy", "diffrax")


class Size(NamedTuple):
    """How much is run: dwells [Hz] and minutes of MCAP."""

    dwells_hz: tuple[float, ...]
    mcap_minutes: float


def run_suite(names: Sequence[str], size: Size, tell: Tell) -> Outcome:
    """Run the named benchmarks; a peer brings our own response along, to be compared with."""
    outcome = Outcome()
    if "fit" in names or "mcap" in names:
        from benchmarks.processes import measure_fit, measure_mcap

        if "fit" in names:
            outcome += measure_fit(tell)
        if "mcap" in names:
            outcome += measure_mcap(size.mcap_minutes, tell)
    if {"response", *PEERS} & set(names):
        outcome += _responses(names, size.dwells_hz, tell)
    return outcome + Outcome(speedups(outcome.figures))


def _responses(names: Sequence[str], dwells_hz: tuple[float, ...], tell: Tell) -> Outcome:
    from benchmarks import by_diffrax, by_harmonicbalance, by_package, by_scipy
    from benchmarks.task import make_task

    task = make_task(dwells_hz)
    integrate = by_diffrax.make_integrator(task)
    tell("reference: tight time integration")
    reference = by_diffrax.integrate_reference(task, integrate)
    tell("this package")
    outcome = by_package.measure(task, reference)
    if "diffrax" in names:
        tell("diffrax")
        outcome += by_diffrax.measure(task, integrate, reference)
    if "scipy" in names:
        outcome += by_scipy.measure(task, reference, tell)
    if "harmonicbalance" in names:
        outcome += by_harmonicbalance.measure(task, reference, tell)
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
