"""The cross-check of the fit by collocation in CasADi: how long it takes, and how well the two agree."""

from collections.abc import Mapping, Sequence

from benchmarks.campaign import read_dwells, response_of
from benchmarks.outcome import Outcome, Progress
from savgs_ident.fit.collocation.crosscheck import fit_by_collocation
from savgs_ident.fit.estimate import Estimate
from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig


def measure(dwells_hz: Sequence[float], progress: Progress) -> Outcome:
    """The paper's four parameters from the samples by IPOPT, beside those from the harmonics."""
    campaign, rig, effects = read_dwells(dwells_hz), read_rig(default_rig_path()), MODELS["simtr"]
    measured = response_of(campaign)
    progress("collocation: the fit to compare with")
    by_harmonics = fit_least_squares(measured, RigModel(rig, effects), free=FREE)
    progress("collocation")
    by_samples = fit_by_collocation(campaign, measured, RigModel(rig, effects), free=FREE, progress=progress)
    took = Outcome({"collocation_s": by_samples.wall_s})
    if not by_samples.status.ok:
        return took + Outcome({}, (f"collocation: NOT SOLVED: {by_samples.status.advice}.",))
    apart = distances(by_samples.by_name, by_harmonics.by_name)
    note = (
        f"collocation: {by_samples.unknowns} unknowns, {by_samples.iterations} iterations of IPOPT; furthest "
        f"from the fit is {max(apart, key=apart.__getitem__)}."
    )
    return took + Outcome({"collocation_worst_sd": max(apart.values())}, (note,))


def distances(found: Mapping[str, Estimate], known: Mapping[str, Estimate]) -> dict[str, float]:
    """How far the paper's four parameters are from known ones, in standard errors of the latter."""
    return {name: abs(found[name].value - known[name].value) / known[name].stderr for name in FREE}
