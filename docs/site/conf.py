"""The book as a site, by Sphinx; scripts/site calls it.

The source directory is the root of the repository, so that the links of the pages hold as they are written. What only a
site needs is added here: the contents, and where a link to a folder leads.
"""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

project = "ricochet"
version = release = re.search(r"^ +VERSION ([0-9.]+)$", (ROOT / "CMakeLists.txt").read_text(), re.M)[1]
html_title = f"ricochet {version}"
language = "en"

extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "SECURITY.md", "SUPPORT.md", "docs/*.md",
                    "docs/notes/*.md", "docs/scenes/*.md", "models/*.md", "packaging/README.md", "src/*/README.md",
                    "training_data/README.md"]
exclude_patterns = ["docs/reference.md"]  # the first page of Doxygen's
source_suffix = {".md": "markdown"}
myst_heading_anchors = 6  # those of the forge

html_theme = "furo"
templates_path = ["templates"]
html_static_path = ["static"]
html_css_files = ["book.css"]
html_theme_options = {"top_of_page_buttons": []}
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
# The search is Pagefind's, in templates/sidebar/search.html.

#: Captions of the contents, and the pages below each, relative to docs/; a star stands for all others of a folder.
CONTENTS = {
    "First steps": ["../README", "tutorial", "gallery", "install", "platforms", "coming-from", "faq"],
    "A system of your own": ["guide", "clocks", "driving", "formulas", "limits"],
    "Friction and contact": ["contact", "nonsmooth", "phases", "static-friction", "rate-and-state", "fault"],
    "Many bodies, many runs": ["scenes", "scenes/files", "scenes/method", "ensembles"],
    "Python, C, hosts, command line": ["python", "python-systems", "python-ensembles", "python-more", "c", "c-monitor",
                                       "embedding", "fmi", "command-line"],
    "Networks and training": ["expensive-guards", "step-control", "trainers", "../models/README", "../models/*",
                              "../training_data/README"],
    "Reference and background": ["glossary", "systems", "benchmarks", "../CHANGELOG", "../SUPPORT", "../SECURITY",
                                 "../CONTRIBUTING", "../CODE_OF_CONDUCT", "architecture", "notes/*", "../src/*/README",
                                 "../packaging/README"],
}


def contents():
    """The contents in MyST's words: a block for each caption."""
    for caption, pages in CONTENTS.items():
        yield "\n".join(["```{toctree}", ":hidden:", ":glob:", f":caption: {caption}", "", *pages, "```", ""])


def lead(match, here):
    """A link to a folder leads to its README; without one, and on a site, it leads nowhere and is text."""
    target = (here / match["path"]).resolve()
    if not target.is_dir():
        return match[0]
    readme = target / "README.md"
    return f"[{match['text']}]({match['path'].rstrip('/')}/README.md)" if readme.exists() else match["text"]


def adapt(app, name, source):
    here = (ROOT / name).parent
    source[0] = re.sub(r"\[(?P<text>[^\]\n]*)\]\((?P<path>[^)#\s:]+)\)", lambda match: lead(match, here), source[0])
    if name == root_doc:
        source[0] += "\n" + "\n".join(contents())


#: What a page counts in a search, by the beginning of its name; 1 without one. Pages that explain precede those that record.
WEIGHTS = {"docs/glossary": 2, "docs/coming-from": 2, "docs/platforms": 2, "docs/faq": 2, "docs/notes/": 0.3, "CHANGELOG": 0.1}


def weigh(app, name, template, context, doctree):
    weight = next((weight for start, weight in WEIGHTS.items() if name.startswith(start)), 1)
    if "body" in context:
        context["body"] = f'<div data-pagefind-weight="{weight}">{context["body"]}</div>'


def setup(app):
    app.connect("source-read", adapt)
    app.connect("html-page-context", weigh)
