"""A page of ours in Chromium, driven through its debugging pipe: sizes, colour schemes, print, pictures, axe.

What tests ask of a page that only a browser can answer. The pipe needs no port and no package.
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import oracles
from browser import NAMES

Scheme = Literal["light", "dark"]
# Of axe's judgements those that stop people.
GRAVE = ("serious", "critical")


class Tab:
    """One page, open. ``faults``: what the console said and what the page tried to load from elsewhere."""

    def __init__(self, send: int, receive: int) -> None:
        self._out, self._in = os.fdopen(send, "wb", buffering=0), os.fdopen(receive, "rb", buffering=0)
        self._number, self._rest = 0, b""
        self._session: str | None = None
        self.faults: list[str] = []
        self.events: list[dict[str, Any]] = []
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")
        # axe is no part of the page, which lets no script of others run.
        self.ask("Page.setBypassCSP", enabled=True)

    def ask(self, method: str, **parameters: Any) -> Any:
        """One command of the debugging protocol and its answer."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        while True:
            found = self._next()
            if found.get("id") == self._number:
                assert "error" not in found, found["error"]
                return found["result"]
            self._heard(found)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            piece = self._in.read(1 << 20)
            assert piece, "the browser ended"
            self._rest += piece
        text, self._rest = self._rest.split(b"\0", 1)
        found: dict[str, Any] = json.loads(text)
        return found

    def _heard(self, event: dict[str, Any]) -> None:
        self.events.append(event)
        kind, what = event.get("method"), event.get("params", {})
        if kind == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
            self.faults.append(what["entry"]["text"])
        elif kind == "Runtime.exceptionThrown":
            self.faults.append(str(what["exceptionDetails"]))
        elif kind == "Network.requestWillBeSent" and what["request"]["url"].startswith(("http:", "https:")):
            self.faults.append(what["request"]["url"])

    def own_faults(self) -> list[str]:
        """What the page is to blame for: a browser without a graphics card speaks of that."""
        return [text for text in self.faults if "software WebGL" not in text and "GL Driver" not in text]

    def show(self, page: Path, width: int = 1400, height: int = 900, scheme: Scheme = "light") -> None:
        """Open a page in a window of this size."""
        self.ask("Emulation.setEmulatedMedia", media="", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.events.clear()
        self.ask("Page.navigate", url=page.resolve().as_uri())
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self._heard(self._next())

    def run(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.ask("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def media(self, kind: Literal["", "print"]) -> None:
        """As on paper, or as on a screen."""
        self.ask("Emulation.setEmulatedMedia", media=kind, features=[])

    def picture(self, path: Path, whole: bool = False) -> None:
        """A screenshot, of the window or of the whole page."""
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))

    def pdf(self) -> bytes:
        """The page as it prints."""
        data = self.ask("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"]
        return base64.b64decode(data)

    def grave(self) -> list[str]:
        """What axe finds that stops people, with where it is."""
        self.run(axe_script() + "; 0")
        found = self.run("axe.run(document, {resultTypes: ['violations']}).then(r => r.violations)")
        return [
            f"{one['id']}: {node['target']} {node['failureSummary']}"
            for one in found
            if one["impact"] in GRAVE
            for node in one["nodes"]
        ]


def axe_script() -> str:
    """The accessibility engine axe as JavaScript."""
    package = oracles.load("axe_core_python").__name__
    return (resources.files(package) / "axe.min.js").read_text(encoding="utf-8")


@contextmanager
def tab() -> Iterator[Tab]:
    """A browser of its own with one page."""
    browser = oracles.program(*NAMES)
    assert browser is not None
    to_read, send = os.pipe()
    receive, to_write = os.pipe()
    # The browser reads from 3 and writes to 4, whatever these are here.
    ours = [fcntl.fcntl(end, fcntl.F_DUPFD, 64) for end in (to_read, to_write)]

    def as_it_expects() -> None:
        for number, end in zip((3, 4), ours, strict=True):
            os.dup2(end, number)

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-background-networking",
            "--no-first-run",
            "--disable-gpu",
            "--hide-scrollbars",
            "--remote-debugging-pipe",
            f"--user-data-dir={profile}",
            "about:blank",
        ]
        process = subprocess.Popen(  # noqa: S603 - a program of the system, on pages of ours
            command, preexec_fn=as_it_expects, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for end in (to_read, to_write, *ours):
            os.close(end)
        try:
            yield Tab(send, receive)
        finally:
            process.terminate()
            process.wait(timeout=20)


# Words seen, height in windows of 900 pixels, and whatever a figure with its unit is first seen at, in pixels.
SEEN = """(pattern => {
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  let at = null, words = 0;
  for (let n; (n = walk.nextNode()); ) {
    if (!n.parentElement.checkVisibility() || !n.data.trim()) continue;
    const range = document.createRange(); range.selectNodeContents(n);
    const box = range.getBoundingClientRect();
    if (box.height <= 0 || box.right <= 0) continue;
    words += n.data.split(/\\s+/).filter(w => /[\\p{L}\\p{N}]/u.test(w)).length;
    if (at === null && pattern.test(n.data)) at = box.bottom + scrollY;
  }
  return {words, height: document.documentElement.scrollHeight, wide: document.documentElement.scrollWidth, at};
})(new RegExp(PATTERN, "u"))"""


def seen(page: Tab, pattern: str) -> Mapping[str, Any]:
    """Words without what is folded away, height and width of the page, and where ``pattern`` is first seen (px)."""
    found: Mapping[str, Any] = page.run(SEEN.replace("PATTERN", json.dumps(pattern)))
    return found
