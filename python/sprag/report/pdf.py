"""Conversion of a page to PDF, by WeasyPrint or by chromium."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, NoReturn

from .._command import require
from .._errors import Error

LONGEST = 120.0  # s


def pdf_of(page: str) -> bytes:
    """The page as PDF. Raises Error if neither program is installed, or if chromium fails."""
    chromium = shutil.which("chromium")
    if chromium is not None:
        return _by_chromium(chromium, page)
    if importlib.util.find_spec("weasyprint") is not None:
        return _by_weasyprint(page)
    raise Error(
        "a PDF needs chromium or WeasyPrint; install one: apt install chromium, or apt install "
        "weasyprint. Or use --format html and print the page in any browser"
    )


def _by_weasyprint(page: str) -> bytes:
    def refuse(url: str) -> NoReturn:
        raise ValueError(f"the page must load nothing, not {url}")

    weasyprint: Any = require("weasyprint", "weasyprint", "a PDF")
    html = weasyprint.HTML(string=page, base_url="file:///report.html", url_fetcher=refuse)
    pdf: bytes = html.write_pdf()
    return pdf


def _by_chromium(chromium: str, page: str) -> bytes:
    # Chromium gets fixed names in a folder of this process, not the user's.
    with tempfile.TemporaryDirectory(prefix="sprag_report_") as name:
        folder = Path(name)
        html, pdf = folder / "report.html", folder / "report.pdf"
        html.write_text(page, encoding="utf-8", errors="backslashreplace")
        options = "--headless --disable-gpu --disable-dev-shm-usage --no-first-run "
        options += "--disable-extensions --no-pdf-header-footer --print-to-pdf-no-header"
        if os.geteuid() == 0:  # its sandbox does not run as root; the page has no script
            options += " --no-sandbox"
        own = [f"--user-data-dir={folder / 'profile'}", f"--print-to-pdf={pdf}", html.as_uri()]
        failed = "chromium has failed to convert the report to PDF"
        try:
            quiet = subprocess.DEVNULL
            streams: dict[str, Any] = {"stdin": quiet, "stdout": quiet, "stderr": quiet}
            done = subprocess.run([chromium, *options.split(), *own], timeout=LONGEST, **streams)
            if done.returncode == 0 and pdf.exists():
                return pdf.read_bytes()
        except subprocess.TimeoutExpired:
            failed += f" within {LONGEST:g} s"
        raise Error(f"{failed}; use --format html and print the page in any browser")
