"""Sphinx settings of the site that scripts/docs builds.

The site's pages are the Markdown pages of the repository, as they are. When Sphinx reads them,
the menu, the list of questions and the entries of the C++ and Python references are added to
README.md, docs/how_do_i.md, docs/reference/cpp.rst and docs/reference/python.rst.
"""

import importlib.util
import os
import re
import sys
import types
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.highlighting import lexers

ROOT = Path(__file__).resolve().parent.parent
VERSION = re.search(r'SPRAG_VERSION "(.*)"', (ROOT / "sprag" / "version.h").read_text())[1]

# The package of a build tree if there is one, else its modules without the compiled part.
BUILT = Path(os.environ.get("SPRAG_BUILD", ROOT / "build")) / "python"
if (BUILT / "sprag" / "_version.py").is_file():
    sys.path.insert(0, str(BUILT))
else:
    sys.path.insert(0, str(ROOT / "python"))
    sys.modules["sprag._version"] = types.ModuleType("sprag._version")
    sys.modules["sprag._version"].__version__ = VERSION
HAS_CORE = importlib.util.find_spec("sprag._core") is not None

project = "Sprag"
version = release = VERSION
copyright = "the Sprag authors, BSD 3-Clause"
extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "docs/**.md",
    "docs/reference/*.rst",
    "data/README.md",
    "python/README.md",
    "scripts/README.md",
]
exclude_patterns = ["build*", "out", ".*"]
# A heading may skip a level. Two classes of the package have the name Study.
suppress_warnings = ["myst.header", "ref.python"]
default_role = "code"

myst_heading_anchors = 6
highlight_language = "none"
html_theme = "furo"
html_title = f"Sprag {VERSION}"
html_show_sourcelink = False
html_copy_source = False
# Furo of Debian 12 lacks the dark colours for a system that asks for them.
FOLLOW_THE_SYSTEM = """
const body = document.body;
const background = getComputedStyle(body).getPropertyValue("--color-background-primary");
const asked = matchMedia("(prefers-color-scheme: dark)").matches;
if (body.dataset.theme === "auto" && asked && background.trim() === "white") {
  body.dataset.theme = "dark";
}
"""
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_js_files = [(None, {"body": FOLLOW_THE_SYSTEM})]

breathe_projects = {"sprag": os.environ["SPRAG_XML"]}
breathe_default_project = "sprag"
breathe_show_include = False
autodoc_default_options = {"members": True, "undoc-members": True}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"

QUESTIONS = re.compile(r"<!-- Questions that this page answers:\n(.*?)\n-->", re.S)
LINK = re.compile(r"\[([^]]*)\]\(([^)#:]+)\)")
INDEX_ROW = re.compile(r"^\| \[[^]]*\]\(([^)]*\.(?:md|rst))\)", re.M)


def menu() -> dict[str, list[str]]:
    """Captions of docs/README.md and the pages, as paths from ROOT, in the tables below them."""
    sections = re.split(r"^## +(.*)$", (ROOT / "docs/README.md").read_text(), flags=re.M)
    return {
        caption: [os.path.normpath(f"docs/{page}") for page in INDEX_ROW.findall(text)]
        for caption, text in zip(sections[1::2], sections[2::2])
    }


def title_of(page: str) -> str:
    return re.search(r"^# +(.*)$", (ROOT / page).read_text(), re.M)[1]


def menu_text() -> str:
    text = ""
    sections = {"": ["docs/how_do_i.md", "docs/README.md"], **menu()}
    for caption, pages in sections.items():
        names = "\n".join(f"/{os.path.splitext(page)[0]}" for page in pages)
        option = f":caption: {caption}\n" if caption else ""
        text += f"```{{toctree}}\n:hidden:\n{option}\n{names}\n```\n\n"
    return text


def questions_text() -> str:
    text = ""
    for caption, pages in menu().items():
        text += f"\n## {caption}\n"
        for page in pages:
            found = QUESTIONS.search((ROOT / page).read_text())
            if found is None:
                continue
            path = os.path.relpath(page, "docs")
            text += f"\n### {title_of(page)}\n\n"
            for question in found[1].split("\n"):
                words, _, anchor = question.rpartition(" #")
                text += f"* [{words}]({path}#{anchor})\n"
    return text


def heading(text: str) -> str:
    return f"\n{text}\n{'-' * len(text)}\n\n"


def literal(line: str) -> str:
    """reStructuredText of plain text with `code`."""
    parts = re.split(r"`+", line)
    return "``".join(
        part if k % 2 else re.sub(r"([\\*|_])", r"\\\1", part) for k, part in enumerate(parts)
    )


def description_of(header: str) -> str:
    """The comment at the top of a header; indented lines are code."""
    text = ""
    in_code = False
    for line in (ROOT / header).read_text().split("\n"):
        if not line.startswith("///"):
            return text
        line = re.sub(r"^/// ?(\\file|\\brief )?", "", line)
        is_code = line.startswith("    ")
        if is_code and not in_code:
            text += "\n.. code-block:: cpp\n\n"
        text += (line if is_code else literal(line)) + "\n"
        in_code = is_code
    return text


def cpp_text() -> str:
    """The entries by header. doxygenfile would declare the namespace once a header."""

    def tree(name: str) -> ElementTree.Element:
        return ElementTree.parse(f"{os.environ['SPRAG_XML']}/{name}.xml").getroot()

    directives: dict[str, list[str]] = {}
    members = list(tree("namespacesprag").iter("memberdef"))
    names = [member.findtext("name") for member in members]
    compounds = list(tree("index").iter("compound"))
    classes = {c.findtext("name") for c in compounds if c.get("kind") in ("class", "struct")}
    for compound in compounds:
        name = compound.findtext("name")
        # Nested classes are members.
        if name in classes and name.rpartition("::")[0] not in classes:
            header = tree(compound.get("refid")).find("compounddef/location").get("file")
            entry = f".. doxygen{compound.get('kind')}:: {name}\n   :members:\n"
            directives.setdefault(header, []).append(entry)
    for member in members:
        name = member.findtext("name")
        arguments = member.findtext("argsstring") if names.count(name) > 1 else ""
        entry = f".. doxygen{member.get('kind')}:: sprag::{name}{arguments}\n"
        directives.setdefault(member.find("location").get("file"), []).append(entry)
    return "".join(
        heading(header) + description_of(header) + "\n" + "\n".join(directives[header]) + "\n"
        for header in sorted(directives)
    )


def python_text() -> str:
    text = (
        ".. automodule:: sprag\n   :imported-members:\n"
        if HAS_CORE
        else ".. warning::\n   This site was built without the compiled part of the package: the "
        "functions that need it are missing here.\n   Build with ``-DSPRAG_PYTHON=ON``, then run "
        "``scripts/docs`` again.\n"
    )
    for module in ("plot", "plot_study", "report", "tables"):
        text += heading(f"sprag.{module}") + f".. automodule:: sprag.{module}\n"
    return text


ADDED = {
    "README": menu_text,
    "docs/how_do_i": questions_text,
    "docs/reference/cpp": cpp_text,
    "docs/reference/python": python_text,
}


def complete_page(app, name, source):
    folder = Path(app.env.doc2path(name)).parent
    text = re.sub(r"^ *<!--.*?-->\n", "", source[0], flags=re.M | re.S)
    text = LINK.sub(lambda link: link[1] if (folder / link[2]).is_dir() else link[0], text)
    source[0] = text + "\n" + (ADDED[name]() if name in ADDED else "")


def setup(app):
    app.connect("source-read", complete_page)
    lexers["csv"] = TextLexer()
