"""Exceptions of Sprag; wrong arguments raise ValueError or TypeError."""

from __future__ import annotations


class Error(Exception):
    """Base of all errors of Sprag."""


class SceneError(Error):
    """A scene file cannot be read or is invalid.

    line and column count from 1 and are None if unknown; message is the text without the place.
    """

    def __init__(
        self,
        text: str,
        file: str = "",
        line: int | None = None,
        column: int | None = None,
        message: str = "",
    ) -> None:
        super().__init__(text, file, line, column, message)
        self.file = file
        self.line = line
        self.column = column
        self.message = message

    def __str__(self) -> str:
        return str(self.args[0])


class ModelError(Error):
    """The motion of the machine has no exact flow."""


class BusError(Error):
    """LCM is not available; if a route for multicast is missing, the text gives the remedy."""


class InputError(Error):
    """A file other than a scene cannot be read."""


class SimulationError(Error):
    """A simulation cannot continue; the text gives the time and the cause."""
