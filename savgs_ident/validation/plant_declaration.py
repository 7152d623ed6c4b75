"""What a plant declares, held against itself: names, units, sizes, what its ports refer to.

No equation is evaluated here; that is :mod:`savgs_ident.validation.check_plant`, which asks this first.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from savgs_ident.effects.base import Port, PortKind
from savgs_ident.plants.model import PlantModel
from savgs_ident.recordings.units import factor_between, find_unit

Severity = Literal["fault", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """What a check found.

    Attributes:
        severity: "fault": results would be wrong; "warning": something is out of reach; "note": good to know.
        what: a sentence without its point.
        remedy: what to do; empty for a note.
    """

    severity: Severity
    what: str
    remedy: str = ""


def check_declaration(model: PlantModel) -> Iterator[Finding]:
    """What does not go together in what the plant of ``model`` declares."""
    yield from _names(model)
    yield from _sizes(model)
    yield from _units(model)
    yield from _inputs(model)
    for port in model.plant.ports:
        yield from _port(model, port)
    yield from _sensors(model)
    if not any(each.tolerance > 0.0 for each in model.table.entries) and not _identifiable(model):
        yield Finding(
            "warning",
            "no parameter is left to identify: none has a tolerance, none two finite bounds",
            "give parameters that are to be identified a lower and an upper bound",
        )


def _identifiable(model: PlantModel) -> bool:
    return any(
        isfinite(each.lower) and isfinite(each.upper) and each.lower < each.value < each.upper
        for each in model.table.entries
    )


def _names(model: PlantModel) -> Iterator[Finding]:
    plant = model.plant
    n, fields = len(plant.coordinates), getattr(plant.coordinate_type, "_fields", ())
    if len(fields) != n:
        yield Finding(
            "fault",
            f"coordinate_type has {len(fields)} fields, there are {n} coordinates",
            "make it a NamedTuple with one field for each coordinate, in their order",
        )
    for kind, names in (
        ("coordinates", [each.name for each in plant.coordinates]),
        ("recorded channels", list(model.layout.names)),
        ("ports", [each.name for each in plant.ports]),
    ):
        for name in _twice(names):
            yield Finding("fault", f"two {kind} are called '{name}'", "give one of them another name")
    for kind, count in (("input", len(plant.inputs)), ("channel", len(plant.channels))):
        if not count:
            yield Finding("fault", f"the plant has no {kind}", f"declare at least one {kind}")


def _twice(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]


def _sizes(model: PlantModel) -> Iterator[Finding]:
    for each in model.plant.coordinates:
        for name in ("size", "rate_size", "acceleration_size"):
            if not _positive(getattr(each, name)):
                yield Finding(
                    "fault",
                    f"coordinate '{each.name}': {name} is {getattr(each, name)}",
                    "give a typical one, above zero: solvers take their tolerances from it",
                )
    for port in model.plant.ports:
        sizes = {
            PortKind.FORCE: ("displacement", "velocity", "force"),
            PortKind.SERIES: ("displacement", "force"),
        }
        for name in sizes.get(port.kind, ("displacement",)):
            if port.kind is not PortKind.NUMBER and not _positive(getattr(port, name)):
                yield Finding(
                    "fault",
                    f"port '{port.name}': {name} is {getattr(port, name)}",
                    "give a typical one, above zero: laws there take their sizes from it",
                )


def _positive(size: float) -> bool:
    return isfinite(size) and size > 0.0


def _units(model: PlantModel) -> Iterator[Finding]:
    for each in model.layout.channels:
        unit = find_unit(each.unit)
        if unit is None and each.unit != "1" and factor_between(each.unit, each.unit) is None:
            yield Finding(
                "warning",
                f"channel '{each.name}': '{each.unit}' is no unit that readers convert",
                "recordings have to be in this very unit",
            )
        elif unit is not None and unit.factor != 1.0:
            yield Finding(
                "fault",
                f"channel '{each.name}' is declared in '{each.unit}', which is not SI",
                "declare it in SI; recordings may be in any unit",
            )


def _inputs(model: PlantModel) -> Iterator[Finding]:
    plant, table = model.plant, model.table
    for each in plant.inputs:
        if len(each.moves) != len(plant.coordinates):
            yield Finding(
                "fault",
                f"input '{each.name}': moves has {len(each.moves)} numbers for {len(plant.coordinates)} coordinates",
                "say by how much each coordinate typically moves per unit of the input",
            )
        for role in ("rest", "stroke"):
            name = getattr(each, role)
            if name and name not in table:
                yield _unknown(f"input '{each.name}': {role}", name)
            elif name and table[name].unit != each.unit:
                yield _other_unit(f"input '{each.name}': {role}", name, table[name].unit, each.unit)
    if plant.inputs and not any(plant.inputs[0].moves) and not plant.inputs[0].stroke:
        yield Finding(
            "fault",
            f"input '{plant.inputs[0].name}' moves nothing",
            "give in moves by how much each coordinate typically moves per unit of it",
        )


def _unknown(where: str, name: str) -> Finding:
    return Finding(
        "fault", f"{where} is '{name}', which is no parameter", "name one of the plant's parameters"
    )


def _other_unit(where: str, name: str, unit: str, expected: str) -> Finding:
    return Finding(
        "fault", f"{where} is '{name}' in '{unit}', not in '{expected}'", "give the parameter in that unit"
    )


def _port(model: PlantModel, port: Port) -> Iterator[Finding]:
    table = model.table
    if port.contact is not None:
        stiffness = _over(port.force_unit, port.displacement_unit)
        damping = _over(f"{port.force_unit} s", port.displacement_unit)
        for name, units in zip(port.contact, (stiffness, damping), strict=True):
            if name not in table:
                yield _unknown(f"port '{port.name}': contact", name)
            elif table[name].unit not in units:
                yield _other_unit(f"port '{port.name}': contact", name, table[name].unit, units[0])
        yield from _soft(model, port)
        yield from _exact(model, port)
    for number in port.numbers:
        if number.name not in table:
            yield _unknown(f"port '{port.name}': number", number.name)
        elif table[number.name].unit != number.unit:
            yield _other_unit(
                f"port '{port.name}': number", number.name, table[number.name].unit, number.unit
            )
        if not _positive(number.change):
            yield Finding(
                "fault",
                f"port '{port.name}': the change of '{number.name}' is {number.change}",
                "give a typical change, above zero",
            )
    if port.kind is PortKind.NUMBER and not port.numbers:
        yield Finding("fault", f"port '{port.name}' has no numbers", "name the parameters that may be others")
    if abs(port.sense) != 1.0:
        yield Finding("fault", f"port '{port.name}': sense is {port.sense}", "give 1 or -1")
    force_ports = {each.name for each in model.plant.ports if each.kind is PortKind.FORCE}
    for inertia in port.inertias:
        for name in (inertia.force, *inertia.velocity):
            if name not in force_ports:
                yield Finding(
                    "fault",
                    f"port '{port.name}': an inertia refers to '{name}', which is no force port",
                    "name force ports of the plant",
                )


HOLDS = 0.1
"""Share of a typical displacement or velocity within which a contact should hold a typical friction [1]."""


def _soft(model: PlantModel, port: Port) -> Iterator[Finding]:
    """A contact that gives, or creeps, through much of the motion before it holds a typical friction."""
    table = model.table
    sizes = (port.displacement, port.displacement_unit), (port.velocity, f"{port.displacement_unit}/s")
    for name, (size, unit), acts in zip(port.contact or (), sizes, ("spring", "damper"), strict=True):
        if name in table and table[name].value > 0.0 and _positive(size) and _positive(port.force):
            reached = port.force / table[name].value
            if reached > HOLDS * size:
                given = f"'{name}' of {table[name].value:g} {table[name].unit}"
                yield Finding(
                    "note",
                    f"port '{port.name}': with {given} its contact holds a friction of {port.force:g} "
                    f"{port.force_unit} from {reached:.2g} {unit} on, {reached / size:.0%} of the typical motion, "
                    f"and acts like a {acts} before; a greater one sticks",
                )


def _exact(model: PlantModel, port: Port) -> Iterator[Finding]:
    """Numbers of a contact that nobody measured, and that nothing estimates."""
    exact = [
        f"'{name}'" for name in port.contact or () if name in model.table and not model.table[name].has_prior
    ]
    if exact:
        yield Finding(
            "note",
            f"port '{port.name}': {' and '.join(exact)} of its contact {'is' if len(exact) == 1 else 'are'} taken as "
            "exact; a contact that is too soft, or too hard, takes masses, stiffnesses and forces along",
            "write source='typical' unless it was measured: it is estimated then, from its order of magnitude",
        )


def _over(force: str, displacement: str) -> tuple[str, ...]:
    """How a stiffness or damping may be written."""
    return (f"{force}/{displacement}", f"{force}/({displacement})")


def _sensors(model: PlantModel) -> Iterator[Finding]:
    known = {f"sensor.{each.name}": each for each in model.plant.channels}
    covered = set()
    for port in model.plant.ports:
        if port.kind is not PortKind.SENSOR:
            continue
        channel = known.get(port.location)
        if channel is None:
            yield Finding(
                "fault",
                f"port '{port.name}' is at '{port.location}', which is no channel's sensor",
                "write location = " + " or ".join(f"'{each}'" for each in known),
            )
        elif channel.unit != port.displacement_unit:
            yield Finding(
                "fault",
                f"port '{port.name}' is in '{port.displacement_unit}', its channel in '{channel.unit}'",
                f"write displacement_unit='{channel.unit}', and a typical size in it",
            )
        covered.add(port.location)
    for location, channel in known.items():
        if location not in covered:
            yield Finding(
                "warning",
                f"channel '{channel.name}' has no sensor port: a fault of its sensor cannot be found",
                f"declare Port(..., PortKind.SENSOR, '{location}', displacement_unit='{channel.unit}')",
            )
