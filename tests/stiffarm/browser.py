"""A page of ours in Chromium: what a probe in it saw, and what the browser's console said."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import oracles

NAMES = ("chromium", "chromium-browser", "google-chrome")
needs_browser = oracles.needs(*NAMES)


def with_probe(page: str, probe: str) -> str:
    """The page with script elements ``probe`` at its end, which its Content-Security-Policy is made to let run."""
    for text in re.findall(r"<script>(.*?)</script>", probe, re.DOTALL):
        ours = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        page = page.replace("script-src ", f"script-src 'sha256-{ours}' ", 1)
    return page.replace("</body>", probe + "</body>")


def browse(page: Path, where: str = "", size: str = "900,600") -> tuple[Any, str]:
    """JSON in the page's element ``probe`` once it has run, and the lines of the console; ``where``: "#...".

    ``size`` of the window in pixels.
    """
    browser = oracles.program(*NAMES)
    assert browser is not None
    run = subprocess.run(  # noqa: S603 - a program of the system, on a page of ours
        [
            browser,
            "--headless",
            "--no-sandbox",
            "--use-gl=angle",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--disable-background-networking",
            "--no-first-run",
            f"--window-size={size}",
            "--virtual-time-budget=3000",
            "--enable-logging=stderr",
            "--v=0",
            f"--user-data-dir={page.parent / 'profile'}",
            "--dump-dom",
            f"{page.as_uri()}{where}",
        ],
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
    console = "\n".join(line for line in run.stderr.splitlines() if "CONSOLE" in line)
    seen = re.search(r'<pre id="probe">(.*?)</pre>', run.stdout, re.DOTALL)
    assert seen is not None, run.stderr[-2000:] + console
    return json.loads(html.unescape(seen.group(1))), console
