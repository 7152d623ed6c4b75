"""Which families a learned law is of, to first order about its fit.

The functions of all families but one are taken away from the fit of all functions of a port
(:mod:`savgs_ident.diagnosis.learning`), and one by one those of the family that are not needed; and the functions of
each family are taken away from all, which says how well it can be spared.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from math import log
from typing import NamedTuple

import numpy as np

from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.effects.base import Family, Port
from savgs_ident.effects.learned_functions import (
    coefficients_at,
    coefficients_of,
    functions_at,
    interactions_at,
)
from savgs_ident.inference.find_map import LaplaceFit, Search
from savgs_ident.inference.laplace import linearised_optimum, log_evidence
from savgs_ident.inference.prior import Linear, bounds_of


class FamilyAlone(NamedTuple):
    """Functions of one family without those of the others, and without those that are not needed.

    Attributes:
        functions: names of their coefficients.
        width: of their prior, over that of all functions.
        weight: log evidence, with the log prior probability that these functions of the family are needed.
        log_prior: that.
        start: the best point [SI], by name.
    """

    functions: tuple[str, ...]
    width: float
    weight: float
    log_prior: float
    start: Mapping[str, float]


def families_alone(
    search: Search, mode: LaplaceFit, port: Port, constants: DecisionConstants
) -> dict[Family, FamilyAlone]:
    """Each family's functions without those of the others, to first order about the fit."""
    seen = {each.name for each in mode.coordinates}
    found = {}
    for family in dict.fromkeys(each.family for each in functions_at(port)):
        mine = tuple(name for name in coefficients_of(port, family) if name in seen)
        if mine:
            found[family] = _needed(search, mode, port, mine, mine, constants)
    return found


def still_needed(
    search: Search,
    mode: LaplaceFit,
    port: Port,
    family: tuple[str, ...],
    constants: DecisionConstants,
) -> FamilyAlone:
    """Those of its functions that a fit of a ``family`` alone needs, to first order about that fit."""
    fitted = {each.name for each in mode.coordinates}
    return _needed(search, mode, port, family, tuple(name for name in family if name in fitted), constants)


def families_spared(search: Search, mode: LaplaceFit, port: Port) -> dict[Family, float]:
    """Minus the log evidence of the law without the functions of each family."""
    gone = {each.family: coefficients_of(port, each.family) for each in functions_at(port)}
    return {family: -_alone(search, mode, names, (), 1.0, 0.0).weight for family, names in gone.items()}


def log_prior_of(
    functions: Collection[str], family: tuple[str, ...], port: Port, constants: DecisionConstants
) -> float:
    """Log prior probability that of a ``family`` at a port these ``functions`` are needed and no others."""
    interactions = interactions_at(port)
    priors = {
        name: constants.interaction_prior if name in interactions else constants.function_prior
        for name in family
    }
    return sum(log(each if name in functions else 1.0 - each) for name, each in priors.items())


def _needed(
    search: Search,
    mode: LaplaceFit,
    port: Port,
    family: tuple[str, ...],
    first: tuple[str, ...],
    constants: DecisionConstants,
) -> FamilyAlone:
    """Those of a family's functions, among the ``first``, without which the law is less probable; one at least."""
    of_all = set(coefficients_at(port))

    def alone(functions: tuple[str, ...], width: float) -> FamilyAlone:
        log_prior = log_prior_of(functions, family, port, constants)
        return _alone(search, mode, of_all.difference(functions), functions, width, log_prior)

    def at_its_width(functions: tuple[str, ...]) -> FamilyAlone:
        tried = (alone(functions, width) for width in constants.family_widths)
        return max(tried, key=lambda each: each.weight)

    # Of functions that do nearly the same, one alone is needed: the best may lie beyond worse ones.
    found = [at_its_width(first)]
    while len(found[-1].functions) > 1:
        left = found[-1].functions
        fewer = [alone(tuple(each for each in left if each != gone), found[-1].width) for gone in left]
        found.append(max(fewer, key=lambda each: each.weight))
    return at_its_width(max(found, key=lambda each: each.weight).functions)


def _alone(
    search: Search,
    mode: LaplaceFit,
    gone: Collection[str],
    functions: tuple[str, ...],
    width: float,
    log_prior: float,
) -> FamilyAlone:
    """The fit with the coordinates that are ``gone`` at zero, to first order.

    The coefficients of the ``functions`` have a prior that is ``width`` times as wide as in the fit.
    """
    kept = np.array([each.name not in gone for each in mode.coordinates])
    missed, slopes = search.missed(mode.prediction), search.turned(mode.slopes)
    coordinates = tuple(
        replace(each, scale=width * each.scale)
        if each.name in functions and isinstance(each, Linear)
        else each
        for each, keep in zip(mode.coordinates, kept, strict=True)
        if keep
    )
    wider = np.array([width if each.name in functions else 1.0 for each in coordinates])
    without = missed + slopes[:, ~kept] @ mode.x[~kept]
    here = mode.x[kept] / wider
    top = linearised_optimum(search.rows, without, slopes[:, kept] * wider, here, bounds_of(coordinates))
    start = {each.name: each.value(float(x)) for each, x in zip(coordinates, top.x, strict=True)}
    evidence = log_evidence(top.value, top.precision, coordinates)
    return FamilyAlone(functions, width, evidence + log_prior, log_prior, start)
