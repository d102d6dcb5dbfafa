"""State observer for impacting machines, driven by contact times alone.

A scene is a machine with contacts. simulate() gives its contact events and states; observe() and
Observer find its state from the events; check() says whether they will. Contacts count from 1. Units are the scene's own, SI in the
scenes that ship. Arrays of many ticks are n x f in C order; all results are read-only views of what
C++ computed, without copies, and stay valid for as long as they are used.
"""

from ._core import (
    Assessment,
    Beam,
    Contact,
    Energies,
    Estimate,
    EstimateListener,
    Estimates,
    EventPublisher,
    Finding,
    Force,
    Harmonic,
    LiveEstimate,
    Model,
    Observer,
    Output,
    ParameterUncertainty,
    Scene,
    Simulation,
    State,
    beam_contact,
    beam_model,
    check,
    energies,
    event_dtype,
    observe,
    parse_scene,
    read_events,
    read_scene,
    simulate,
)
from ._errors import BusError, Error, InputError, ModelError, SceneError, SimulationError
from ._events import ContactEventKind, pulses
from ._studies import Study, read_study

__all__ = [
    "Assessment",
    "Beam",
    "BusError",
    "Contact",
    "ContactEventKind",
    "Energies",
    "Error",
    "Estimate",
    "EstimateListener",
    "Estimates",
    "EventPublisher",
    "Finding",
    "Force",
    "Harmonic",
    "InputError",
    "LiveEstimate",
    "Model",
    "ModelError",
    "Observer",
    "Output",
    "ParameterUncertainty",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "State",
    "Study",
    "beam_contact",
    "beam_model",
    "check",
    "energies",
    "event_dtype",
    "observe",
    "parse_scene",
    "pulses",
    "read_events",
    "read_scene",
    "read_study",
    "simulate",
]
