"""Sets of rigs that are compatible with the recordings: parameter sets on which a controller is tried.

They are drawn from the samples of a posterior, or from the covariance of an identified rig, or, for a drawing,
from its tolerances.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.inference.draws import (
    FAR,
    REMEDY,
    DrawSource,
    far_from_draws,
    read_draws,
    source_name,
    thin_draws,
)

SEED = 20170701
"""Seed of the draws: the same rigs every time."""
ROUNDING = 1e-6
"""Tolerance for asymmetry and negative eigenvalues of a correlation matrix [1]."""


@dataclass(frozen=True)
class Rigs:
    """Parameter sets of rigs: ``source`` describes their origin; ``values`` are whole sets by name, SI."""

    source: str
    values: tuple[Mapping[str, float], ...]


def rigs_from_posterior(table: ParameterTable, path: DrawSource, count: int) -> Rigs:
    """``count`` rigs evenly spread over the draws of a posterior.

    Raises :class:`InputError` if the file cannot be read, holds no draws of the rig's parameters, or those of another
    rig.
    """
    every = read_draws(path, tuple(table))
    far = far_from_draws(table.as_dict(), every)
    if far:
        raise InputError(
            f"is the posterior of another rig: {far[0]} of this one is more than {FAR:g} standard deviations off it",
            source=source_name(path),
            remedy=REMEDY,
        )
    draws = thin_draws(every, count)
    matrix = np.stack(list(draws.values()), axis=1)
    return _rigs(table, f"{len(matrix)} samples of {source_name(path)}", tuple(draws), matrix)


def rigs_from_covariance(
    table: ParameterTable, provenance: Mapping[str, object], count: int, source: object = ""
) -> Rigs:
    """``count`` rigs from the covariance of an identified rig; from the tolerances of a drawing.

    Raises :class:`InputError`, which names the rig's file ``source``, if its covariance is invalid.
    """
    carried = provenance.get("covariance")
    if carried is None:
        known = [entry for entry in table.entries if entry.tolerance > 0.0]
        names = tuple(entry.name for entry in known)
        covariance = np.diag([entry.tolerance**2 for entry in known])
        origin = f"{count} rigs within the tolerances of the drawing"
    else:
        names, covariance = _covariance(carried, table, source)
        origin = f"{count} rigs from the covariance of the fit"
    centre = np.array(table.values_of(names))
    lower = np.array([table[name].lower for name in names])
    upper = np.array([table[name].upper for name in names])
    # In units of their standard deviations: 1e7 N/m beside 1e-4 m would leave no digits for a check.
    spread = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(spread, spread)
    zero = np.zeros(len(names))
    random = np.random.default_rng(SEED)
    drawn = centre + spread * random.multivariate_normal(zero, correlation, count, method="eigh")
    return _rigs(table, origin, names, np.clip(drawn, lower, upper))


def _covariance(
    carried: object, table: ParameterTable, source: object
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    wrong = InputError(
        "provenance.covariance is no covariance of the rig's parameters",
        source=source,
        remedy="identify the rig again",
    )
    if not isinstance(carried, Mapping):
        raise wrong
    names, matrix = carried.get("names"), carried.get("matrix")
    try:
        covariance = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        raise wrong from None
    if not isinstance(names, list | tuple) or not all(
        isinstance(name, str) and name in table for name in names
    ):
        raise wrong
    if covariance.shape != (len(names), len(names)) or not np.isfinite(covariance).all():
        raise wrong
    if not (np.diag(covariance) > 0.0).all():
        raise wrong
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size)
    asymmetry = np.max(np.abs(correlation - correlation.T))
    if asymmetry > ROUNDING or np.min(np.linalg.eigvalsh(correlation)) < -ROUNDING:
        raise wrong
    return tuple(names), covariance


def _rigs(table: ParameterTable, source: str, names: tuple[str, ...], matrix: NDArray[np.float64]) -> Rigs:
    base = table.as_dict()
    return Rigs(source, tuple(base | dict(zip(names, map(float, row), strict=True)) for row in matrix))
