"""`pip install .`: builds the package with CMake and puts it into a wheel.

It needs only the standard library, so that pip has nothing to download. The build directory is
kept: build/wheel, or SPRAG_BUILD. CMAKE_ARGS adds options of the configuration.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


def version() -> str:
    header = (ROOT / "sprag" / "version.h").read_text()
    found = re.search(r'SPRAG_VERSION "([0-9.]+)"', header)
    assert found
    return found[1]


def build(stage: Path) -> None:
    folder = Path(os.environ.get("SPRAG_BUILD", ROOT / "build" / "wheel"))
    configure = [
        "cmake",
        "-S", str(ROOT),
        "-B", str(folder),
        "-DCMAKE_BUILD_TYPE=Release",
        "-DCMAKE_UNITY_BUILD=ON",  # saves a third of the compile time
        "-DCMAKE_UNITY_BUILD_BATCH_SIZE=8",
        "-DSPRAG_PYTHON=ON",
        "-DSPRAG_PROGRAMS=OFF",
        "-DSPRAG_STUDIES=OFF",
        "-DSPRAG_TESTS=OFF",
        "-DSPRAG_INSTALL=OFF",
        "-DSPRAG_PYTHON_DIR=.",
        f"-DPython3_EXECUTABLE={sys.executable}",
        *shlex.split(os.environ.get("CMAKE_ARGS", "")),
    ]  # fmt: skip
    if "CMAKE_GENERATOR" not in os.environ and not (folder / "CMakeCache.txt").exists():
        configure += ["-G", "Ninja"]
    target = ["--target", "sprag_python", "--parallel", str(os.cpu_count() or 1)]
    install = ["--prefix", str(stage), "--component", "python", "--strip"]
    for command in (
        configure,
        ["cmake", "--build", str(folder), *target],
        ["cmake", "--install", str(folder), *install],
    ):
        subprocess.run(command, check=True)


def tag() -> str:
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = re.sub(r"[-.]", "_", sysconfig.get_platform())
    return f"{python}-{python}-{platform}"


def build_wheel(
    wheel_directory: str,
    config_settings: dict[str, Any] | None = None,
    metadata_directory: str | None = None,
) -> str:
    info, data = f"sprag-{version()}.dist-info", f"sprag-{version()}.data"
    with tempfile.TemporaryDirectory() as stage:
        build(Path(stage))
        files = {
            str(file.relative_to(stage)): file.read_bytes()
            for file in sorted(Path(stage).rglob("*"))
            if file.is_file()
        }
    # Same path below the environment as below an install prefix: read_scene("paper_beam") finds it.
    for scene in sorted((ROOT / "scenes").rglob("*.toml")):
        files[f"{data}/data/share/sprag/{scene.relative_to(ROOT)}"] = scene.read_bytes()
    about = (
        f"Metadata-Version: 2.1\nName: sprag\nVersion: {version()}\n"
        "Summary: State observer for impacting machines, driven by contact times alone\n"
        "License: BSD-3-Clause\nRequires-Python: >=3.10\nRequires-Dist: numpy\n"
    )
    wheel = f"Wheel-Version: 1.0\nGenerator: sprag\nRoot-Is-Purelib: false\nTag: {tag()}\n"
    files[f"{info}/METADATA"] = about.encode()
    files[f"{info}/WHEEL"] = wheel.encode()
    files[f"{info}/LICENSE"] = (ROOT / "LICENSE").read_bytes()
    lines = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=")
        lines.append(f"{name},sha256={digest.decode()},{len(content)}\n")
    files[f"{info}/RECORD"] = "".join([*lines, f"{info}/RECORD,,\n"]).encode()

    name = f"sprag-{version()}-{tag()}.whl"
    with zipfile.ZipFile(Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in files.items():
            archive.writestr(file, content)
    return name


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    raise NotImplementedError("the package is built from a checkout of the repository")
