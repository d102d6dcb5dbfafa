#!/usr/bin/env python3
"""Prepares the pages of the site that scripts/docs builds, and checks the site.

usage: docs_pages.py filter FILE    prints a page or a header as Doxygen reads it
                                    (FILTER_PATTERNS in docs/Doxyfile)
       docs_pages.py python         prints a page with the signatures and docstrings of the Python
                                    package
       docs_pages.py finish SITE    copies images and files that pages link to, then checks all
                                    local links; exit code 1, with a line for each broken link

Doxygen names anchors in its own way, resolves no links between pages as GitHub does, and copies
images by their bare names. The filter therefore gives each page and heading an id, and turns links
and images into plain HTML links. In a header it gives each of several variables in one declaration
the comment that they share.
"""

import ast
import html.parser
import os
import re
import shutil
import sys
from pathlib import Path
from urllib.parse import unquote

from markdown_pages import LINK, Anchors

ROOT = Path(__file__).resolve().parent.parent
PAGES = ["README.md", "docs/**/*.md", "data/README.md", "python/README.md", "scripts/README.md"]
PYTHON_PAGE = "python_reference"
FENCE = re.compile(r"^ *```")
DECLARATORS = re.compile(
    r"( +)([\w:]+(?:<[^;()]*>)?) (\w+(?: = [^,;]+)?(?:, \w+(?: = [^,;]+)?)+);(?: *///<(.*))?"
)


def name_of(page: Path) -> str:
    """The page's id, which is the name of its HTML file."""
    relative = page.relative_to(ROOT).with_suffix("")
    if relative == Path("README"):
        return "index"
    return "_".join(relative.parts).lower().replace("-", "_")


def ascii_of(anchor: str) -> str:
    return "".join(c if c.isascii() else f"u{ord(c):x}" for c in anchor)


def target_of(page: Path, target: str) -> str | None:
    """The address in the site of a link's target; None: the site does not have it."""
    if re.match(r"[a-z]+:", target):
        return target
    path, _, anchor = target.partition("#")
    file = (page.parent / path).resolve() if path else page
    if file.suffix == ".md":
        return name_of(file) + ".html" + (f"#{name_of(file)}-{ascii_of(anchor)}" if anchor else "")
    return f"files/{file.relative_to(ROOT).as_posix()}" if file.is_file() else None


def replace_links(page: Path, text: str) -> str:
    def replaced(found: re.Match) -> str:
        image, label, target = found.groups()
        address = target_of(page, target)
        if image:
            label = label.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
            return f'<img src="{address}" alt="{label}" style="max-width: 100%"/>'
        if address is None:
            return label
        if page == ROOT / "docs" / "README.md" and target.endswith(".md"):
            return f'\\subpage {name_of((page.parent / target).resolve())} "{label}"'
        return f"[{label}]({address})"

    return LINK.sub(replaced, text)


def filtered(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"<!--.*?-->", lambda found: "\n" * found[0].count("\n"), text, flags=re.S)
    lines, in_code, has_title, anchors = [], False, False, Anchors()
    for line in text.split("\n"):
        if FENCE.match(line):
            in_code = not in_code
        elif not in_code:
            heading = re.match(r"(#+) +(.*?) *$", line)
            # Code spans stay as they are; a link's label may hold one.
            if heading is None:
                line = replace_links(page, line)
            elif not has_title:
                has_title = True
                line += " {#" + ("mainpage" if name_of(page) == "index" else name_of(page)) + "}"
            else:
                anchor = ascii_of(anchors.of(heading[2]))
                line = (
                    f"{heading[1]} {replace_links(page, heading[2])} {{#{name_of(page)}-{anchor}}}"
                )
        lines.append(line)
    return "\n".join(lines)


