"""FMU: model exchange after FMI 3.0, compiled here, for any simulator that implements the standard.

CasADi's DaeBuilder writes the C code from the same functions as the other exports. Every parameter is tunable, every
variable has its unit and description; a simulation starts at rest. The headers of the standard come with FMPy, which
is installed by the extra ``fmu``. FMI defines units by exponents of the SI's base units:

>>> base_units("N s/m")
{'kg': 1, 's': -1}
"""

import contextlib
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

import casadi as ca

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.export.exported_model import ExportedModel, casadi_functions, resting_inputs, resting_state
from savgs_ident.export.json_export import write_json

BASE = ("kg", "m", "s", "A", "rad")
"""Base units of FMI that plants use."""

_DERIVED: Mapping[str, Mapping[str, int]] = MappingProxyType(
    {
        "N": {"kg": 1, "m": 1, "s": -2},
        "Pa": {"kg": 1, "m": -1, "s": -2},
        "J": {"kg": 1, "m": 2, "s": -2},
        "W": {"kg": 1, "m": 2, "s": -3},
        "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
        "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
        "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
        "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
        "Hz": {"s": -1},
    }
)

_PART = re.compile(r"([A-Za-z]+)(?:\^(\d+))?")


def base_units(unit: str) -> dict[str, int]:
    """Exponents of the base units in a unit; empty for "1". Raises :class:`InputError` for one that FMI lacks."""
    total: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below, -1)):
        for symbol, power in _PART.findall(side):
            parts = {symbol: 1} if symbol in BASE else _DERIVED.get(symbol)
            if parts is None:
                raise InputError(
                    f"the unit '{unit}' is not made of those of FMI",
                    source="--to fmu",
                    remedy="declare the plant in " + ", ".join((*BASE, *_DERIVED)),
                )
            for base, exponent in parts.items():
                total[base] += sign * exponent * int(power or 1)
    return {base: total[base] for base in BASE if total[base]}


NAME = "savgs_rig"
"""The model identifier."""

EXTRA = "extra/savgs_ident"
"""The folder of model.json in the archive, with the covariance, the draws and the diagnosis."""

_DESCRIPTION = "modelDescription.xml"


def write_fmu(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write savgs_rig.fmu, for the platform of this machine.

    Raises :class:`InputError` without FMPy, without a C compiler, if the plant finds no rest, or for names and
    units that FMI cannot hold.
    """
    headers, starts = _headers(), _starts(model)
    _check_names(model)
    builder = _builder(model, starts)
    with scratch_folder() as scratch, contextlib.chdir(scratch):
        files = builder.export_fmu({"no_warning": True})
        _conform(Path(_DESCRIPTION), starts)
        (document,) = write_json(model, Path())
        try:
            compiled = builder.compile_fmu(files, {"include_dirs": [str(headers)]})
        except RuntimeError as error:
            raise InputError(
                "the FMU could not be compiled", source="--to fmu", remedy="install a C compiler (gcc)"
            ) from error
        packed = Path(
            builder.pack_fmu({**compiled, document.name: f"{EXTRA}/{document.name}"}, {})
        ).read_bytes()
    return (write_bytes(folder / f"{NAME}.fmu", packed),)


def _check_names(model: ExportedModel) -> None:
    """Raise :class:`InputError` where two variables have one name, or a unit is none of FMI."""
    equations, table = model.equations, model.table
    signals = (*equations.inputs, *equations.states, *equations.outputs)
    names = [*equations.parameters, *(each.name for each in signals)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(
            f"two variables have the name '{twice}', and in an FMU each has its own",
            source="--to fmu",
            remedy="rename the coordinate, input, channel, output or parameter",
        )
    for unit in (*(table[name].unit for name in equations.parameters), *(each.unit for each in signals)):
        base_units(unit)


def _headers() -> Path:
    """The folder with FMI's headers."""
    found = find_spec("fmpy")
    if found is None or found.origin is None:
        raise InputError(
            "the headers of FMI are missing", source="--to fmu", remedy="pip install 'savgs-ident[fmu]'"
        )
    return Path(found.origin).parent / "c-code"


def _builder(model: ExportedModel, starts: Mapping[str, float]) -> ca.DaeBuilder:
    equations, table = model.equations, model.table
    builder = ca.DaeBuilder(NAME)

    def described(symbol: ca.MX, unit: str, about: str) -> ca.MX:
        builder.set_description(symbol.name(), about)
        if unit != "1":
            builder.set_unit(symbol.name(), unit)
        return symbol

    entries = [table[name] for name in equations.parameters]
    p = [
        described(builder.add(each.name, "parameter", "tunable", {}), each.unit, each.about)
        for each in entries
    ]
    u = [described(builder.add(each.name, "input", {}), each.unit, each.about) for each in equations.inputs]
    x = [described(builder.add(each.name, {}), each.unit, each.about) for each in equations.states]
    y = [described(builder.add(each.name, "output", {}), each.unit, each.about) for each in equations.outputs]
    for each in equations.states:
        builder.set_initial(each.name, "exact")
    functions = casadi_functions(model)
    arguments = [ca.vertcat(*part) for part in (x, u, p)]
    rates, outputs = functions["rates"](*arguments), functions["outputs"](*arguments)
    for place, symbol in enumerate(x):
        builder.eq(builder.der(symbol), rates[place])
    for place, symbol in enumerate(y):
        builder.eq(symbol, outputs[place])
    for name, value in starts.items():
        builder.set_start(name, value)
    return builder


def _starts(model: ExportedModel) -> dict[str, float]:
    """Start values by name: the parameters, and the plant at rest."""
    equations, starts = model.equations, model.table.as_dict()
    for signals, values in (
        (equations.inputs, resting_inputs(model)),
        (equations.states, resting_state(model)),
    ):
        starts |= dict(zip((signal.name for signal in signals), values, strict=True))
    return starts


def _conform(description: Path, starts: Mapping[str, float]) -> None:
    """Add what the standard requires and DaeBuilder does not write.

    Units are defined before the variables; names are declared as flat, because DaeBuilder generates some that are not
    structured names. Start values keep all their digits, where it writes six.
    """
    tree = ET.parse(description)
    root = tree.getroot()
    root.set("variableNamingConvention", "flat")
    for variable in root.iter("Float64"):
        if variable.get("start") is not None:
            variable.set("start", repr(starts[variable.attrib["name"]]))
    used = sorted({unit for each in root.iter() if (unit := each.get("unit")) is not None})
    definitions = ET.Element("UnitDefinitions")
    for unit in used:
        entry = ET.SubElement(definitions, "Unit", name=unit)
        exponents = {base: str(power) for base, power in base_units(unit).items()}
        ET.SubElement(entry, "BaseUnit", exponents)
    places = [place for place, child in enumerate(root) if child.tag == "ModelVariables"]
    after_interfaces = [
        place + 1 for place, child in enumerate(root) if child.tag in ("ModelExchange", "CoSimulation")
    ]
    root.insert((after_interfaces or places)[-1], definitions)
    tree.write(description, encoding="utf-8", xml_declaration=True)
