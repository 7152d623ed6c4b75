"""Signatures and fields as they stand in the source: what a reader of the reference sees.

What Python makes of an annotation when it runs is long: ``NDArray[np.float64]`` becomes a line of its own.
"""

import ast
import importlib.util
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_BAR = re.compile(r"((?:``[^`]*``|[^|])*?)\|")
_ENTRY = re.compile(r"    (\w+(?:, \w+)*): (.*)")


@cache
def _module(name: str) -> ast.Module:
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    return ast.parse(Path(spec.origin).read_text(encoding="utf-8"))


@cache
def _definition(name: str) -> tuple[ast.AST | None, str]:
    """The definition of a dotted name, whose first parts are its module, and that module."""
    parts = name.split(".")
    for split in range(len(parts), 0, -1):
        try:
            spec = importlib.util.find_spec(".".join(parts[:split]))
        except ModuleNotFoundError:
            continue
        if spec is not None:
            place: ast.AST | None = _module(".".join(parts[:split]))
            for part in parts[split:]:
                place = next((node for node in _named(place) if node.name == part), None)
            return place, ".".join(parts[:split])
    return None, ""


def _named(place: ast.AST | None) -> list[ast.ClassDef | ast.FunctionDef]:
    return [node for node in getattr(place, "body", []) if isinstance(node, ast.ClassDef | ast.FunctionDef)]


def is_defined(name: str) -> bool:
    """Whether a dotted name is defined where it says, and not only imported there."""
    return _definition(name)[0] is not None


