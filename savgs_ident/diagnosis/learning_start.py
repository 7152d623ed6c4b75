"""Where the search for a learned law begins: where its contacts do, and how large its coefficients may be.

Both are told by what explains most to first order about the recalibrated baseline.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.localisation import evidence_of_law, widths_of
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.effects.base import Port
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import contacts_at, gap_at
from savgs_ident.inference.find_map import LaplaceFit, Search
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Linear


def best_gap(
    problem: AbstractProblem, search: Search, base: LaplaceFit, port: Port, constants: DecisionConstants
) -> dict[str, float]:
    """Where contacts alone explain most if they begin there, to first order about the baseline, by name.

    A search among all functions hardly moves it: the others take up what a contact elsewhere leaves.
    """
    name, contacts = gap_at(port), contacts_at(port)
    if name is None:
        return {}
    tried: dict[float, float] = {}
    for gap in constants.learned_gaps:
        values = {**base.values, name: gap}
        there = problem.predict((f"learned_{port.name}",), values, contacts, base.prediction.warm_start)
        if there.solved and np.any(there.slopes):
            tried[gap] = evidence_of_law(search, base, there.slopes, constants)
    return {name: max(tried, key=lambda each: tried[each])} if tried else {}


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
