"""Rigs that the recordings allow: parameter sets for a controller to be tried on, not only the best one.

They come from the samples of a posterior, or else from the covariance that an identified rig carries, or else, for a
drawing, from its tolerances.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.posterior.draws import FAR, REMEDY, far_from_draws, read_draws, thin_draws

SEED = 20170701
"""Of the draws: the same rigs every time."""

ROUNDING = 1e-6
"""By how much the correlations of a covariance may be lopsided or indefinite [1]."""


@dataclass(frozen=True)
class Rigs:
    """``source`` says in words where they come from; ``values`` are whole parameter sets by name, SI."""

    source: str
    values: tuple[Mapping[str, float], ...]


def rigs_from_posterior(table: ParameterTable, path: Path, count: int) -> Rigs:
    """``count`` rigs evenly spread over the draws of a ``posterior.nc``.

    Raises :class:`InputError` if the file cannot be read, holds no draws of the rig's parameters, or those of another
    rig.
    """
    every = read_draws(path, tuple(table))
    far = far_from_draws(table.as_dict(), every)
    if far:
        raise InputError(
            f"is the posterior of another rig: {far[0]} of this one is more than {FAR:g} standard deviations off it",
            source=path,
            remedy=REMEDY,
        )
    draws = thin_draws(every, count)
    matrix = np.stack(list(draws.values()), axis=1)
    return _rigs(table, f"{len(matrix)} samples of {path}", tuple(draws), matrix)


def rigs_from_covariance(
    table: ParameterTable, provenance: Mapping[str, object], count: int, source: object = ""
) -> Rigs:
    """``count`` rigs from the normal distribution that an identified rig carries; from tolerances for a drawing.

    Raises :class:`InputError`, which names the rig's file ``source``, if what it carries is no covariance of its
    parameters.
    """
    carried = provenance.get("covariance")
    if carried is None:
        known = [entry for entry in table.entries if entry.tolerance > 0.0]
        names = tuple(entry.name for entry in known)
        covariance = np.diag([entry.tolerance**2 for entry in known])
        told = f"{count} rigs within the tolerances of the drawing"
    else:
        names, covariance = _covariance(carried, table, source)
        told = f"{count} rigs from the covariance of the fit"
    centre = np.array(table.values_of(names))
    lower = np.array([table[name].lower for name in names])
    upper = np.array([table[name].upper for name in names])
    # In units of their own deviations: parameters of 1e7 N/m beside such of 1e-4 m leave no digits for a check.
    spread = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(spread, spread)
    zero = np.zeros(len(names))
    random = np.random.default_rng(SEED)
    drawn = centre + spread * random.multivariate_normal(zero, correlation, count, method="eigh")
    return _rigs(table, told, names, np.clip(drawn, lower, upper))


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
    lopsided = np.max(np.abs(correlation - correlation.T))
    if lopsided > ROUNDING or np.min(np.linalg.eigvalsh(correlation)) < -ROUNDING:
        raise wrong
    return tuple(names), covariance


def _rigs(table: ParameterTable, source: str, names: tuple[str, ...], matrix: NDArray[np.float64]) -> Rigs:
    base = table.as_dict()
    return Rigs(source, tuple(base | dict(zip(names, map(float, row), strict=True)) for row in matrix))
