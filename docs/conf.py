"""How the documentation is built: ``make docs``."""

import importlib
import sys
from pathlib import Path

import savgs_ident

# The public calls of these names stand before the rooms, which have a page each.
for _room in ("fit", "simulate", "export"):
    vars(savgs_ident)[_room] = importlib.import_module(f"savgs_ident.{_room}")

sys.path.insert(0, str(Path(__file__).parent))

project = "savgs-ident"
author = "the savgs-ident authors"
version = release = savgs_ident.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "myst_parser",
    "short_reference",
]
templates_path = ["_templates"]
html_theme = "alabaster"
html_theme_options = {
    "description": "From recordings of a suspension rig to what its model lacks",
    "page_width": "72em",
}
html_sidebars = {"**": ["about.html", "searchfield.html", "localtoc.html", "relations.html"]}
html_title = f"savgs-ident {version}"
html_copy_source = False
html_show_sourcelink = False

nitpicky = True
myst_heading_anchors = 3
autosummary_generate_overwrite = True
# Signatures and fields are shown as they stand in the source.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {
    "members": True,
    "special-members": "__call__",
}
python_maximum_signature_line_length = 100
# A reader wants the names, not the folders they live in.
add_module_names = False
toc_object_entries = False
