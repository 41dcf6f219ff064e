"""Makes the pages: draws the pictures, writes the reference, and with --html a folder to read without a network.

./boom python docs/build.py                     pictures and reference, in their places
./boom python docs/build.py --check             exit status 1 if they are not up to date
./boom python docs/build.py --html output/docs  all pages as HTML
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import notebook
import pictures
import reference_pages
from markdown_it import MarkdownIt

from boom_report.page import style

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
_LAYOUT = """
main { max-width: 900px; } main img { max-width: 100%; height: auto; } table { display: block; overflow-x: auto; }
pre { overflow-x: auto; padding: 10px 12px; background: var(--paper); border: 1px solid var(--line); border-radius: 6px; }
"""


def made(skip: frozenset[str] = frozenset()) -> Iterator[tuple[Path, str]]:
    """The files that are made, and what they have to hold; without the pictures of these names."""
    yield DOCS / "tutorial.ipynb", notebook.notebook()
    for name, draw in pictures.ALL.items():
        if name not in skip:
            yield DOCS / "pictures" / f"{name}.svg", draw()
    for name, page in reference_pages.PAGES.items():
        yield DOCS / "reference" / f"{name}.md", page().rstrip() + "\n"


def pages() -> list[Path]:
    """All pages of the documentation."""
    return [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
        *sorted(DOCS.rglob("*.md")),
        *sorted((ROOT / "src").glob("*/README.md")),
        *sorted(ROOT.glob("[!.]*/README.md")),
    ]


def write_html(target: Path) -> None:
    """Write all pages as HTML below `target`, with the pictures, and links between them."""
    reader = MarkdownIt("commonmark", {"html": True}).enable("table")
    for page in pages():
        text = reader.render(page.read_text("utf-8"))
        text = re.sub(r"<h([1-6])>(.*?)</h\1>", _anchored, text)
        text = re.sub(r'href="([^":]+)\.md([#"])', r'href="\1.html\2', text)
        file = target / page.relative_to(ROOT).with_suffix(".html")
        file.parent.mkdir(parents=True, exist_ok=True)
        title = re.search(r"^# (.*)$", page.read_text("utf-8"), re.MULTILINE)
        file.write_text(
            f"<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport content='width=device-width, "
            f"initial-scale=1'><meta name=color-scheme content='light dark'><title>{title[1] if title else page.stem}</title>"
            f"<style>{style()}{_LAYOUT}</style></head><body><main>{text}</main></body></html>\n", "utf-8",
        )  # fmt: skip
    for picture in DOCS.rglob("*.svg"):
        copy = target / picture.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(picture, copy)


def _anchored(heading: re.Match[str]) -> str:
    words = re.sub(r"<[^>]+>", "", heading[2])
    name = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
    return f'<h{heading[1]} id="{name}">{heading[2]}</h{heading[1]}>'


def main() -> int:
    """Make the pages, or check them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing: exit status 1 if a file is not up to date")
    parser.add_argument("--html", type=Path, metavar="FOLDER", help="also write all pages as HTML here")
    args = parser.parse_args()
    # Another processor's last digits may move a line of the simulated picture by a tenth of a pixel.
    skip = pictures.SIMULATED if args.check else frozenset()
    stale = [(path, text) for path, text in made(skip) if not path.is_file() or path.read_text("utf-8") != text]
    for path, text in stale:
        if not args.check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
        said = " is not up to date: ./boom python docs/build.py" if args.check else ""
        print(f"{path.relative_to(ROOT)}{said}")
    if args.html:
        write_html(args.html)
        print(args.html / "docs" / "index.html")
    return 1 if args.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
