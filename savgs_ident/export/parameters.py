"""A parameter as values of JSON; an absent bound is null.

>>> found = parameter_record(Parameter("k", 6e4, "N/m", lower=0.0))
>>> found["lower"], found["upper"]
(0.0, None)
"""

from dataclasses import asdict
from math import inf, isfinite

from savgs_ident.core.parameter import Parameter
from savgs_ident.export.document import JsonValue

NUMBERS = ("value", "tolerance", "lower", "upper")
"""The entries that are numbers."""
TEXTS = ("unit", "about", "source")
"""Those that are texts."""
BOUNDS = ("lower", "upper")
"""Those that may be null."""


def parameter_record(entry: Parameter) -> dict[str, object]:
    """What is known of a parameter, but for its name."""
    bounds = {name: value if isfinite(value := getattr(entry, name)) else None for name in BOUNDS}
    return {name: value for name, value in asdict(entry).items() if name != "name"} | bounds


def parse_parameter(place: JsonValue, known: Parameter) -> Parameter:
    """The parameter at a place, by name and unit the ``known`` one; raises :class:`InputError` for an invalid one."""
    fields = place.table((*NUMBERS, *TEXTS))
    lower, upper = (
        without if fields[name].value is None else fields[name].number()
        for name, without in zip(BOUNDS, (-inf, inf), strict=True)
    )
    return Parameter(
        known.name,
        fields["value"].number(),
        fields["unit"].text((known.unit,)),
        fields["tolerance"].number(),
        lower,
        upper,
        fields["about"].text(),
        fields["source"].text(),
    )
