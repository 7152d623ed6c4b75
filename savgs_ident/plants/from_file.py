"""Plants by name: those that come with the package, and those of a Python file of one's own.

    model = load_plant("pendulum.py:Pendulum")                           # the numbers that its class declares
    model = load_plant("pendulum.py:Pendulum", "out/fit/model.toml")     # those that a fit found

The file is a program that the user names and that is run as one; recordings and files of numbers never name it.
"""

import importlib
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.plants.axis import Axis
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.model_toml import read_model
from savgs_ident.plants.two_mass import TwoMass

SHIPPED: Mapping[str, type[AbstractPlant]] = MappingProxyType({"axis": Axis, "two_mass": TwoMass})
"""Plants that come with the package, by name; the quarter car has models of its own."""

_FILES: set[Path] = set()
"""Files of plants that were run in this process."""

_REMEDY = "name it as FILE.py:CLASS, or choose among: " + ", ".join(SHIPPED)


def load_plant(plant: str | type[AbstractPlant], path: str | Path | None = None) -> PlantModel:
    """The model of a plant with the numbers that it declares, or with those of a file.

    Args:
        plant: ``FILE.py:CLASS``, or ``FILE.py`` where it has one plant only; ``axis`` or ``two_mass``; or the class
            itself, which declares its ``parameters``.
        path: a ``model.toml`` that a fit of this plant wrote, or one of the same form with some of its numbers.

    Raises :class:`InputError` for a file that cannot be read or run, that has no such plant, or whose numbers are not
    those of the plant.
    """
    found = plant_class(plant) if isinstance(plant, str) else plant
    parameters = getattr(found, "parameters", None)
    source = plant if isinstance(plant, str) else found.__name__
    if not isinstance(parameters, ParameterTable):
        raise InputError(
            "the plant declares no parameters",
            source=source,
            remedy="give the class a ParameterTable: parameters: ClassVar = ParameterTable((...))",
        )
    try:
        model = PlantModel(found(), parameters)
    except TypeError as error:
        raise InputError(
            f"no plant can be made of {found.__name__}: {error}",
            source=source,
            remedy="let the class declare and define all that AbstractPlant asks for, and need no arguments",
        ) from error
    return model if path is None else read_model(path, model)


def plant_class(name: str) -> type[AbstractPlant]:
    """The class that ``FILE.py:CLASS``, ``FILE.py`` or the name of a plant of the package says.

    Raises :class:`InputError` as :func:`load_plant` does.
    """
    if name in SHIPPED:
        return SHIPPED[name]
    file, wanted = _parts(name)
    module = _run(file)
    plants = {
        each.__name__: each
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, AbstractPlant) and each.__module__ == module.__name__
    }
    if wanted in plants:
        return plants[wanted]
    if not wanted and len(plants) == 1:
        return next(iter(plants.values()))
    if not plants:
        raise InputError(
            "it defines no plant", source=file, remedy="derive a class from savgs_ident.AbstractPlant"
        )
    what = f"it has no plant '{wanted}'" if wanted else f"it has {len(plants)} plants"
    raise InputError(
        what, source=file, remedy="name one of: " + ", ".join(f"{file}:{each}" for each in plants)
    )


def _parts(name: str) -> tuple[Path, str]:
    """File and class of ``FILE.py:CLASS``; no class where none is named."""
    file, _, wanted = name.rpartition(":") if ":" in name and not name.endswith(".py") else (name, "", "")
    path = Path(file)
    if path.suffix != ".py":
        raise InputError(f"there is no plant '{name}'", source="--plant", remedy=_REMEDY)
    if not path.is_file():
        raise InputError("does not exist", source=path, remedy="check the path of the plant's file")
    return path, wanted


def _run(file: Path) -> ModuleType:
    """The module of a file, imported under its own name, so that worker processes can import it, too."""
    file = file.resolve()
    if not file.stem.isidentifier():
        raise InputError(
            f"'{file.stem}' cannot be the name of a module",
            source=file,
            remedy="rename the file: letters, digits and underscores",
        )
    _FILES.add(file)
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    try:
        module = importlib.import_module(file.stem)
    except (Exception, SystemExit) as error:
        raise InputError(
            f"cannot be run: {fault_in(file, error)}", source=file, remedy="mend it there, and try again"
        ) from error
    if Path(getattr(module, "__file__", None) or "").resolve() != file:
        raise InputError(
            f"there is another module '{file.stem}'",
            source=file,
            remedy="give the file a name that no library has",
        )
    return module


def fault_in(file: Path, error: BaseException) -> str:
    """What went wrong in a file, with its line, in a sentence."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {error.msg}"
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(file)]
    place = f"line {lines[-1]}: " if lines else ""
    said = str(error).strip().splitlines()
    return f"{place}{type(error).__name__}" + (f": {said[0]}" if said else "")


def fault_of_a_plant(error: Exception) -> InputError | None:
    """The error as one of the file of a plant, if that is where it was raised; None if it was not."""
    frames = {each.filename for each in traceback.extract_tb(error.__traceback__)}
    for file in _FILES:
        if str(file) in frames:
            return InputError(
                f"its equations cannot be evaluated: {fault_in(file, error)}",
                source=file,
                remedy=f"mend it there; savgs-ident check-plant {file.name} looks at all of it",
            )
    return None
