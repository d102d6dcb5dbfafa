#!/usr/bin/env python3
"""Prints a header with one declaration a variable (INPUT_FILTER in docs/Doxyfile).

usage: header_filter.py HEADER

Doxygen gives the comment of `double a, b;  ///< text` to one variable only; here each gets it.
"""

import re
import sys
from pathlib import Path

DECLARATORS = re.compile(
    r"( +)([\w:]+(?:<[^;()]*>)?) (\w+(?: = [^,;]+)?(?:, \w+(?: = [^,;]+)?)+);(?: *///<(.*))?"
)


def filtered(lines: list[str]) -> list[str]:
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
    return written


if __name__ == "__main__":
    print("\n".join(filtered(Path(sys.argv[1]).read_text(encoding="utf-8").split("\n"))))
