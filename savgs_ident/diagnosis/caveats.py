"""What a reader must know before using a verdict: its warnings."""

from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem
from savgs_ident.diagnosis.gap import FurtherShrink, Shrink
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.inference.laplace_fit import LaplaceFit

FURTHER, FURTHER_AT_LEAST = 3.0, 0.02
"""A recording that took no part is missed by more where its gap is so many times that of the tests held out, and so
much of its response [1]. Origin: by choice; a sweep is missed by 0.8 % by the error of its prediction alone."""


def write_further(further: FurtherShrink | None, held_out: Shrink) -> tuple[str, ...]:
    """What a recording that took no part says against what is named, a sentence; none where it says nothing."""
    if further is None or not further.after > max(FURTHER * held_out.after, FURTHER_AT_LEAST):
        return ()
    return (
        f"{further.name}, which took no part, is missed by {100.0 * further.after:.3g} % of its response with what "
        f"is named, and tests that were held out by {100.0 * held_out.after:.3g} %: it does not hold there.",
    )


def write_warnings(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, named: LaplaceFit, beyond: float
) -> tuple[str, ...]:
    """What the reader must know before using the verdict, a sentence each.

    ``named`` is the fit of what is named, ``beyond`` what it gains over the baseline in the last tests when these are
    left out together [nat per datum].
    """
    constants = problem.constants
    found = [
        f"The fit of {hypothesis} found no periodic motion of the plant, so this hypothesis was not evaluated: "
        f"{status.advice}."
        for hypothesis, status in evidence.findings.lost
    ]
    tests, fewest = problem.data.tests, constants.fewest_held_out_tests
    if tests < fewest:
        found.append(
            f"There are {tests} tests, or windows of them, so that each that was left out is predicted from few: "
            f"figures of held-out tests are rough. Record {fewest} or more, or for longer."
        )
    if evidence.refit_failed:
        found.append(
            "The fit of the named effects on twice as many mesh nodes failed: their parameters still contain the "
            "discretisation error."
        )
    if evidence.chosen.hypothesis in map(Hypothesis, problem.plant.known):
        found.append(
            f"{evidence.chosen.hypothesis} were tried together to begin with, as a model of this plant has them; the "
            "search did not find them one after the other."
        )
    for mode, name in (
        (problem.base, "the recalibrated baseline"),
        (named, "the model with the named effects"),
    ):
        if not mode.status.ok:
            found.append(f"The search for {name} did not converge: {mode.status.advice}.")
    if evidence.besides:
        found.append("Something more may be missing that is too small to be identified.")
    if evidence.kind in ("effect", "several") and evidence.left_by_named > constants.reported_share:
        found.append(
            f"The named effects leave {100.0 * evidence.left_by_named:.1f} % of the baseline's misfit beyond the "
            "noise: their laws are not quite those of the plant, or a small effect is missing besides. The intervals "
            "of their parameters contain the noise alone."
        )
    if evidence.kind in ("effect", "several") and beyond <= 0.0:
        found.append(
            "The last third of the tests, the fastest dwells and roads, left out together, is predicted no better "
            "with what is named than without: do not use it beyond the tests that were recorded."
        )
    return tuple(dict.fromkeys(found))
