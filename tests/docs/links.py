"""Checks the links of the documentation.

usage: links.py SOURCE    exit code 1, with a line for each fault, if there are any

* Every relative link and image of README.md, docs/**/*.md and the README of another folder names a
file, and the anchor
  of a link to a page is a heading of that page.
* Every page of docs/ is linked from docs/README.md.
* Every page of docs/ ends with a comment of questions; the section named after each question is a
heading of the page.
"""

import re
import sys
import unicodedata
from pathlib import Path

PAGES = ["README.md", "docs/**/*.md", "*/README.md"]
QUESTIONS = re.compile(r"\n<!-- Questions that this page answers:\n(.*?)\n-->\n$", re.S)
QUESTION = re.compile(r".+\? #(\S+)")
# Groups: "!" of an image, label, target.
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(([^()\s]+)\)")


class Anchors:
    """Gives the anchors of a page's headings, in the order of the headings."""

    def __init__(self) -> None:
        self.used: set[str] = set()

    def of(self, heading: str) -> str:
        """The anchor of the next heading. It has a number if an earlier heading has the same
        text."""
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
        kept = [c for c in heading.lower() if c in " -_" or unicodedata.category(c)[0] in "LNM"]
        name = "".join(kept).replace(" ", "-")
        number, unique = 0, name
        while unique in self.used:
            number += 1
            unique = f"{name}-{number}"
        self.used.add(unique)
        return unique


def without_code(text: str) -> str:
    """The text without code blocks, comments and inline code; line numbers are preserved."""

    def blank(found: re.Match) -> str:
        return "\n" * found[0].count("\n")

    text = re.sub(r"^( *)```.*?^ *```$", blank, text, flags=re.M | re.S)
    text = re.sub(r"<!--.*?-->", blank, text, flags=re.S)
    return re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", "", text)


def anchors(text: str) -> set[str]:
    """The anchors that GitHub makes of the headings."""
    made = Anchors()
    text = re.sub(r"^( *)```.*?^ *```$", "", text, flags=re.M | re.S)
    for heading in re.findall(r"^#+ +(.*?) *$", text, flags=re.M):
        made.of(heading)
    return made.used


def faults_of(source: Path, page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    name = page.relative_to(source)
    faults = []
    for number, line in enumerate(without_code(text).split("\n"), start=1):
        for _, _, target in LINK.findall(line):
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            if not file.exists():
                faults.append(f"{name}:{number}: {target}: no such file")
            elif anchor and (
                file.suffix != ".md" or anchor not in anchors(file.read_text(encoding="utf-8"))
            ):
                faults.append(f"{name}:{number}: {target}: no such section")
    if name.parts[0] == "docs":
        questions = QUESTIONS.search(text)
        if questions is None:
            faults.append(
                f"{name}: does not end with <!-- Questions that this page answers: ... -->"
            )
        for question in questions[1].split("\n") if questions else []:
            found = QUESTION.fullmatch(question)
            if found is None or found[1] not in anchors(text):
                faults.append(
                    f"{name}: {question}: must be QUESTION? #SECTION, a section of the page"
                )
    return faults


def missing_in_index(source: Path) -> list[str]:
    index = source / "docs" / "README.md"
    linked = {
        (index.parent / target.partition("#")[0]).resolve()
        for _, _, target in LINK.findall(without_code(index.read_text(encoding="utf-8")))
    }
    return [
        f"docs/README.md: does not name {page.relative_to(source)}"
        for page in sorted((source / "docs").glob("**/*.md"))
        if page != index and page.resolve() not in linked
    ]


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    source = Path(sys.argv[1]).resolve()
    pages = sorted({page for pattern in PAGES for page in source.glob(pattern)})
    faults = [fault for page in pages for fault in faults_of(source, page)] + missing_in_index(
        source
    )
    print("\n".join(faults) if faults else f"{len(pages)} pages")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
