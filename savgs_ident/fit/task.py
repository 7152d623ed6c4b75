"""A fit before it is done: what is fitted to what, and the problem that it makes."""

from typing import NamedTuple

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import FreeVector, known_to_tolerance
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.fit.problem import Problem, used_parameters
from savgs_ident.fit.settings import FitSettings
from savgs_ident.fit.target import harmonic_target, peak_to_peak_target
from savgs_ident.model.values import as_values
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.measured import measured_excitation


class Task(NamedTuple):
    """A rig with effects, all its parameters, a response and how to fit it; the problem that follows."""

    rig: Rig
    effects: tuple[str, ...]
    table: ParameterTable
    measured: HarmonicResponse
    settings: FitSettings
    excitation: Excitation
    problem: Problem


def plan_task(
    measured: HarmonicResponse,
    rig: Rig,
    effects: tuple[str, ...],
    free: tuple[str, ...],
    settings: FitSettings,
) -> Task:
    """The task of fitting ``free``.

    Raises :class:`InputError` for names that do not exist or that the model does not use, and for a response
    that cannot be used.
    """
    table = model_parameters(rig, effects)
    model = build_model(rig, effects)
    used = used_parameters(model, table)
    _check_free(free, table, used)
    tolerated = tuple(name for name in known_to_tolerance(table, free) if name in used)
    free_vector = FreeVector(table, free, () if settings.fixed_tolerances else tolerated)
    by_harmonics = settings.quantity == "harmonics"
    target = harmonic_target(measured, settings.orders) if by_harmonics else peak_to_peak_target(measured)
    orders, iterations = target.used.shape[-1] - 1, settings.periodic.iterations
    problem = Problem(model, free_vector, as_values(table.as_dict()), target, orders, iterations)
    excitation = measured_excitation(measured, rig.parameters["psi_nominal"].value)
    return Task(rig, effects, table, measured, settings, excitation, problem)


def _check_free(free: tuple[str, ...], table: ParameterTable, used: frozenset[str]) -> None:
    remedy = "choose among: " + ", ".join(sorted(used))
    for name in free:
        if name not in table:
            raise InputError(f"there is no parameter '{name}'", remedy=remedy)
        if name not in used:
            raise InputError(f"the model does not depend on '{name}'", remedy=remedy)
