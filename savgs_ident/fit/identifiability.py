"""What the data can and cannot tell, in words.

Identified parameters live on logarithmic coordinates, so a direction that the data do not tell is a product of
powers: (+1, +1) on (mu_t, ydot_Hth) means that both may grow together while their ratio stays. The verdict
names such groups, says what is known instead, and how far down a parameter can go.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.result import Verdict

TOLD = 0.25
"""A free parameter is told if its standard error is below this share of its value."""

MEMBER = 0.3
"""A parameter belongs to an untold direction if its share of the unit direction is above this."""


def untold_groups(names: tuple[str, ...], covariance: NDArray[np.float64]) -> tuple[tuple[str, ...], ...]:
    """Groups of free parameters that trade off, from the covariance of their logarithms (n, n)."""
    variance, axes = np.linalg.eigh(covariance)
    groups: list[set[str]] = []
    for spread, axis in zip(np.sqrt(np.maximum(variance, 0.0)), axes.T, strict=True):
        if spread > TOLD:
            members = {name for name, share in zip(names, axis, strict=True) if abs(share) > MEMBER}
            touching = [group for group in groups if group & members]
            groups = [g for g in groups if g not in touching] + [members.union(*touching)]
    return tuple(tuple(name for name in names if name in group) for group in groups)


def known_combination(
    pair: tuple[str, str], names: tuple[str, ...], covariance: NDArray[np.float64]
) -> tuple[str, float]:
    """The better known of ratio and product of two parameters, and its relative standard error [1].

    ``covariance`` (n, n) is that of the logarithms.
    """
    i, j = (names.index(name) for name in pair)
    own = covariance[i, i] + covariance[j, j]
    ratio, product = (np.sqrt(max(own + sign * 2.0 * covariance[i, j], 0.0)) for sign in (-1.0, 1.0))
    return (f"{pair[0]}/{pair[1]}", ratio) if ratio <= product else (f"{pair[0]} x {pair[1]}", product)


def verdict_of(
    names: tuple[str, ...],
    values: Mapping[str, float],
    units: Mapping[str, str],
    covariance: NDArray[np.float64],
    bounds: Mapping[str, float],
    advice: tuple[str, ...],
) -> Verdict:
    """The verdict for free parameters ``names`` whose logarithms have ``covariance`` (n, n).

    ``bounds`` holds 95 % lower bounds of parameters that are not told [SI], ``advice`` which tests would help.
    """
    sd = np.sqrt(np.diag(covariance))
    groups = untold_groups(names, covariance)
    in_group = {name for group in groups for name in group}
    told = [n for n in names if n not in in_group and sd[names.index(n)] <= TOLD]
    sentences = []
    if told:
        figures = ", ".join(f"{name} to {100.0 * sd[names.index(name)]:.2g} %" for name in told)
        sentences.append(f"These data tell {figures}.")
    for group in groups:
        sentences += _about_group(group, names, values, units, covariance)
    untold = [n for n in names if n not in told and n not in in_group]
    sentences += [f"These data do not tell {name}." for name in untold]
    sentences += [
        f"{name} is at least {bound:.3g} {units[name]} (95 %, profile likelihood)."
        for name, bound in bounds.items()
    ]
    return Verdict(not groups and not untold, (*sentences, *advice), groups)


def _about_group(
    group: tuple[str, ...],
    names: tuple[str, ...],
    values: Mapping[str, float],
    units: Mapping[str, str],
    covariance: NDArray[np.float64],
) -> list[str]:
    if len(group) == 1:
        return [f"These data do not tell {group[0]}."]
    sentences = [f"{' and '.join(group)} cannot be told apart: they trade off along a line."]
    if len(group) == 2:
        pair = (group[0], group[1])
        label, error = known_combination(pair, names, covariance)
        if error <= TOLD:
            first, second = values[pair[0]], values[pair[1]]
            value = first / second if "/" in label else first * second
            unit = f"{units[pair[0]]}/({units[pair[1]]})" if "/" in label else "(SI)"
            sentences.append(f"What is known is {label} = {value:.4g} {unit}, to {100.0 * error:.2g} %.")
    return sentences