class _Shorter(ast.NodeTransformer):
    """Without the options of the command line and modules; names of the package lead to where they are defined."""

    def __init__(self, places: dict[str, str]) -> None:
        self.places = places

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Of ``Annotated`` the type alone; what stands within the brackets of an array is no name."""
        if ast.unparse(node.value) == "Annotated" and isinstance(node.slice, ast.Tuple):
            return self.visit(node.slice.elts[0])
        return self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """``np.float64`` as ``float64``."""
        return ast.Name(node.attr, ast.Load())

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """A name of the package as ``~module.Name``."""
        place = self.places.get(node.id)
        return node if place is None else ast.UnaryOp(ast.Invert(), ast.Name(place, ast.Load()))


@cache
def _places(module: str) -> dict[str, str]:
    """Names of the package that a module defines or imports, to where they are defined."""
    package, places = module.partition(".")[0], {}
    for node in ast.walk(_module(module)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(package):
            places |= {name.asname or name.name: f"{node.module}.{name.name}" for name in node.names}
    for node in _module(module).body:
        # A name of its own goes before one that is defined elsewhere under the same name.
        if isinstance(node, ast.ClassDef):
            places[node.name] = f"{module}.{node.name}"
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            places[node.targets[0].id] = f"{module}.{node.targets[0].id}"
    return places


def _shown(annotation: ast.expr, module: str) -> str:
    written = ast.unparse(annotation)
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        written = annotation.value
    return ast.unparse(_Shorter(_places(module)).visit(ast.parse(written, mode="eval").body))


def signature_of(name: str) -> tuple[str, str | None]:
    """Arguments in brackets and the result of a function or method."""
    node, module = _definition(name)
    if not isinstance(node, ast.FunctionDef):
        return "", None
    copy = ast.parse(ast.unparse(node)).body[0]
    assert isinstance(copy, ast.FunctionDef)
    arguments = copy.args
    every = [
        *arguments.posonlyargs,
        *arguments.args,
        *arguments.kwonlyargs,
        arguments.vararg,
        arguments.kwarg,
    ]
    for argument in every:
        if argument is not None and argument.annotation is not None:
            argument.annotation = ast.parse(_shown(argument.annotation, module), mode="eval").body
    if name.split(".")[-2][:1].isupper() and arguments.args and arguments.args[0].arg in ("self", "cls"):
        del arguments.args[0]
    return f"({ast.unparse(arguments)})", None if copy.returns is None else _shown(copy.returns, module)


def _attributes(lines: list[str]) -> dict[str, list[str]]:
    """The entries of the section ``Attributes`` of a docstring."""
    entries: dict[str, list[str]] = {}
    names: list[str] = []
    for line in _section(lines):
        if entry := _ENTRY.fullmatch(line):
            names = entry[1].split(", ")
            entries |= {name: [entry[2]] for name in names}
        else:
            for name in names:
                entries[name].append(line.strip())
    return entries


def _section(lines: list[str], heading: str = "Attributes:") -> list[str]:
    if heading not in lines:
        return []
    rest = lines[lines.index(heading) + 1 :]
    end = next((at for at, line in enumerate(rest) if line and not line.startswith(" ")), len(rest))
    return rest[:end]


def without_attributes(lines: list[str]) -> list[str]:
    """A docstring without its section ``Attributes``."""
    if "Attributes:" not in lines:
        return lines
    at = lines.index("Attributes:")
    return [*lines[:at], *lines[at + 1 + len(_section(lines)) :], ""]


def with_arguments(lines: list[str]) -> list[str]:
    """A docstring whose section ``Args`` is a list of fields, one an argument."""
    if "Args:" not in lines:
        return lines
    at = lines.index("Args:")
    section = _section(lines, "Args:")
    out = [*lines[:at]]
    for line in section:
        begins = line.startswith("    ") and not line.startswith("     ") and ": " in line
        name, _, text = line.strip().partition(": ")
        out.append(f":param {name}: {text}" if begins else f"    {line.strip()}" if line.strip() else "")
    return [*out, "", *lines[at + 1 + len(section) :]]


def fields_of(name: str, lines: list[str]) -> list[str]:
    """Every public field and property of a class, with type, default and what its docstring says of it."""
    text = _attributes(lines)
    node, module = _definition(name)
    out = [""]
    for field, kind, written, value, own in _fields(node, module):
        out += [f".. py:{kind}:: {field}", "   :no-index-entry:"]
        out += [f"   :type: {written}"] if written else []
        out += [f"   :value: {value}"] if value else []
        out += ["", *(f"   {line}" for line in as_text(own or text.get(field, []))), ""]
    return out


def _fields(node: ast.AST | None, module: str) -> Iterator[tuple[str, str, str, str, list[str]]]:
    body: list[ast.stmt] = getattr(node, "body", [])
    for statement, after in zip(body, [*body[1:], None], strict=False):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            name, value = statement.target.id, statement.value
            shown = "" if value is None else ast.unparse(value)
            own = after.value.value if _is_text(after) else ""
            written, kind = _shown(statement.annotation, module), "attribute"
            shown = shown if len(shown) < 40 else "..."
        elif isinstance(statement, ast.FunctionDef) and _is_property(statement):
            name, kind, shown = statement.name, "property", ""
            written = "" if statement.returns is None else _shown(statement.returns, module)
            own = ast.get_docstring(statement) or ""
        elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            # A member of an enumeration.
            name, kind, shown, written = (
                statement.targets[0].id,
                "attribute",
                ast.unparse(statement.value),
                "",
            )
            own = after.value.value if _is_text(after) else ""
        else:
            continue
        if not name.startswith("_"):
            yield name, kind, written, shown, own.splitlines()


def _is_text(statement: ast.stmt | None) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _is_property(node: ast.FunctionDef) -> bool:
    return any(
        ast.unparse(each) in ("property", "cached_property", "computed_once") for each in node.decorator_list
    )


def as_text(lines: list[str]) -> list[str]:
    """A docstring as reStructuredText: formulas and examples that are set in stay as they are, bars are bars."""
    out: list[str] = []
    before, inside = "", False
    for line in lines:
        begins = line.startswith("    ") and bool(out) and not out[-1].strip()
        if (
            begins
            and not inside
            and not before.startswith((" ", "..", "* ", "- "))
            and not before.endswith("::")
        ):
            out += ["::", ""]
            inside = True
        elif line and not line.startswith(" "):
            inside = False
        out.append(line if inside else _BAR.sub(r"\1\\|", line))
        before = line if line.strip() else before
    return out
