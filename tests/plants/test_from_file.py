"""Plants by name: those of the package, those of a file, and what is said of a file that has none."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

HEAD = "import savgs_ident as si\n"
PLANT = """
class {name}(si.TwoMass):
    pass
"""


@pytest.fixture(autouse=True)
def _paths() -> Iterator[None]:
    """What was imported from files is forgotten."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").suffix == ".py" and "." not in name:
            del sys.modules[name]


def _file(folder: Path, text: str, name: str = "my_plant.py") -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["axis", "two_mass"])
def test_plants_of_the_package_have_names(name: str) -> None:
    model = si.load_plant(name)
    assert model.plant_name.lower() == name.replace("_", "")
    assert model.is_drawing
    assert model.layout.driven == model.plant.inputs[0].name


def test_a_file_is_run_and_its_class_found() -> None:
    named = si.load_plant(f"{EXAMPLES / 'pendulum.py'}:Pendulum")
    only = si.load_plant(str(EXAMPLES / "pendulum.py"))
    assert named.plant_name == only.plant_name == "Pendulum"
    assert named.table == only.table
    assert named.layout.names == ("pivot_accel", "angle")
    assert si.load_plant(type(named.plant)).table == named.table


def test_a_class_that_is_only_imported_is_none_of_the_file(tmp_path: Path) -> None:
    path = _file(tmp_path, "from savgs_ident import TwoMass\n")
    with pytest.raises(InputError, match="it defines no plant"):
        si.load_plant(str(path))


def test_one_of_several_has_to_be_named(tmp_path: Path) -> None:
    path = _file(tmp_path, HEAD + PLANT.format(name="One") + PLANT.format(name="Other"))
    with pytest.raises(InputError, match=r"it has 2 plants.*One.*Other"):
        si.load_plant(str(path))
    with pytest.raises(InputError, match="it has no plant 'Third'"):
        si.load_plant(f"{path}:Third")
    assert si.load_plant(f"{path}:Other").plant_name == "Other"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import savgs_ident as si\nclass A(si.TwoMass)\n", "line 2"),
        ("import savgs_ident as si\n\nx = 1 / 0\n", "line 3: ZeroDivisionError"),
        ("import no_such_library\n", "line 1: ModuleNotFoundError"),
        ("import sys\n\nsys.exit(0)\n", "line 3: SystemExit"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        si.load_plant(str(_file(tmp_path, text, "broken_plant.py")))


def test_what_is_no_plant_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no plant 'wing'.*FILE.py:CLASS"):
        si.load_plant("wing")
    with pytest.raises(InputError, match="does not exist"):
        si.load_plant(str(tmp_path / "absent.py"))
    with pytest.raises(InputError, match="there is another module 'json'"):
        si.load_plant(str(_file(tmp_path, HEAD + PLANT.format(name="A"), "json.py")))
    with pytest.raises(InputError, match="cannot be the name of a module"):
        si.load_plant(str(_file(tmp_path, HEAD, "my-plant.py")))
    no_table = HEAD + "class A(si.TwoMass):\n    parameters = None\n"
    with pytest.raises(InputError, match="declares no parameters"):
        si.load_plant(str(_file(tmp_path, no_table, "no_table.py")))
    unfinished = HEAD + "class A(si.AbstractPlant):\n    parameters = si.ParameterTable(())\n"
    with pytest.raises(InputError, match="no plant can be made of A"):
        si.load_plant(str(_file(tmp_path, unfinished, "unfinished.py")))
