"""Windows in which a plant has forgotten how its motion began where the comparison begins."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.core.values import as_values
from savgs_ident.plants.base import scale_of_time
from savgs_ident.plants.model import Model
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests
from savgs_ident.responses.windows import LEAD_S, estimate_whole_tests, estimate_windows
from savgs_ident.simulate.collocation import step_matrices, steps_at
from savgs_ident.simulate.compared_tests import Measurements, response_of_tests
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic

REMEMBERED = 0.01
"""Largest share of how a motion began that may be left where the comparison in a window begins [1]."""

LONGEST_LEAD_S = 9.0
"""The longest lead that is tried [s], for a plant whose time scale is 1.

Origin: as long as what is compared. Where more would be needed, it is better to estimate how motions begin.
"""

ENDURED = 0.5
"""Part of :data:`REMEMBERED` that a longer lead is to leave: a fit may find less damping than it begins with."""


def forgetful_response(
    measured: Measurements,
    model: Model,
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> HarmonicResponse:
    """The response that a model is compared with: dwells, and windows as long as it needs to forget their beginning.

    ``orders`` are compared up to ``max_frequency`` [Hz]. With a warning ``window_remembers`` for each window that is
    left out for it remembers: friction may stick through its beginning. Raises :class:`InputError` if nothing can be
    compared, or the model has no motion in any window or forgets in none.
    """
    return forgetful_motion(measured, model, orders, max_frequency, progress)[0]


def forgetful_motion(
    measured: Measurements,
    model: Model,
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> tuple[HarmonicResponse, PeriodicSolution | None]:
    """The same, and the motion of the model in all tests, where all windows are compared; None for dwells alone."""

    def in_windows(cut: Callable[..., HarmonicResponse] = estimate_windows) -> HarmonicResponse:
        return response_of_tests(measured, model.plant, orders, max_frequency, progress, cut)

    response = in_windows()
    if response.part is None:
        return response, None
    try:
        return _forgetting(response, measured, model, in_windows, progress)
    except InputError as error:
        whole = _in_whole_tests(measured, model, in_windows, progress)
        if whole is not None:
            return whole
        if not response.dwells.size:
            raise
        warnings = (*response.warnings, error.as_warning("tests_not_used"))
        return replace(only_tests(response, response.dwells), warnings=warnings), None


_InWindows = Callable[[Callable[..., HarmonicResponse]], HarmonicResponse]


def _forgetting(
    response: HarmonicResponse,
    measured: Measurements,
    model: Model,
    in_windows: _InWindows,
    progress: Progress,
) -> tuple[HarmonicResponse, PeriodicSolution | None]:
    """A response in windows of which the plant forgets the beginning, longer ones where it has to be, and its motion.

    Raises :class:`InputError` where it forgets in none of those that do not begin at rest.
    """
    left, half, motion = _left(response, model)
    unknown = _with_unknown_start(response)
    if unknown.any() and np.min(left[unknown]) >= REMEMBERED and isinstance(measured, Campaign):
        scale = scale_of_time(model.build())
        lead = _longer(scale, float(np.median(half[unknown])), float(np.median(left[unknown])))
        progress(f"cutting windows of which the first {lead:.3g} s are not compared")
        response = in_windows(partial(estimate_windows, lead_s=lead))
        if response.part is None:
            # The roads are too short for that, and the dwells remain.
            return response, None
        left, _, motion = _left(response, model)
    lasting = _lasting(response, left)
    return lasting, motion if lasting is response else None


def _in_whole_tests(
    measured: Measurements, model: Model, in_windows: _InWindows, progress: Progress
) -> tuple[HarmonicResponse, PeriodicSolution | None] | None:
    """The response of tests from their beginning, each in one window; None where none can be compared."""
    if not isinstance(measured, Campaign):
        return None
    progress("comparing whole tests: the model remembers how a motion began")
    try:
        response = in_windows(estimate_whole_tests)
        if response.part is None:
            return None
        left, _, motion = _left(response, model)
        lasting = _lasting(response, left)
    except InputError:
        return None
    return lasting, motion if lasting is response else None


def _with_unknown_start(response: HarmonicResponse) -> NDArray[np.bool_]:
    """Which of the windows begin with a state that is to be forgotten, (w,)."""
    assert response.part is not None
    return ~response.part.opens[response.windows]


def _left(
    response: HarmonicResponse, model: Model
) -> tuple[NDArray[np.float64], NDArray[np.float64], PeriodicSolution]:
    """What a model remembers of the beginning of each window [1], (w,): after the lead, and after half of it.

    And its motion in all tests.
    """
    assert response.part is not None
    plant, p = model.build(), as_values(model.table.as_dict())
    solution = simulate_periodic(plant, p, measured_excitation(plant, response, model.table))
    begin, unknown = response.part.begin, _with_unknown_start(response)

    def after(upto: NDArray[np.float64]) -> NDArray[np.float64]:
        left = remembered(solution, upto)
        # Where it is known or estimated how a motion began, there may be none all the same.
        return np.where(unknown | ~np.isfinite(left), left, 0.0)

    return after(begin), after(0.5 * begin), solution


def _longer(time_scale: float, half: float, left: float) -> float:
    """The lead [s] after which little enough is left, where that is ``left`` after the usual and ``half`` after half.

    Raises :class:`InputError` if the motion does not forget, or not soon.
    """
    lead, longest = LEAD_S * time_scale, LONGEST_LEAD_S * time_scale
    rate = np.log(half / left) / (0.5 * lead) if np.isfinite([half, left]).all() else 0.0
    longer = lead + np.log(left / (ENDURED * REMEMBERED)) / rate if rate > 0.0 else np.inf
    if longer > longest:
        if not np.isfinite(left):
            raise InputError(
                "no motion of the model was found in half of the windows or more",
                remedy="mend the parameters of the model, and look at the units of the inputs",
            )
        raise InputError(
            f"the model does not forget how a motion began: {longest:g} s before what is compared would not do",
            remedy="give the plant the damping that it has, or record tests that begin with a second of rest",
        )
    return float(longer)


def _lasting(response: HarmonicResponse, left: NDArray[np.float64]) -> HarmonicResponse:
    """The windows of which less than :data:`REMEMBERED` is ``left``."""
    forgotten, unknown = left < REMEMBERED, _with_unknown_start(response)
    if not np.isfinite(left).any():
        raise InputError(
            "the model has no motion that follows the recorded one in any window",
            remedy="begin with a model that was identified from dwells, or record a sweep or a road without steps",
        )
    if not forgotten.any() or (unknown.any() and not forgotten[unknown].any()):
        raise InputError(
            f"the model remembers {100.0 * np.min(left[unknown]):.2g} % of how a motion began where windows are "
            "compared",
            remedy="record tests that begin with a second of rest, or dwells",
        )
    gone = response.windows[~forgotten]
    warnings = tuple(
        _left_out(response.tests[d], share) for d, share in zip(gone, left[~forgotten], strict=True)
    )
    if not gone.size:
        return response
    kept = np.setdiff1d(np.arange(len(response.tests)), gone)
    return replace(only_tests(response, kept), warnings=(*response.warnings, *warnings))


def _left_out(test: str, share: float) -> DataWarning:
    """Why a window is not used of whose beginning so much is left [1]: infinite where there is no motion."""
    if not np.isfinite(share):
        what = "is left out: no motion of the model was found in it"
        return DataWarning("window_not_solved", what, test=test, remedy="mend the parameters of the model")
    return DataWarning(
        "window_remembers",
        f"is left out: the model remembers {100.0 * share:.2g} % of how the motion in it began",
        test=test,
        remedy="let the plant move for some seconds before what matters",
    )


def remembered(solution: PeriodicSolution, upto: NDArray[np.float64]) -> NDArray[np.float64]:
    """What is left of how the motion in each window began at phases (D,) [rad]: shares [1] of w windows, (w,).

    A deviation of the states, each in units of its largest value in the window, is followed along the linearised
    motion; the windows are of one length. Infinite where there is no motion.
    """
    places, layout = solution.excitation.windows, solution.mesh.layout
    here, windows, nodes = layout.nodes_of(places), places.size, layout.counts[places[0]]
    factors = solution.linearised.factors
    steps = np.asarray(step_matrices(steps_at(factors, here), factors.weight))
    by_node = np.moveaxis(steps.reshape(*steps.shape[:2], windows, nodes), (3, 2), (0, 1))
    phase = np.asarray(solution.mesh.phase)[here].reshape(windows, nodes)
    left = np.broadcast_to(np.eye(steps.shape[0]), by_node.shape[1:])
    for node in range(nodes):
        before = phase[:, node] < upto[places]
        left = np.where(before[:, None, None], by_node[node] @ left, left)
    moved = np.abs(np.asarray(solution.trajectory.x)[:, here])
    largest = moved.reshape(-1, windows, nodes).max(axis=2).T
    size = np.maximum(largest, np.finfo(float).tiny)
    share = np.linalg.norm(left * size[:, None, :] / size[:, :, None], axis=1).max(axis=1)
    solved = np.array([each.ok for each in solution.status()])[places]
    return np.where(solved & np.isfinite(share), share, np.inf)
