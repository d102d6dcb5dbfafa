"""Runs the programs in Python: ``python3 -m sprag PROGRAM ARGUMENTS``."""

from __future__ import annotations

import importlib
import sys

from ._command import EXIT_DONE, EXIT_USAGE, choose, printable
from ._version import __version__

# Each program with its module in this package, which has a function main().
PROGRAMS: dict[str, str] = {
    "import_events": "importing.program",
    "plot": "plot",
    "report": "report",
    "study": "study",
    "tolerance": "tolerances",
    "view": "view",
}


def main() -> int:
    """Runs the program that the first argument names, with the other arguments."""
    if len(sys.argv) < 2:
        print(f"usage: sprag PROGRAM [OPTION]...     {choose('PROGRAM', sorted(PROGRAMS))}")
        return EXIT_USAGE
    name = sys.argv.pop(1)
    if name == "--version":
        print(f"sprag {__version__}")
        return EXIT_DONE
    if name not in PROGRAMS:
        problem = f"there is no program {name}"
        print(f"sprag: {printable(choose(problem, sorted(PROGRAMS)))}", file=sys.stderr)
        return EXIT_USAGE
    program = importlib.import_module(f".{PROGRAMS[name]}", __package__)
    return int(program.main())


if __name__ == "__main__":
    sys.exit(main())
