"""What the docstrings must say of numbers: the unit of every physical one, the shape of every array.

Read from the source alone. Asked are public functions, methods and fields of public classes:

* An array has a shape: that of jaxtyping in its annotation, or one like (n,) or (m, n) in what is said of it.
* A number with a decimal point, or an array of such, has a unit: one in square brackets, a word that stands for one
  (:data:`WORDS`), or an ending of its name that does (:data:`ENDINGS`).

What is said of an argument or a result is the docstring of the function; of a field, its own docstring or its entry
under ``Attributes``, together with what the class says of all fields above the entries. A class without such entries
says it in its docstring as a whole.
"""

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

UNITS = re.compile(
    r"\b(?:[mk]?A|C|[MG]iB|[mk]?Hz|J|K|[mk]?N|SI|V|[mk]?W|kV|deg|g|h|[mk]?m|in|kB|kg|min|[mun]?s|m?rad|rev|rpm|units?|Ohm|Wb|"
    r"bytes|draws)\b"
)
"""What stands for a unit within square brackets; so do a bare 1 and per cent."""

WORDS = re.compile(
    r"\b(?:SI|HZ|SECONDS|KM/H|seconds|metres|degrees|radians|rpm|bytes|per cent|decibels?|dB|nats?|(?<!`)sds?|"
    r"sigmas?|dimensionless|shares?|probabilit(?:y|ies)|ratios?|relative(?! to)|cosines?|correlations?|quantiles?|"
    r"chi2|whitened|standard (?:error|deviation|normal)s?|unit (?:normal|variance|length)|significance|"
    r"effective sample sizes?|logarithms?|log(?:arithmic)? (?:densit(?:y|ies)|probabilit(?:y|ies)|likelihood|"
    r"evidence|prior|weights?|odds)|(?:free|scaled) coordinates?|"
    r"any (?:consistent )?units?|units? of|in (?:its|their|the same) (?:own )?units?)\b",
    re.IGNORECASE,
)
"""What says without brackets what a number counts in: it has no dimension, or a unit that has a name."""

ENDINGS = ("_hz", "_s", "_ns", "_deg", "_mm", "_m", "_rpm", "_sigma", "_percent", "_share", "_mib")
"""Endings of names that say the unit."""

_REAL = re.compile(r"\b(float|complex|Float|Complex|ArrayLike|Array|ndarray|float64|complex128|floating)\b")
_ARRAY = re.compile(r"\b(NDArray|ArrayLike|Array|ndarray)\b")
_SHAPED = re.compile(r"\b(?:Float|Complex|Int|Bool|Inexact|UInt8)\[[^\]]*'[^\]]*\]")
_COUNTED = re.compile(r"\b(?:Int|Bool)\[[^\]]*\]|NDArray\[np\.(?:bool_?|u?int\w*|str_|object_)\]")
_SIZE = r"(?:[\w*]+(?: ?[-+/] ?\w+)*|\.\.\.)"
_SHAPE = re.compile(rf"\(\)|\({_SIZE},\)|\({_SIZE}(?:, {_SIZE})+\)|\b(?:same|any|its) shape\b|\bshape of\b")
_BRACKETS = re.compile(r"\[([^\[\]]*)\]")
_ENTRY = re.compile(r" {4}(\w+(?:, \w+)*): ")


@dataclass(frozen=True)
class Number:
    """An argument, a result or a field: what it is called, its annotation, and all that is said of it."""

    where: str
    name: str
    annotation: str
    said: str


