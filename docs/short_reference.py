"""What autodoc shows of the package: signatures and fields as they stand in the source, names that lead somewhere.

Names of other packages are plain text; a name of this one that leads nowhere, in a docstring, is a warning.
"""

from typing import Any

from as_written import as_text, fields_of, is_defined, signature_of, with_arguments, without_attributes
from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment


def _short_signature(_app: Sphinx, what: str, name: str, *_: Any) -> tuple[str, str | None] | None:
    """Of functions and methods as written; none of classes, for their fields follow."""
    if what in ("function", "method"):
        return signature_of(name)
    return ("", None) if what == "class" and is_defined(name) else None


def _prepare(_app: Sphinx, what: str, name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """A class lists its fields."""
    if what == "class":
        lines[:] = [*as_text(without_attributes(lines)), *fields_of(name, lines)]
    else:
        lines[:] = as_text(with_arguments(lines))


def _skip(_app: Sphinx, what: str, _name: str, member: Any, _skip: bool, _options: Any) -> bool | None:
    """Leave out what the class lists itself: all that is not a method."""
    is_method = callable(member) and not isinstance(member, property | type)
    return True if what == "class" and not is_method else None


def _ends(env: BuildEnvironment) -> dict[str, set[str]]:
    """Every end of the name of an object, to the whole names that end so."""
    if not hasattr(env, "savgs_ident_ends"):
        ends: dict[str, set[str]] = {}
        for name in env.get_domain("py").objects:
            parts = name.split(".")
            for start in range(len(parts)):
                ends.setdefault(".".join(parts[start:]), set()).add(name)
        env.savgs_ident_ends = ends
    return env.savgs_ident_ends


def _own_name(
    _app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.TextElement
) -> nodes.Node | None:
    """A name without its module leads to the one object of that name; names of others are plain text."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"].lstrip("~.")
    domain = env.get_domain("py")
    found = sorted(_ends(env).get(target, ()))
    if len(found) == 1:
        node["reftarget"] = found[0]
        return domain.resolve_xref(
            env, node["refdoc"], _app.builder, node["reftype"], found[0], node, content
        )
    of_others = "." in target and not target.startswith("savgs_ident.")
    in_a_docstring = not isinstance(content, nodes.Text) and "xref" in content.get("classes", [])
    return content if of_others or found or not in_a_docstring else None


def setup(app: Sphinx) -> None:
    """Connect what is above."""
    app.connect("autodoc-process-signature", _short_signature)
    app.connect("autodoc-process-docstring", _prepare)
    app.connect("autodoc-skip-member", _skip)
    app.connect("missing-reference", _own_name)
