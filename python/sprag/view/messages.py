"""Messages as arrays. All messages of a channel that arrived together are read at once."""

from __future__ import annotations

import importlib
import struct
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

Records = npt.NDArray[np.void]

TYPES = {
    "SPRAG_OUTPUTS": "outputs_t",
    "SPRAG_BOUNDS": "bounds_t",
    "SPRAG_PARAMETERS": "parameters_t",
    "SPRAG_HEALTH": "health_t",
    "SPRAG_INPUT": "input_t",
}
CHANNELS = ["SPRAG_CONTACTS", "SPRAG_ESTIMATE", "SPRAG_SETTLED", "SPRAG_TRUTH", *TYPES]

_HEAD = "type:i8 session:i8 utime:i8 tick:i8 t:f8 f:i4 q:f8:f u:f8:f closed:i8"
_ESTIMATE = (
    " settled_tick:i8 estimators:i1 from_filter:i1 bound:f8"
    " deviations:i4 sigma_q:f8:d sigma_u:f8:d gaps:i4 sigma_g:f8:g"
    " closing:f8 closing_contact:i4 replica_gap:f8 filter_gap:f8 sigma_filter_gap:f8"
    " inconsistencies:i8 suspect_t:f8 suspect_contact:i4 suspicion:i1"
)


@lru_cache(64)
def _layout(members: str, **lengths: int) -> np.dtype[np.void]:
    fields: list[Any] = []
    for member in members.split():
        name, kind, *length = member.split(":")
        fields.append((name, ">" + kind, *((lengths[of],) for of in length)))
    return np.dtype(fields)


def _layout_of(data: bytes, of_estimates: bool) -> np.dtype[np.void]:
    (f,) = struct.unpack_from(">i", data, 40)
    if not of_estimates:
        return _layout(_HEAD, f=f)
    at = 44 + 16 * f + 26
    (deviations,) = struct.unpack_from(">i", data, at)
    (gaps,) = struct.unpack_from(">i", data, at + 4 + 16 * deviations)
    return _layout(_HEAD + _ESTIMATE, f=f, d=deviations, g=gaps)


def records(messages: Sequence[bytes], of_estimates: bool) -> Iterator[Records]:
    """Valid messages of type estimate_t or state_t, in arrays of those with equal lengths."""
    for layout, group in groupby(messages, lambda data: _layout_of(data, of_estimates)):
        yield np.frombuffer(b"".join(group), layout)


def message_class(name: str) -> Any:
    """A class that lcm-gen has made."""
    return getattr(importlib.import_module(f".._lcm.{name}", __package__), name)


def decoded(channel: str, data: bytes) -> Any:
    """A valid message of another type."""
    return message_class(TYPES[channel]).decode(data)


def encoded(kind: str, /, **members: Any) -> bytes:
    message = message_class(kind)()
    for member, value in members.items():
        setattr(message, member, value)
    data: bytes = message.encode()
    return data
