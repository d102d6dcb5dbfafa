"""Common parts of the tests."""

import os
import re
import socket
from pathlib import Path

import sprag

SOURCE = Path(os.environ["SPRAG_SOURCE_DIR"])
BUILD = Path(os.environ["SPRAG_BUILD_DIR"])


def scene(name: str = "paper_beam") -> sprag.Scene:
    return sprag.read_scene(SOURCE / "scenes" / f"{name}.toml")


def readme_examples() -> list[str]:
    text = (SOURCE / "python" / "README.md").read_text()
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S)


def write_events(file: Path, events) -> None:
    """In the form of an events file: a pulse is two rows."""
    rows = {1: [1], 2: [0], 3: [1, 0]}
    with file.open("w") as csv:
        csv.write("t,contact,closed\n")
        for t, contact, kind in events.tolist():
            for closed in rows[kind]:
                csv.write(f"{t!r},{contact},{closed}\n")


def free_url() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return f"udpm://239.255.76.67:{probe.getsockname()[1]}?ttl=0"


def multicast_works() -> bool:
    try:
        sprag.EstimateListener(url=free_url())
    except sprag.BusError:
        return False
    return True
