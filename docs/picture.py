"""The README's picture: fuel of every strategy and its bound, from the page that `hevopt compare --report` makes.

    python docs/picture.py

Opens the page in Chromium or Chrome and writes docs/picture.png.
"""

import io
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "picture.png"
WIDTH, COLOURS = 1100, 64


def picture_of(page: Page) -> bytes:
    """The figure of fuel and bounds on an opened page of a comparison, as a small PNG."""
    whole = Image.open(io.BytesIO(page.locator("#figure-fuel-bars").screenshot()))
    small = io.BytesIO()
    whole.convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    return small.getvalue()


def main() -> None:
    """Make the page and the picture."""
    sys.path.insert(0, str(ROOT / "tests"))
    from page_helpers import FLAGS, find_browser

    with tempfile.TemporaryDirectory(prefix="hevopt-") as folder, sync_playwright() as playwright:
        made = Path(folder) / "page.html"
        subprocess.run(
            [sys.executable, "-m", "hevopt.cli", "compare", "--report", made], check=True
        )
        browser = playwright.chromium.launch(executable_path=find_browser(), args=FLAGS)
        page = browser.new_page(
            viewport={"width": WIDTH, "height": 800}, color_scheme="light", device_scale_factor=1
        )
        page.goto(made.as_uri())
        page.wait_for_selector("html[data-drawn]", state="attached", timeout=120_000)
        OUT.write_bytes(picture_of(page))
        browser.close()
    print(f"written to {OUT}")


if __name__ == "__main__":
    main()
