"""A small problem with its compiled step, for tests that minimise many times."""

from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.fit.minimise import Minimiser, Minimum
from savgs_ident.inference.problem import ProblemSettings, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests
from savgs_ident.simulate.periodic import resolve, simulate_periodic
from savgs_ident.simulate.readings import harmonics

TRUTH: Mapping[str, float] = {
    "mu_r": 0.03,
    "mu_t": 0.25,
    "ydot_Hth": 0.05,
    "c_sd": 0.93 * 5792.0,
    "k_sd": 0.985 * 157614.0,
    "k_t": 0.96 * 2.75e5,
}
"""What the nominal recordings were made with, where it is not (or not to be taken) from the rig sheet [SI]."""

FEW = (1.4, 2.0, 2.35, 3.0, 4.0, 5.0, 5.5, 6.0)
"""Dwells that identify all four parameters [Hz]."""


def only(response: HarmonicResponse, dwells: NDArray[np.bool_]) -> HarmonicResponse:
    """Some dwells of a response."""
    return only_tests(response, np.flatnonzero(dwells))


def true_rig(rig: Rig) -> Rig:
    """The drawing with the strut spring and the tyre as they truly are; the damping is as printed."""
    known = {name: TRUTH[name] for name in ("k_sd", "k_t")}
    return replace(rig, parameters=rig.parameters.with_values(known))


def silent(line: str) -> None:
    """Nobody wants to know."""
    del line


class Bench:
    """The paper's four parameters on a response, all others exact, and one compiled step for all tests."""

    def __init__(self, measured: HarmonicResponse, rig: Rig) -> None:
        settings = ProblemSettings(fixed_tolerances=True)
        self.task = plan_task(measured, RigModel(rig, MODELS["simtr"]), FREE, settings)
        problem = self.task.problem
        self.first = simulate_periodic(problem.model, problem.fixed, self.task.excitation)
        self.minimiser = Minimiser(problem)

    def u(self, values: Mapping[str, float]) -> Array:
        """Coordinates of the free parameters at ``values`` [SI]."""
        return self.task.problem.free.to_unconstrained(values)

    def predicted(self, values: Mapping[str, float]) -> NDArray[np.complex128]:
        """Harmonics of the model with some values in place of the rig's, on the nodes of the first solution."""
        problem = self.task.problem
        p = dict(problem.fixed) | {name: jnp.asarray(value) for name, value in values.items()}
        return np.asarray(harmonics(problem.model, p, resolve(problem.model, p, self.first), problem.orders))

    def noise(self, seed: int) -> NDArray[np.complex128]:
        """A draw of the measurement's own noise, 0 where nothing was measured."""
        target = self.task.problem.target
        used = np.asarray(target.used)
        drawn = np.random.default_rng(seed).standard_normal((*used.shape, 2))
        safe = np.where(used[..., None, None], np.asarray(target.whitening), np.eye(2))
        parts = np.linalg.solve(safe, drawn[..., None])[..., 0] * used[..., None]
        return parts[..., 0] + 1j * parts[..., 1]

    def seeing(self, measured: NDArray[np.complex128]) -> Minimiser:
        """The minimiser of the same problem for other harmonics."""
        return eqx.tree_at(lambda each: each.problem.target.measured, self.minimiser, jnp.asarray(measured))

    def fit(
        self,
        measured: NDArray[np.complex128],
        start: Mapping[str, float] | None = None,
        enough: float = 1e-6,
    ) -> Minimum:
        """Minimise for other harmonics, from the rig's own values or others."""
        u = self.u(dict(self.task.table.as_dict()) | dict(start or {}))
        return self.seeing(measured).minimise(u, self.first, 40, silent, enough=enough)
