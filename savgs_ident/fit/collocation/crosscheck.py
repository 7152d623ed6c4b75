"""The identified parameters by direct collocation, from the samples of all dwells at once.

    found = fit_by_collocation(campaign, measured, rig, effects=MODELS["simtr"], free=FREE)
    found.by_name["mu_r"].value, found.by_name["mu_r"].stderr

It starts from the rig file's values and the periodic motions there. Parameters known to a tolerance are
estimated along under their priors, as in the fit.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from savgs_ident.core.rig import Rig
from savgs_ident.fit.collocation.objective import assemble_objective
from savgs_ident.fit.collocation.program import Program, assemble_program
from savgs_ident.fit.collocation.radau import Points, radau_points
from savgs_ident.fit.collocation.result import CollocationFit, assemble_result
from savgs_ident.fit.collocation.samples import Misfit, find_recordings, misfit_of, samples_of
from savgs_ident.fit.collocation.solve import solve_program
from savgs_ident.fit.collocation.start import start_vector
from savgs_ident.fit.collocation.unknowns import unknowns_of
from savgs_ident.fit.settings import FitSettings
from savgs_ident.fit.task import Task, plan_task
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic

Progress = Callable[[str], None]


@dataclass(frozen=True)
class CollocationSettings:
    """How to solve.

    Attributes:
        fixed_tolerances: take the parameters with a tolerance as exact instead of estimating them along.
        iterations: most iterations of IPOPT.
        tolerance: largest violation of a constraint, and largest slope left, in units of typical sizes.
        periodic: how the motions to start from are solved; there are as many points as it has nodes.
    """

    fixed_tolerances: bool = False
    iterations: int = 100
    tolerance: float = 1e-8
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)


def fit_by_collocation(
    campaign: Campaign,
    measured: HarmonicResponse,
    rig: Rig,
    *,
    effects: tuple[str, ...],
    free: tuple[str, ...],
    settings: CollocationSettings | None = None,
    progress: Progress | None = None,
) -> CollocationFit:
    """Estimate ``free`` parameters of a rig with ``effects`` from the samples of the dwells of ``measured``.

    The response gives frequencies, noise, and the harmonics of road and link; the samples of acceleration and
    deflection come from ``campaign``. ``progress`` is told what is going on. Raises :class:`InputError` for
    names that do not exist or that the model does not use, and for recordings that do not belong to the
    response. Look at ``status`` of the result.
    """
    began, tell = time.perf_counter(), progress or _silent
    settings = settings or CollocationSettings()
    planned = FitSettings(fixed_tolerances=settings.fixed_tolerances, periodic=settings.periodic)
    task = plan_task(measured, rig, effects, free, planned)
    tell("solving the model as given")
    near = simulate_periodic(task.problem.model, task.problem.fixed, task.excitation, settings.periodic)
    points = radau_points(near.mesh)
    tell("gathering the samples")
    misfits = _misfits(campaign, measured, points)
    tell("telling CasADi the equations")
    program = _program(task, points, misfits)
    tell(f"IPOPT: {program.unknowns.size} unknowns, {program.quadratic.samples} samples")
    start = start_vector(task, program, points, near)
    end = solve_program(program, start, settings.iterations, settings.tolerance)
    tell(f"IPOPT: {end.iterations} iterations, {end.status.advice}")
    return assemble_result(task, program, end, time.perf_counter() - began)


def _silent(line: str) -> None:
    del line


def _misfits(campaign: Campaign, measured: HarmonicResponse, points: Points) -> list[dict[int, Misfit]]:
    """For each dwell the misfit of each response channel that was recorded."""
    misfits = []
    for dwell, recording in enumerate(find_recordings(campaign, measured)):
        nodes = np.asarray(points.mesh.phase)[points.mesh.layout.dwell == dwell]
        sd = {
            name: float(measured.noise_sd[dwell, measured.channel(name)])
            for name in RESPONSE_CHANNELS
            if name in measured.channels and measured.noise_sd[dwell, measured.channel(name)] > 0.0
        }
        samples = samples_of(recording, float(measured.frequency[dwell]), sd)
        misfits.append({RESPONSE_CHANNELS.index(name): misfit_of(s, nodes) for name, s in samples.items()})
    return misfits


def _program(task: Task, points: Points, misfits: list[dict[int, Misfit]]) -> Program:
    free, layout = task.problem.free, points.mesh.layout
    unknowns = unknowns_of(task.problem.model, len(free.names), layout.total, len(layout.counts))
    priors = np.arange(len(free.identified), len(free.names))
    quadratic = assemble_objective(unknowns, points, misfits, priors)
    return assemble_program(task.problem, unknowns, points, task.excitation, quadratic)
