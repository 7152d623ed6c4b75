"""Every public number says its unit, and every public array its shape: see :mod:`docstring_rules`."""

from pathlib import Path

import pytest

from .docstring_rules import Package

FOLDER = Path(__file__).resolve().parents[1] / "savgs_ident"
SOURCES = {
    ".".join(path.relative_to(FOLDER.parent).with_suffix("").parts): path.read_text(encoding="utf-8")
    for path in sorted(FOLDER.rglob("*.py"))
}
PACKAGE = Package(SOURCES)


@pytest.mark.parametrize("module", SOURCES)
def test_every_public_number_has_its_unit_and_every_array_its_shape(module: str) -> None:
    assert PACKAGE.missing(module) == []


def _missing(source: str, **others: str) -> list[str]:
    return Package({"planted": source, **others}).missing("planted")


def _function(annotation: str, docstring: str) -> list[str]:
    return _missing(f'def told(x: {annotation}) -> None:\n    """{docstring}"""')


@pytest.mark.parametrize(
    "docstring", ["The force.", "Of x[0] and [0, 1].", "The ``sd`` of it.", "Relative to the frame."]
)
def test_a_missing_unit_is_found(docstring: str) -> None:
    assert _function("float", docstring) == ["told: no unit of x"]


@pytest.mark.parametrize(
    "docstring",
    [
        "In [N].",
        "In [m/s^2].",
        "[rad, m]",
        "[unit of the channel]",
        "[``unit``]",
        "[1]",
        "[%]",
        "SI.",
        "A share.",
    ],
)
def test_a_unit_is_recognised(docstring: str) -> None:
    assert _function("float", docstring) == []


def test_a_name_that_says_the_unit_needs_no_more() -> None:
    assert _missing('def told(rate_hz: float) -> None:\n    """The rate."""') == []


@pytest.mark.parametrize(
    "annotation",
    ["NDArray[np.float64]", "ArrayLike", "Array", "np.ndarray", "Mapping[str, NDArray[np.float64]]"],
)
def test_a_missing_shape_is_found(annotation: str) -> None:
    assert _function(annotation, "The force [N].") == ["told: no shape of x"]
    assert _function(annotation, "The force [N], (n,).") == []


@pytest.mark.parametrize(
    "shape", ["()", "(n,)", "(2, n)", "(D, C, n + 1)", "(2 + s,)", "(..., n)", "of any shape"]
)
def test_a_shape_is_recognised(shape: str) -> None:
    assert _function("NDArray[np.float64]", f"The force [N], {shape}.") == []


def test_a_shape_in_the_annotation_is_enough_and_counts_need_no_unit() -> None:
    assert _function("Float[Array, ' n']", "The force [N].") == []
    assert _function("NDArray[np.int64]", "Places (n,).") == []
    assert _function("Int[Array, ' n']", "Places.") == []


def test_results_and_methods_are_asked_and_private_names_are_not() -> None:
    source = """
def told() -> float:
    '''A number.'''
def _own() -> float:
    '''A number.'''
class Told:
    '''Told.'''
    def __call__(self) -> float:
        '''A number.'''
    def _own(self) -> float:
        '''A number.'''
class _Own:
    x: float
"""
    assert _missing(source) == ["told: no unit of the result", "Told.__call__: no unit of the result"]


def test_a_field_is_told_in_its_entry_or_above_all_entries() -> None:
    source = """
class Told:
    '''{head}

    Attributes:
        force: the force [N].
        time, pause: of it, {time}.
        length: of it.
    '''
    force: float
    time: float
    pause: float
    length: float
    width: float
    '''Its width [m].'''
"""
    assert _missing(source.format(head="Told.", time="[s]")) == ["Told.length: no unit of length"]
    assert len(_missing(source.format(head="Told.", time="long"))) == 3
    assert _missing(source.format(head="Told, SI.", time="long")) == []


def test_what_a_method_implements_speaks_for_it() -> None:
    source = """
class Kind:
    def force(self) -> float:
        '''{}'''
class Spring(Kind):
    def force(self) -> float:
        '''In proportion.'''
"""
    assert _missing(source.format("The force [N].")) == []
    assert _missing(source.format("The force."))[1] == "Spring.force: no unit of the result"


def test_a_short_name_of_an_annotation_is_followed_to_where_it_is_made() -> None:
    source = 'from other import Row\ndef told(x: Row) -> None:\n    """The row."""'
    said = "told: no shape of x", "told: no unit of x"
    assert _missing(source, other="Row = NDArray[np.float64]") == [*said]
    assert _missing(source, other='Row = Float[Array, "n"]') == [said[1]]
    assert _missing(source, other='Row = NDArray[np.float64]\n"""Numbers of any unit, (n,)."""') == []


def test_the_help_of_an_option_counts() -> None:
    assert _function("Annotated[float, Option(metavar='HZ')]", "Run.") == []
    assert _function("Annotated[float, Option(help='How fast.')]", "Run.") == ["told: no unit of x"]
