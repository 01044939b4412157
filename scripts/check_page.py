#!/usr/bin/env python3
"""Opens a page of `dualight accuracy` in headless Chromium, without a network, and looks at it:

    scripts/check_page.py page.html [screenshot.png]

Status 1 if the console shows an error, something is loaded from elsewhere, or a plot or a picture
is missing, broken or invisible. Needs playwright (pip install playwright) and a Chromium: that of
the path, or playwright's own.
"""
import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

# What is seen of each plot and picture, after the slider and the choice have been used.
LOOK = """() => {
  const box = e => { const r = e.getBoundingClientRect(); return [r.width, r.height]; };
  const images = [...document.querySelectorAll('img')], plots = [...document.querySelectorAll('svg')];
  return {
    images: images.map(i => ({ id: i.id, ok: i.complete && i.naturalWidth > 0, size: box(i) })),
    plots: plots.map(p => ({ id: p.querySelector('title').textContent, size: box(p),
                             ok: p.querySelectorAll('circle').length > 0 })),
    wide: document.documentElement.scrollWidth > innerWidth,
    clip: document.getElementById('over').style.clipPath,
  };
}"""


def look(page, path):
    """Everything that is wrong with a page."""
    wrong = []
    page.on("console", lambda m: m.type == "error" and wrong.append(f"console: {m.text}"))
    page.on("pageerror", lambda e: wrong.append(f"script: {e}"))
    page.on("request", lambda r: r.url.startswith(("file:", "data:"))
            or wrong.append(f"loads {r.url}"))
    page.goto(path.resolve().as_uri())
    page.locator("#right").select_option(index=2)
    page.locator("#slider").fill("30")
    seen = page.evaluate(LOOK)
    for kind, fewest in (("images", 5), ("plots", 3)):
        if len(seen[kind]) < fewest:
            wrong.append(f"{len(seen[kind])} {kind}, less than {fewest}")
        for e in seen[kind]:
            if not e["ok"] or min(e["size"]) < 50:
                wrong.append(f"{kind}: {e['id']} is not to be seen: {e}")
    if seen["wide"]:
        wrong.append("the page is wider than its window")
    if "70%" not in seen["clip"]:
        wrong.append(f"the slider does not cut: {seen['clip']}")
    return wrong


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1200, "height": 900}, offline=True)
        wrong = look(page, Path(sys.argv[1]))
        if len(sys.argv) == 3:
            page.screenshot(path=sys.argv[2], full_page=True)
        browser.close()
    for line in wrong:
        print(f"{sys.argv[1]}: {line}", file=sys.stderr)
    sys.exit(1 if wrong else 0)


main()
