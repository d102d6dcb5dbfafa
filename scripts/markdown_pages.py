"""Links and anchors of the documentation's Markdown, as GitHub reads them. For docs_pages.py and
tests/docs/links.py."""

import re
import unicodedata

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
