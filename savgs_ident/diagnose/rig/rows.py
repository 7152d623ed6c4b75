"""Motions of the rig as rows, and the slopes of the rows: compiled once for a model."""

from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array

from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import directional
from savgs_ident.simulate.stored import stored


@eqx.filter_jit
def rows_of(
    model: QuarterCar, likelihood: Likelihood, p: Values, solution: PeriodicSolution, orders: int
) -> Array:
    """Rows of a motion [unit of the reading], (m,)."""
    return likelihood.rows(harmonics(model, p, solution, orders))


@eqx.filter_jit
def slopes_of(*args: Any) -> tuple[Array, ...]:
    """Their slopes along directions (k, n) of named parameters, (k, m) [unit of the reading]."""
    return stored(_directional_rows, *args)


def _directional_rows(
    model: QuarterCar,
    likelihood: Likelihood,
    p: Values,
    solution: PeriodicSolution,
    directions: Array,
    names: tuple[str, ...],
    orders: int,
) -> tuple[Array]:
    along = directional(model, p, solution, names, orders)
    return (jax.lax.map(lambda direction: likelihood.rows(along(direction)), directions),)
