"""The site: prose, the notebooks as they were run, every command, every public address.

``sphinx-build -W -c notebooks/docs notebooks site``, from the repository's root.  Pages of
commands, modules and scenes are written into ``generated`` first, from the program itself.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import pages  # noqa: E402

import jaxpf  # noqa: E402

project, version, release = "jaxpf", jaxpf.__version__, jaxpf.__version__
author = "The jaxpf developers"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
# What other pages include is no page.
exclude_patterns = [
    "**/.ipynb_checkpoints",
    "docs/generated/counts.md",
    "docs/generated/verdicts.md",
]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
nb_execution_mode = "off"
napoleon_use_ivar = True
autodoc_typehints = "none"  # docstrings tell shapes and units
autoclass_content = "both"  # what making an instance takes stands in __init__
html_theme = "sphinx_book_theme"
html_title = "jaxpf"
html_copy_source = html_show_copyright = False


def setup(app):
    """Write the pages that the program tells."""
    app.connect("builder-inited", lambda app: pages.write(HERE / "generated"))