def filtered_header(header: Path) -> str:
    lines = header.read_text(encoding="utf-8").split("\n")
    written: list[str] = []
    i = 0
    while i < len(lines):
        found = DECLARATORS.fullmatch(lines[i])
        i += 1
        if found is None:
            written.append(lines[i - 1])
            continue
        comment = found[4] or ""
        while comment and i < len(lines) and lines[i].lstrip().startswith("///<"):
            comment += lines[i].lstrip().removeprefix("///<")
            i += 1
        before = len(written)
        while not comment and written[before - 1].lstrip().startswith("///"):
            before -= 1
        comment = comment or "".join(line.lstrip().removeprefix("///") for line in written[before:])
        del written[before:]
        for name in found[3].split(", "):
            written.append(f"{found[1]}/**{comment} */ {found[2]} {name};")
    return "\n".join(written)


# The Python package


def arguments_of(source: str, at: int) -> list[str]:
    """The arguments of a call whose opening parenthesis is at `at`."""
    arguments, start, depth, i = [], at + 1, 0, at
    while True:
        c = source[i]
        if c == '"':
            i = re.compile(r'"(?:[^"\\]|\\.)*"', re.S).match(source, i).end()
            continue
        if c in "([{":
            depth += 1
        elif c in ")]}":
            depth -= 1
        if depth == 0 or (depth == 1 and c == ","):
            arguments.append(source[start:i].strip())
            start = i + 1
            if depth == 0:
                return arguments
        i += 1


def text_of(argument: str) -> str | None:
    """The value of an argument that is a string literal."""
    if not re.fullmatch(r'(?:"(?:[^"\\]|\\.)*"\s*)+', argument, re.S):
        return None
    return "".join(
        ast.literal_eval(part) for part in re.findall(r'"(?:[^"\\]|\\.)*"', argument, re.S)
    )


def binding_docs() -> dict[str, str]:
    """The docstrings in the C++ of the package: of NAME, CLASS and CLASS.MEMBER."""
    docs: dict[str, str] = {}
    for file in sorted((ROOT / "python" / "src").glob("*.cpp")):
        source = re.sub(r"^\s*//.*$", "", file.read_text(encoding="utf-8"), flags=re.M)
        of = ""
        for found in re.finditer(
            r"py::class_<[^;{]*?>\s*(?:\w+\s*)?(\()|\bmodule\s*\.def(\()|\.def\w*(\()", source
        ):
            at = next(found.start(k) for k in (1, 2, 3) if found[k])
            texts = [text_of(argument) for argument in arguments_of(source, at)]
            names = [text for text in texts if text is not None]
            if found[1] and names:
                of = names[0]
            if not names or (len(names) < 2 or texts[-1] is None):
                continue
            key = names[0] if found[1] or found[2] else f"{of}.{names[0]}"
            docs[key] = texts[-1]
    return docs


def signature(function: ast.FunctionDef, aliases: dict[str, ast.expr], of: str = "") -> str:
    arguments = function.args
    for argument in [*arguments.args, *arguments.kwonlyargs]:
        if argument.annotation is not None:
            argument.annotation = ast.parse(
                resolved(argument.annotation, aliases), mode="eval"
            ).body
    if of and arguments.args and arguments.args[0].arg == "self":
        arguments.args = arguments.args[1:]
    if function.name == "__init__":
        return f"{of}({ast.unparse(arguments)})"
    returned = f" -> {resolved(function.returns, aliases)}" if function.returns else ""
    return f"{function.name}({ast.unparse(arguments)}){returned}"


def escaped(text: str) -> str:
    """Markdown that shows the text as it is, with the code spans that it has."""
    parts = " ".join(text.split()).split("`")
    return "`".join(
        part if i % 2 else re.sub(r"([\\*#|<>@~&])", r"\\\1", part) for i, part in enumerate(parts)
    )


