"""A state space in a JSON document: matrices, and its signals with their units in order."""

import control
import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.export.linear_models import LinearModel
from savgs_ident.export.place import Place

LAW = "dx/dt = A x + B u, y = C x + D u"
"""What the matrices mean."""

_KINDS = ("states", "inputs", "outputs")


def space_record(linear: LinearModel) -> dict[str, object]:
    """A linear model as JSON says it."""
    space, units = linear.space, linear.units
    labels = dict(zip(_KINDS, (space.state_labels, space.input_labels, space.output_labels), strict=True))
    signals = {kind: {name: units[name] for name in labels[kind]} for kind in _KINDS}
    matrices = {name: np.asarray(getattr(space, name)).tolist() for name in "ABCD"}
    return {"about": linear.about, "law": LAW, **signals, **matrices}


def parse_space(place: Place, name: str) -> control.StateSpace:
    """The state space at a place, called ``name``; raises :class:`InputError` for what is none."""
    fields = place.table(("about", "law", *_KINDS, *"ABCD"))
    fields["law"].text((LAW,))
    labels = {kind: _signals(fields[kind]) for kind in _KINDS}
    n, m, k = (len(labels[kind]) for kind in _KINDS)
    shapes = {"A": (n, n), "B": (n, m), "C": (k, n), "D": (k, m)}
    matrices = [fields[matrix].matrix(*shape) for matrix, shape in shapes.items()]
    try:
        return control.ss(*matrices, **labels, name=name)
    except (ValueError, TypeError) as error:
        raise InputError(f"{place.where} is no state space: {error}") from error


def _signals(place: Place) -> list[str]:
    """Names of signals, whose units are texts."""
    found = place.entries()
    for unit in found.values():
        unit.text()
    if not found:
        raise place.wrong("a table of signals")
    return list(found)
