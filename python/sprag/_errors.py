"""What goes wrong in Sprag itself; wrong arguments raise ValueError or TypeError."""

from __future__ import annotations


class Error(Exception):
    """Base of all errors of Sprag."""


class SceneError(Error):
    """A scene file that cannot be read or says what it may not.

    line and column count from 1 and are None where they are not known; message is the text behind
    the place.
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
    """A machine whose motion has no exact flow."""


class BusError(Error):
    """LCM cannot be reached; without a route for multicast the text says how to mend it."""


class InputError(Error):
    """A file, other than a scene, that cannot be read."""


class SimulationError(Error):
    """A simulation that cannot go on; the text says when and why."""