def resolved(annotation: ast.expr, aliases: dict[str, ast.expr]) -> str:
    """The annotation with the stub's own names for types replaced by these."""

    class Names(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            return aliases.get(node.id, node)

    return ast.unparse(Names().visit(annotation))


def python_page() -> str:
    package = ROOT / "python" / "sprag"
    docs = binding_docs()
    trees = {
        name: ast.parse((package / name).read_text(encoding="utf-8"))
        for name in (
            "__init__.py",
            "_core.pyi",
            "_errors.py",
            "_events.py",
            "_studies.py",
            "study.py",
            "tolerances.py",
        )
    }
    public = next(
        ast.literal_eval(node.value)
        for node in trees["__init__.py"].body
        if isinstance(node, ast.Assign) and node.targets[0].id == "__all__"
    )
    aliases = {
        node.targets[0].id: node.value
        for node in trees["_core.pyi"].body
        if isinstance(node, ast.Assign)
    }
    found = {
        node.name: node
        for name, tree in trees.items()
        if name != "__init__.py"
        for node in tree.body
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name in public
    }
    lines = [
        "# Python reference {#" + PYTHON_PAGE + "}",
        "",
        escaped(ast.get_docstring(trees["__init__.py"])),
        "",
        "[How to use the package](python_readme.html)",
        "",
    ]
    for kind, title in ((ast.FunctionDef, "Functions"), (ast.ClassDef, "Classes")):
        lines += [f"## {title} {{#{PYTHON_PAGE}-{title.lower()}}}", ""]
        for name in sorted(name for name, node in found.items() if isinstance(node, kind)):
            node = found[name]
            lines += [f"### {name} {{#{PYTHON_PAGE}-{name}}}", ""]
            text = ast.get_docstring(node) or docs.get(name, "")
            if isinstance(node, ast.FunctionDef):
                lines += ["```{.unparsed}", signature(node, aliases), "```", "", escaped(text), ""]
                continue
            inits = [
                member
                for member in node.body
                if isinstance(member, ast.FunctionDef) and member.name == "__init__"
            ]
            for init in inits:
                lines += ["```{.unparsed}", signature(init, aliases, name), "```", ""]
            lines += [escaped(text), ""]
            members = [
                member
                for member in node.body
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("_")
            ]
            if members:
                lines += ["| member | type | |", "|---|---|---|"]
            for member in members:
                is_property = any(
                    isinstance(d, ast.Name) and d.id == "property" for d in member.decorator_list
                )
                shown = (
                    member.name
                    if is_property
                    else signature(member, aliases, name).partition(" -> ")[0]
                )
                returned = (
                    resolved(member.returns, aliases).replace("|", "or") if member.returns else ""
                )
                shown = shown.replace("|", "or")
                member_text = ast.get_docstring(member) or docs.get(f"{name}.{member.name}", "")
                lines.append(f"| `{shown}` | `{returned}` | {escaped(member_text)} |")
            lines.append("")
    return "\n".join(lines)


# The site


class Addresses(html.parser.HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.links.append(value)
            elif name in ("id", "name") and value:
                self.ids.add(value)


def finish(site: Path) -> int:
    for page in sorted({page for pattern in PAGES for page in ROOT.glob(pattern)}):
        for _, _, target in LINK.findall(page.read_text(encoding="utf-8")):
            address = target_of(page, target)
            if address and address.startswith("files/"):
                copy = site / address
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / address.removeprefix("files/"), copy)
    parsed = {}
    for file in sorted(site.glob("**/*.html")):
        parsed[file] = Addresses()
        parsed[file].feed(file.read_text(encoding="utf-8"))
    faults = []
    for file, addresses in parsed.items():
        for link in addresses.links:
            # Doxygen links to the list of nested classes also where all of them are private.
            if re.match(r"[a-z]+:", link) or link == "#nested-classes":
                continue
            path, _, anchor = link.partition("#")
            target = file.parent / unquote(path.partition("?")[0]) if path else file
            if not target.is_file():
                faults.append(f"{file.name}: {link}: no such file")
            elif anchor and target in parsed and unquote(anchor) not in parsed[target].ids:
                faults.append(f"{file.name}: {link}: no such anchor")
    print("\n".join(sorted(set(faults))) if faults else f"{len(parsed)} pages: {site}/index.html")
    return int(bool(faults))


def main() -> int:
    match sys.argv[1:]:
        case ["filter", page]:
            page = Path(os.path.abspath(page))
            is_made = page.stem == PYTHON_PAGE
            sys.stdout.write(
                filtered_header(page)
                if page.suffix == ".h"
                else page.read_text(encoding="utf-8")
                if is_made
                else filtered(page)
            )
        case ["python"]:
            print(python_page())
        case ["finish", site]:
            return finish(Path(site).resolve())
        case _:
            print(__doc__)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
