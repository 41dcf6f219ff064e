"""A browser without a window, driven over a pipe by the DevTools protocol: no port is open, and no library is needed."""

from __future__ import annotations

import base64
import json
import os
import re
import select
import shutil
import subprocess
import tempfile
import time
import zlib
from pathlib import Path
from types import TracebackType
from typing import Any

PATIENCE = 60.0
_OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-component-update",
    "--disable-dev-shm-usage", "--disable-sync", "--no-first-run", "--no-default-browser-check", "--hide-scrollbars",
    "--remote-debugging-pipe",
)  # fmt: skip


def program() -> str | None:
    """Path of the browser of the distribution, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Browser:
    """One browser process with a profile of its own, which is removed at the end."""

    def __init__(self) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        # The browser reads descriptor 3 and writes 4.
        shell = f'exec "$@" 3</dev/fd/{to_browser} 4>/dev/fd/{from_browser}'
        self._process = subprocess.Popen(
            ["sh", "-c", shell, "sh", str(program()), *_OPTIONS, f"--user-data-dir={self._profile.name}"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=(to_browser, from_browser),
            env={"PATH": os.environ["PATH"], "HOME": self._profile.name},
        )  # fmt: skip
        os.close(to_browser)
        os.close(from_browser)
        self._rest, self._number = b"", 0
        self._session: str | None = None
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> Browser:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._out)  # a browser whose pipe is closed ends
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        self._profile.cleanup()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Carry out one command; the events that come meanwhile are kept."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while (answer := self._message()).get("id") != self._number:
            self.events.append(answer)
        assert "error" not in answer, f"{method}: {answer['error']}"
        result: dict[str, Any] = answer["result"]
        return result

    def _message(self) -> dict[str, Any]:
        end = time.monotonic() + PATIENCE
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._in], [], [], max(0.0, end - time.monotonic()))
            chunk = os.read(self._in, 1 << 20) if ready else b""
            assert chunk, f"the browser said nothing for {PATIENCE:g} s, or ended with {self._process.poll()}"
            self._rest += chunk
        first, self._rest = self._rest.split(b"\0", 1)
        message: dict[str, Any] = json.loads(first)
        return message

    def resize(self, width: int, height: int = 900) -> None:
        """Give the window this size [px]."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def colours(self, scheme: str) -> None:
        """What the user prefers, "light" or "dark"."""
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def open(self, page: Path | str, width: int) -> None:
        """Open a file or an address in a window of this width [px] and wait until it has been loaded."""
        self.resize(width)
        for address in ("about:blank", page if isinstance(page, str) else page.resolve().as_uri()):
            self.events.clear()  # what the page before still complains of, a stream that has ended, comes until it is left
            self.call("Page.navigate", url=address)
            while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
                self.events.append(self._message())

    def value(self, script: str) -> Any:
        """What a script gives; a promise is waited for."""
        result = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def complaints(self) -> list[str]:
        """Errors of the page and of its scripts since it was opened."""
        found = []
        for event in self.events:
            method, said = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                details = said["exceptionDetails"]
                found.append(details.get("exception", {}).get("description", details["text"]))
            elif (method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert", "warning")) or (
                method == "Log.entryAdded"
                and said["entry"]["level"] in ("error", "warning")
                and said["entry"]["source"] != "rendering"  # how fast its own driver draws is not the page's affair
            ):
                found.append(json.dumps(said.get("args") or said.get("entry")))
        return found

    def picture(self, path: Path) -> None:
        """Write a picture of the whole page, PNG."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def printed(self) -> bytes:
        """The page on paper, as PDF."""
        result = self.call("Page.printToPDF", printBackground=True, preferCSSPageSize=True)
        return base64.b64decode(result["data"])


# Scrolls to every chart, as a reader does, and waits until it is drawn.
_DRAW = """(async () => {
  for (const figure of document.querySelectorAll(".figure")) {
    figure.scrollIntoView();
    const end = performance.now() + 10000;
    await new Promise((done) => {
      const look = () => figure.querySelector(".main-svg") || performance.now() > end ? done() : requestAnimationFrame(look);
      look();
    });
  }
  window.scrollTo(0, 0);
})()"""
# How many marks each chart holds, and what sticks out of the page, of its box, or of its picture.
_LOOK = """(() => {
  const width = document.documentElement.clientWidth, out = [];
  const name = (e) => `${e.tagName}.${e.getAttribute("class") || ""} "${e.textContent.slice(0, 40)}"`;
  const scrolls = (e) => {
    let p = e.parentElement;
    while (p && !["auto", "scroll"].includes(getComputedStyle(p).overflowX)) p = p.parentElement;
    return p;
  };
  if (document.documentElement.scrollWidth > width) out.push(`the page is ${document.documentElement.scrollWidth} px wide`);
  for (const e of document.querySelectorAll("main *")) {
    if (e.closest("svg") || e.closest(".figure") || scrolls(e)) continue;
    const box = e.getBoundingClientRect(), style = getComputedStyle(e);
    if (box.width && (box.left < -1 || box.right > width + 1)) out.push(`outside the page: ${name(e)}`);
    if (style.display !== "inline" && style.overflowX !== "auto" && e.clientWidth && e.scrollWidth > e.clientWidth + 1)
      out.push(`wider than its box: ${name(e)}`);
  }
  for (const text of document.querySelectorAll("svg text")) {
    const picture = text.closest(".svg-container") || text.ownerSVGElement;
    const box = text.getBoundingClientRect(), all = picture.getBoundingClientRect();
    if (box.width && (box.left < all.left - 1 || box.right > all.right + 1 || box.top < all.top - 1 || box.bottom > all.bottom + 1))
      out.push(`cut off in its picture: "${text.textContent}"`);
  }
  const drawn = (p) => p.tagName === "image" || (p.getAttribute("d") || "").length > 8;
  const marks = (f) => [...f.querySelectorAll(".js-line, .points path, .heatmaplayer image")].filter(drawn).length;
  return { out, marks: [...document.querySelectorAll(".figure")].map(marks) };
})()"""
# Waits until every chart has the width of a window that changed its size; then listens how high charts are on paper.
_RESIZED = """(async () => {
  const figures = [...document.querySelectorAll(".figure")], end = performance.now() + 10000;
  const follows = (f) => Math.abs(f.querySelector(".main-svg").getBoundingClientRect().width - f.clientWidth) < 2;
  const late = () => performance.now() > end;
  while (!late() && !figures.every(follows)) await new Promise(requestAnimationFrame);
  window.addEventListener("beforeprint", () => {
    window.onPaper = figures.map((f) => f.querySelector(".main-svg").getBoundingClientRect().height);
  });
  return figures.filter((f) => !follows(f)).length;
})()"""
# What stays light on a dark screen: the page, its boxes, the charts.
_LIGHT = """(async () => {
  const light = (e) => {
    const [r, g, b, a = 1] = getComputedStyle(e).backgroundColor.match(/[\\d.]+/g).map(Number);
    return a > 0.5 && r + g + b > 384;
  };
  const found = () => [...document.querySelectorAll("body, .card, .main-svg")].filter(light);
  const end = performance.now() + 5000;
  while (found().length && performance.now() < end) await new Promise(requestAnimationFrame);
  return found().map((e) => e.getAttribute("class") || e.tagName);
})()"""
_PAPER = 1000  # px: an A4 page between its margins


def faults(browser: Browser, report: Path) -> list[str]:
    """What is wrong with a report, on a screen, on a phone and on paper; [] where nothing is."""
    wanted = report.read_text(encoding="utf-8").count("<div class=figure")
    found = []
    for width in (1300, 1081, 900, 400):
        browser.open(report, width)
        browser.value(_DRAW)
        seen = browser.value(_LOOK)
        drawn = sum(count > 0 for count in seen["marks"])
        told = [f"{drawn} of {wanted} charts are drawn"] if drawn != wanted else []
        told += [*seen["out"], *browser.complaints()]
        found += [f"{report.name} at {width} px: {fault}" for fault in told]
    if drawn == wanted:
        browser.resize(1000)
        stuck = browser.value(_RESIZED)
        found += [f"{report.name}: {stuck} charts do not follow the window's size"] if stuck else []
    browser.colours("dark")
    found += [f"{report.name}: light on a dark screen: {name}" for name in browser.value(_LIGHT)]
    browser.colours("light")
    words = words_per_page(browser.printed())
    high = [height for height in browser.value("window.onPaper || []") if height > _PAPER]
    found += [f"{report.name}: a chart of {height:.0f} px does not fit a page" for height in high]
    found += [f"{report.name}: printed page {k} of {len(words)} is blank" for k, n in enumerate(words, 1) if n == 0]
    return found


def words_per_page(pdf: bytes) -> list[int]:
    """How often text is shown on each page of a PDF that the browser has made, in the order of the pages."""
    objects = {
        int(number): body for number, body in re.findall(rb"^(\d+) 0 obj\n(.*?)\nendobj", pdf, re.MULTILINE | re.DOTALL)
    }
    counts = []
    for number, body in sorted(objects.items()):
        if not re.search(rb"/Type /Page\b", body):
            continue
        content = re.search(rb"/Contents (\d+) 0 R", body)
        assert content, f"page object {number} has no content: {body[:200]!r}"
        stream = objects[int(content[1])].split(b"stream\n", 1)[1].rsplit(b"\nendstream", 1)[0]
        counts.append(len(re.findall(rb"\bT[jJ]\b", zlib.decompress(stream))))
    return counts
