"""Physical parameters: values in SI, with unit, bounds, tolerance and source as metadata.

>>> m_s = Parameter("m_s", 320.0, "kg", tolerance=1.6, lower=0.0)
>>> table = ParameterTable((m_s,))
>>> table.as_dict()
{'m_s': 320.0}
>>> table.with_values({"m_s": 318.0})["m_s"].value
318.0
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite

from savgs_ident.core.errors import InputError

TYPICAL = "typical"
"""Source of a number that stands for an order of magnitude alone: no sheet has it."""

SIZED = "typical of the recorded force"
"""Source of such a number once it was set beside what was recorded."""


@dataclass(frozen=True)
class Parameter:
    """One physical parameter in SI.

    ``tolerance`` is the standard deviation with which the value is known beforehand [``unit``]; 0 means
    exact or, for a parameter that is to be identified, that only its bounds are known beforehand.
    ``source`` is where the number comes from, :data:`TYPICAL` if from nowhere, ``about`` what it describes.
    """

    name: str
    value: float
    unit: str
    tolerance: float = 0.0
    lower: float = -inf
    upper: float = inf
    about: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if not isfinite(self.value):
            raise InputError(f"parameter '{self.name}' is {self.value}", remedy="give a finite number")
        if not self.lower <= self.value <= self.upper:
            raise InputError(
                f"parameter '{self.name}' = {self.value} {self.unit} lies outside its bounds"
                f" [{self.lower}, {self.upper}]",
                remedy="mend the value or the bounds in the rig file",
            )
        if not (isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise InputError(
                f"parameter '{self.name}' has tolerance {self.tolerance}",
                remedy="give one standard deviation, zero or positive",
            )

    @property
    def is_typical(self) -> bool:
        """Whether it is a positive number of which no more than the order of magnitude is known."""
        return self.source in (TYPICAL, SIZED) and self.value > max(self.lower, 0.0)

    @property
    def has_prior(self) -> bool:
        """Whether it is known before the data, but not exactly: to a tolerance, or to an order of magnitude."""
        return self.tolerance > 0.0 or self.is_typical


@dataclass(frozen=True)
class ParameterTable(Mapping[str, Parameter]):
    """An ordered, immutable set of parameters, found by name."""

    entries: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        names = [entry.name for entry in self.entries]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"parameter '{twice[0]}' is given twice", remedy="keep one of the two")

    def __getitem__(self, name: str) -> Parameter:
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return (entry.name for entry in self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def values_of(self, names: tuple[str, ...]) -> tuple[float, ...]:
        """The values of ``names``, in that order, in SI."""
        return tuple(self[name].value for name in names)

    def as_dict(self) -> dict[str, float]:
        """Name to value, in SI: the argument of a model."""
        return {entry.name: entry.value for entry in self.entries}

    def with_values(self, values: Mapping[str, float]) -> "ParameterTable":
        """The same table with some values replaced, in SI.

        Raises :class:`InputError` for a name that is not in the table or a value outside its bounds.
        """
        unknown = sorted(set(values) - set(self))
        if unknown:
            raise InputError(
                f"there is no parameter '{unknown[0]}'", remedy="choose among: " + ", ".join(sorted(self))
            )
        return ParameterTable(
            tuple(
                replace(entry, value=float(values[entry.name])) if entry.name in values else entry
                for entry in self.entries
            )
        )

    def __add__(self, other: "ParameterTable") -> "ParameterTable":
        return ParameterTable(self.entries + other.entries)


def merge_parameters(first: ParameterTable, *others: ParameterTable) -> ParameterTable:
    """``first`` and whatever ``others`` (the parameters of effects) add to it; the earlier entry always wins.

    Raises :class:`InputError` if a name means another unit in two tables.
    """
    merged = {entry.name: entry for entry in first.entries}
    for entry in (entry for table in others for entry in table.entries):
        known = merged.setdefault(entry.name, entry)
        if known.unit != entry.unit:
            raise InputError(
                f"parameter '{entry.name}' is given in '{known.unit}' and in '{entry.unit}'",
                remedy="give one of the two another name",
            )
    return ParameterTable(tuple(merged.values()))
