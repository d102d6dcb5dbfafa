"""Writes the types of the compiled module, sprag/_core.pyi, from the signatures in its docstrings.

usage: make_stub.py FOLDER_OF_THE_PACKAGE. The build calls it. pybind11 begins the docstring of each
function and property with its signature. A property whose text says what None means may be None.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

HEAD = """\
import os
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

event_dtype: np.dtype[np.void]
"""
ARRAY = r"numpy\.ndarray\[numpy\.float64(\[[^\]]*\])?\]"
# Names that pybind11 writes, as patterns, with the types in their place.
TYPES = {
    r"sprag\._core\.": "",
    r"<sprag[^>]*>|array\([^)]*\)|\binf\b": "...",  # values of defaults
    r"\*args": "*args: Any",
    r"\bobject\b": "Any",
    r"float\[\d+\]": "float",
    r"\b(tuple|list|dict)\b(?!\[)": "Any",
}
OF_ARGUMENTS = {
    rf"Union\[float, {ARRAY}\]|{ARRAY}": "npt.ArrayLike",
    r"\b[Ll]ist\[": "Sequence[",
    r"\b[Dd]ict\[": "Mapping[",
    r"\bos\.PathLike\b": "Union[str, os.PathLike[str]]",
}
OF_RESULTS = {
    ARRAY: "npt.NDArray[np.float64]",
    r"numpy\.ndarray\[bool\]": "npt.NDArray[np.bool_]",
    r"\bnumpy\.ndarray\b": "npt.NDArray[Any]",
    r"\bos\.PathLike\b": "Path",
    r"\bIterator\b(?!\[)": "Iterator[Any]",
}
OF_OBJECT = vars(object).keys() - {"__init__"}


def replaced(text: str, patterns: dict[str, str]) -> str:
    for pattern, by in {**TYPES, **patterns}.items():
        text = re.sub(pattern, by, text)
    return text


def signature(of: Any) -> tuple[str, str]:
    """Arguments and result."""
    line = (of.__doc__ or "").partition("\n")[0]
    match = re.fullmatch(r"\w*\((.*)\) -> (.*)", line)
    if not match:
        raise ValueError(f"{of} has no signature: {line}")
    return replaced(match[1], OF_ARGUMENTS), replaced(match[2], OF_RESULTS)


def lines_of_class(name: str, of: type) -> list[str]:
    lines = [f"class {name}:"]
    for member, value in vars(of).items():
        if isinstance(value, property):
            result = signature(value.fget)[1]
            if re.search(r"\bNone\b", value.__doc__ or ""):
                result = f"Optional[{result}]"
            lines += ["    @property", f"    def {member}(self) -> {result}: ..."]
        elif member not in OF_OBJECT and (value.__doc__ or "").startswith(f"{member}(self"):
            arguments, result = signature(value)
            arguments = re.sub(r"^self: \w+", "self", arguments)
            lines.append(f"    def {member}({arguments}) -> {result}: ...")
    return lines


def stub(module: ModuleType) -> str:
    lines = []
    for name, of in vars(module).items():
        if inspect.isclass(of) and not name.startswith("__"):
            lines += lines_of_class(name, of)
        elif inspect.isroutine(of):
            arguments, result = signature(of)
            lines.append(f"def {name}({arguments}) -> {result}: ...")
        elif isinstance(of, str) and not name.startswith("__"):
            lines.append(f"{name}: str")
    return HEAD + "\n".join(lines) + "\n"


def main() -> None:
    package = Path(sys.argv[1])
    if importlib.util.find_spec("numpy") is None:
        print("numpy is not installed: the package gets no types of its compiled part")
        return
    sys.path.insert(0, str(package.parent))
    text = stub(importlib.import_module("sprag._core"))
    (package / "_core.pyi").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
