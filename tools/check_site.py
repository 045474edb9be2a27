"""Look at pages of the built site as axe-core does, in light and dark, on a desk and on a phone.

Fails where a page has a violation or is wider than its window. Needs Chromium, and is left out
without it.
"""

import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from selenium.webdriver import Chrome

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from support.browser import DEVICES, SCHEMES, sideways_px, start_chromium, view, violations  # noqa: E402

#: The front page, a tutorial, a notebook, pages with wide pictures and tables, a generated one.
PAGES = (
    "index.html",
    "docs/tutorials/own_recording.html",
    "docs/tutorials/recording_to_report.html",
    "docs/runtime.html",
    "reference/commands.html",
)


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


def faults(site: Path, pages: Sequence[str] = PAGES) -> list[str]:
    """A sentence for each violation."""
    found = []
    handler = partial(_Quiet, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, ExitStack() as ends:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        ends.callback(server.shutdown)
        for scheme in SCHEMES:  # each with a browser of its own: the theme keeps the scheme
            browser = start_chromium(Path(ends.enter_context(tempfile.TemporaryDirectory())))
            ends.callback(browser.quit)
            found += _faults_in(browser, server.server_port, pages, scheme)
    return found


def _faults_in(browser: Chrome, port: int, pages: Sequence[str], scheme: str) -> list[str]:
    """Of all pages in one scheme; SERD_PICTURES=FOLDER keeps pictures of them there."""
    found = []
    for page in pages:
        for width, height in DEVICES:
            view(browser, width=width, height=height, scheme=scheme)
            browser.get(f"http://127.0.0.1:{port}/{page}")
            where = f"{page}, {scheme}, {width} pixels wide"
            if "SERD_PICTURES" in os.environ:
                name = f"site_{Path(page).stem}_{scheme}_{width}.png"
                browser.save_screenshot(f"{os.environ['SERD_PICTURES']}/{name}")
            if sideways_px(browser):
                found.append(f"{where}: wider than its window by {sideways_px(browser)} pixels")
            for rule, elements in violations(browser):
                found.append(f"{where}: {rule} at {len(elements)} elements, first {elements[0]}")
    return found


def main() -> int:
    """Entry point."""
    if not shutil.which("chromedriver"):
        print("site: not looked at, for there is no Chromium (apt-get install chromium-driver)")
        return 0
    if found := faults(ROOT / "site"):
        print(*found, sep="\n", file=sys.stderr)
    else:
        n_looks = len(PAGES) * len(SCHEMES) * len(DEVICES)
        print(f"site: axe finds no violation in {n_looks} looks at {len(PAGES)} pages")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
