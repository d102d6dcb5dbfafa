"""How the values of the package show themselves: in one line, and in notebooks."""

import html
from typing import Any

import numpy as np

_LONGEST = 160


def _attributes(value: Any) -> dict[str, str]:
    names = [name for name, of in vars(type(value)).items() if isinstance(of, property)]
    return {name: _shown(getattr(value, name)) for name in names}


def _shown(of: Any) -> str:
    if isinstance(of, np.ndarray):
        if of.dtype.names is None and of.size <= 4:
            return f"{of.tolist()}"
        return " x ".join(str(n) for n in of.shape) + (" entries" if of.ndim == 1 else "")
    if isinstance(of, float):
        return f"{of:.6g}"
    if isinstance(of, list | dict) and of:
        return f"{len(of)} entries" if len(of) > 1 else "1 entry"
    if type(of).__module__.startswith(__package__ or "sprag"):
        return type(of).__name__
    return repr(of)


def one_line(value: Any) -> str:
    """All attributes of a value, arrays by their shape, cut after 160 characters."""
    shown = ", ".join(f"{name} = {text}" for name, text in _attributes(value).items())
    text = f"<sprag.{type(value).__name__} {shown}"
    return (text if len(text) < _LONGEST else text[: _LONGEST - 5] + " ...") + ">"


def as_html(value: Any) -> str:
    """The text of a value that has one, else a table of its attributes, escaped."""
    text = str(value)
    if "\n" in text:
        return f"<pre>{html.escape(text)}</pre>"
    rows = "".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(shown)}</td></tr>"
        for name, shown in _attributes(value).items()
    )
    return f"<table><caption>{type(value).__name__}</caption>{rows}</table>"


class Value:
    """A value that compares by its attributes: arrays bit for bit, so that nan is nan."""

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and _same(vars(self), vars(other))

    def __hash__(self) -> int:
        return hash(repr(self))

    def _repr_html_(self) -> str:
        return as_html(self)


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(of, b[key]) for key, of in a.items())
    return bool(a == b)
