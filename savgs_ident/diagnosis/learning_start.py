"""Where the search for a learned law begins: what lies where in it, and how large its coefficients may be.

Both are told by what explains most to first order about the recalibrated baseline.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.localisation import evidence_of_law, widths_of
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.effects.base import Port
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import alone_at, placed_at
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Linear


def best_places(
    problem: AbstractProblem,
    search: Search,
    base: LaplaceFit,
    port: Port,
    near: Any,
    constants: DecisionConstants,
) -> dict[str, float]:
    """Where contacts begin and a friction has fallen, by name, if these alone explain most, to first order.

    A search among all functions hardly moves them: the others take up what one elsewhere leaves. The plant is solved
    from ``near``, where the law does nothing yet.
    """
    return {
        name: max(
            constants.learned_places,
            key=lambda place: _evidence_at(
                problem, search, base, port, near, {name: place}, functions, constants
            ),
        )
        for name, functions in placed_at(port).items()
    }


def _evidence_at(
    problem: AbstractProblem,
    search: Search,
    base: LaplaceFit,
    port: Port,
    near: Any,
    place: Mapping[str, float],
    functions: Sequence[str],
    constants: DecisionConstants,
) -> float:
    """Log evidence to first order of some functions at a place alone; minus infinity where they do nothing."""
    there = problem.predict((f"learned_{port.name}",), {**base.values, **place}, functions, near)
    if not there.solved or not np.any(there.slopes):
        return -np.inf
    return evidence_of_law(search, base, there.slopes, constants)


def with_amplitudes(
    term: Term,
    effect: Effect,
    search: Search,
    base: LaplaceFit,
    columns: Mapping[str, NDArray[np.float64]],
    constants: DecisionConstants,
) -> Term:
    """The term with coefficients whose prior is as wide as to first order about the baseline explains most.

    ``columns`` are the change of the rows (m,) per unit of each, by name; what the data hardly see is left out.
    """
    size = {name: float(np.linalg.norm(column)) for name, column in columns.items()}
    least = constants.least_function_share * max(size.values())
    seen = [name for name in columns if size[name] > least]
    widths = widths_of(search, base, np.stack([columns[name] for name in seen], axis=1), constants)
    units = {each.name: each.unit for each in effect.parameters}
    amplitudes = tuple(
        Linear(name, units[name], 0.0, float(width)) for name, width in zip(seen, widths, strict=True)
    )
    return replace(term, amplitudes=amplitudes)


def widths_alone(
    term: Term,
    port: Port,
    search: Search,
    base: LaplaceFit,
    columns: Mapping[str, NDArray[np.float64]],
    constants: DecisionConstants,
) -> dict[tuple[str, ...], float]:
    """By the functions that could be all of a law, the width of their prior then, over that beside all others.

    To first order about the baseline, too: one alone that calibration nearly takes up is far larger than all together
    seem to be. ``term`` has the others; ``columns`` are as for :func:`with_amplitudes`.
    """
    scale = {each.name: each.scale for each in term.amplitudes}
    groups = (tuple(name for name in each if name in scale) for each in alone_at(port))

    def width(group: tuple[str, ...]) -> float:
        mine = np.stack([columns[name] for name in group], axis=1)
        # Rounded, so that the same width is known as such.
        return round(float(widths_of(search, base, mine, constants)[0]) / scale[group[0]], 6)

    return {group: width(group) for group in groups if group}
