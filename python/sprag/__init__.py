"""State observer for impacting machines, driven by contact times alone.

A scene is a machine with contacts. simulate() returns its contact events and states. observe(),
smooth() and Observer estimate its state from the events; check() assesses whether they can.
identify() and diagnose() judge its parameters. Contacts count from
1. Units are those of the scene, SI in the supplied scenes. Arrays of many ticks are n x f in C
order. All results are read-only views of C++ data, without copies, and keep that data alive.
Scenes and results are values: they pickle (for processes of the same version), compare equal by
their numbers, and are hashable. str() of a result is what the program prints. The modules plot,
plot_study and report draw results and write reports.
"""

import importlib
import importlib.util
from typing import TYPE_CHECKING

from ._errors import BusError, Error, InputError, ModelError, SceneError, SimulationError
from ._version import __version__

if importlib.util.find_spec(f"{__name__}._core"):
    from ._core import *  # noqa: F403
    from ._events import ContactEventKind, pulses
    from ._studies import Study, read_study
    from .importing import import_events
    from .study import run_study
    from .tolerances import Tolerances, tolerance

if TYPE_CHECKING:
    from . import plot, plot_study, report, tables


def __getattr__(name: str) -> object:
    """Modules on their first use, since they start slower; they need no compiled part."""
    if name in ("plot", "plot_study", "report", "tables"):
        return importlib.import_module(f".{name}", __name__)
    if name in __all__:
        raise ImportError(
            f"sprag.{name} needs the compiled part of the package, which is not installed here"
        )
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [  # noqa: F405
    "__version__",
    "Assessment",
    "Beam",
    "BusError",
    "Candidate",
    "Contact",
    "ContactEventKind",
    "Diagnosis",
    "Energies",
    "Error",
    "Estimate",
    "EstimateListener",
    "Estimates",
    "EventPublisher",
    "Finding",
    "Force",
    "Harmonic",
    "Identification",
    "Inconsistency",
    "InputError",
    "KeptModes",
    "LiveEstimate",
    "Model",
    "ModelError",
    "Observer",
    "Output",
    "ParameterUncertainty",
    "Prediction",
    "Record",
    "Reduction",
    "Reductions",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "Smoothed",
    "SmoothedStretch",
    "State",
    "Study",
    "Tolerance",
    "Tolerances",
    "beam_contact",
    "beam_model",
    "check",
    "diagnose",
    "energies",
    "event_dtype",
    "identify",
    "impacts",
    "import_events",
    "observe",
    "parse_scene",
    "plot",
    "plot_study",
    "predict",
    "pulses",
    "read_events",
    "read_scene",
    "read_study",
    "reduce",
    "report",
    "run_study",
    "simulate",
    "smooth",
    "tables",
    "to_toml",
    "tolerance",
    "write_scene",
]