class Package:
    """All sources of a package by dotted name: what a docstring need not repeat is found here."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        self.trees = {name: ast.parse(source) for name, source in sources.items()}
        self.aliases = {name: _aliases(tree) for name, tree in self.trees.items()}
        self.classes = {
            node.name: node
            for tree in self.trees.values()
            for node in tree.body
            if isinstance(node, ast.ClassDef)
        }

    def missing(self, module: str) -> list[str]:
        """What a module leaves unsaid, a line each."""
        known, found = self._known(module), []
        for number in self._numbers(self.trees[module]):
            annotation = _spelled_out(number.annotation, known)
            if _has_no_shape(annotation) and not _SHAPE.search(number.said):
                found.append(f"{number.where}: no shape of {number.name}")
            if _is_real(annotation) and not number.name.endswith(ENDINGS) and not says_a_unit(number.said):
                found.append(f"{number.where}: no unit of {number.name}")
        return found

    def _known(self, module: str) -> dict[str, str]:
        """Short names of annotations that a module makes or imports."""
        known = dict(self.aliases[module])
        for node in self.trees[module].body:
            if isinstance(node, ast.ImportFrom):
                there = self.aliases.get(node.module or "", {})
                known |= {name.name: there[name.name] for name in node.names if name.name in there}
        return known

    def _numbers(self, tree: ast.Module) -> Iterator[Number]:
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and _public(node.name):
                yield from _of_function(node, node.name, _text(node))
            elif isinstance(node, ast.ClassDef) and _public(node.name):
                yield from _of_fields(node)
                for method in node.body:
                    if isinstance(method, ast.FunctionDef) and _public(method.name):
                        said = " ".join(self._said_of(node, method.name))
                        yield from _of_function(method, f"{node.name}.{method.name}", said)

    def _said_of(self, owner: ast.ClassDef, method: str) -> Iterator[str]:
        """The docstring of a method, and of what it implements."""
        for node in owner.body:
            if isinstance(node, ast.FunctionDef) and node.name == method:
                yield _text(node)
        for base in owner.bases:
            if isinstance(base, ast.Name) and base.id in self.classes and base.id != owner.name:
                yield from self._said_of(self.classes[base.id], method)


def _aliases(tree: ast.Module) -> dict[str, str]:
    """Short names that a module gives to annotations, but for those whose docstring says all."""
    return {
        node.targets[0].id: ast.unparse(node.value)
        for node, after in zip(tree.body, [*tree.body[1:], ast.Pass()], strict=False)
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id[:1].isupper()
        and isinstance(node.value, ast.Subscript | ast.Name | ast.BinOp)
        and not says_a_unit(_own_text([after]))
    }


def says_a_unit(text: str) -> bool:
    """Whether a text holds a unit in square brackets or a word for one."""
    for inside in _BRACKETS.findall(text):
        if re.fullmatch(r" *(?:1|%|``\w+``) *", inside) or UNITS.search(inside):
            return True
    return bool(WORDS.search(text))


def _spelled_out(annotation: str, aliases: Mapping[str, str]) -> str:
    """An annotation with short names replaced, but within the quotes of shapes."""
    parts = re.split(r"('[^']*')", annotation)
    for place in range(0, len(parts), 2):
        parts[place] = re.sub(r"\b[A-Z]\w*", lambda hit: aliases.get(hit[0], hit[0]), parts[place])
    return "".join(parts)


def _has_no_shape(annotation: str) -> bool:
    return bool(_ARRAY.search(_SHAPED.sub("", annotation)))


def _is_real(annotation: str) -> bool:
    # What a class of effects declares is said once, at the abstract class.
    return not annotation.startswith("ClassVar") and bool(_REAL.search(_COUNTED.sub("", annotation)))


def _of_fields(node: ast.ClassDef) -> Iterator[Number]:
    head, entries = _sections(ast.get_docstring(node) or "")
    for at, statement in enumerate(node.body):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            name = statement.target.id
            said = " ".join([head, entries.get(name, ""), _own_text(node.body[at + 1 :])])
            if _public(name):
                yield Number(f"{node.name}.{name}", name, ast.unparse(statement.annotation), said)


def _of_function(node: ast.FunctionDef, where: str, said: str) -> Iterator[Number]:
    for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
        if argument.annotation is not None:
            yield _argument(where, argument.arg, argument.annotation, said)
    if node.returns is not None:
        yield Number(where, "the result", ast.unparse(node.returns), said)


def _argument(where: str, name: str, annotation: ast.expr, said: str) -> Number:
    """An argument; of an option of the command line, its help counts."""
    if isinstance(annotation, ast.Subscript) and ast.unparse(annotation.value) == "Annotated":
        said = f"{said} {ast.unparse(annotation)}"
        assert isinstance(annotation.slice, ast.Tuple)
        annotation = annotation.slice.elts[0]
    return Number(where, name, ast.unparse(annotation), said)


def _sections(docstring: str) -> tuple[str, dict[str, str]]:
    """What is said of all fields, and the entries under ``Attributes`` by name."""
    head, _, rest = docstring.partition("\nAttributes:\n")
    entries: dict[str, str] = {}
    names: list[str] = []
    for line in rest.splitlines():
        if hit := _ENTRY.match(line):
            names = hit[1].split(", ")
        for name in names:
            entries[name] = " ".join([entries.get(name, ""), line.strip()])
    return " ".join(head.split()), entries


def _text(node: ast.FunctionDef) -> str:
    return " ".join((ast.get_docstring(node) or "").split())


def _own_text(after: list[ast.stmt]) -> str:
    match after[:1]:
        case [ast.Expr(value=ast.Constant(value=str(text)))]:
            return " ".join(text.split())
    return ""


def _public(name: str) -> bool:
    return not name.startswith("_") or name == "__call__"
