"""What a reader must know before using a verdict: its warnings."""

from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.inference.laplace_fit import LaplaceFit


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
