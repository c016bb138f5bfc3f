"""Check the pages and build the site: ``python docs/build_site.py`` (``make site``); ``--check`` only checks.

Three faults abort: a link to no file, a link to no heading, a page in no menu. Zensical then builds the site from
``build/pages``: README and changelog among the other pages, and formulas as MathML, for which nothing is fetched.
"""

import re
import shutil
import subprocess
import sys
import tomllib
import unicodedata
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

TAKEN = {"README.md": "readme.md", "CHANGELOG.md": "changelog.md"}
OUTSIDE_MENU = "effects/"  # one page an effect: effects.md lists them
_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
_FORMULA = re.compile(r"\$\$(.+?)\$\$|(?<![\w$])\$([^$\n]+?)\$(?![\w$])", re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)")


def faults(root: Path) -> list[str]:
    """Return every dead link, dead anchor and page without a menu entry of the repository at ``root``."""
    docs = root / "docs"
    pages = [*(root / name for name in TAKEN), *sorted(docs.rglob("*.md"))]
    found = [fault for page in pages for fault in _dead_links(root, page)]
    menu = set(_entries(tomllib.loads((root / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"]))
    here = {page.relative_to(docs).as_posix() for page in pages if docs in page.parents} | set(TAKEN.values())
    found += [f"docs/{page}: in no menu of zensical.toml" for page in sorted(here - menu) if OUTSIDE_MENU not in page]
    return found + [f"zensical.toml: no page docs/{page}" for page in sorted(menu - here)]


def _dead_links(root: Path, page: Path) -> Iterator[str]:
    for link in _LINK.findall(_prose(page)):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if re.match(r"[a-z]+:", link):
            continue
        if not target.exists():
            yield f"{page.relative_to(root)}: dead link {link}"
        elif anchor and target.suffix == ".md" and anchor not in anchors(target.read_text(encoding="utf-8")):
            yield f"{page.relative_to(root)}: dead anchor {link}"


def _prose(page: Path) -> str:
    """Return a page without code and formulas."""
    return _FORMULA.sub("", _CODE.sub("", page.read_text(encoding="utf-8")))


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as Python-Markdown makes them."""
    seen: set[str] = set()
    for heading in re.findall(r"^#+ (.+?)\s*#*$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
        plain = unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode()
        slug = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower())
        name, number = slug, 0
        while name in seen:
            number += 1
            name = f"{slug}_{number}"
        seen.add(name)
    return seen


def _entries(menu: Any) -> Iterator[str]:
    """Yield the pages of a menu."""
    if isinstance(menu, str):
        yield menu
    else:
        for item in menu.values() if isinstance(menu, dict) else menu:
            yield from _entries(item)


def prepare(root: Path, pages: Path) -> None:
    """Write the pages of the site to the folder ``pages``."""
    shutil.rmtree(pages, ignore_errors=True)
    shutil.copytree(root / "docs", pages, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    shutil.copytree(root / "docs" / "examples", pages / "examples", dirs_exist_ok=True)
    for name, page in TAKEN.items():
        text = (root / name).read_text(encoding="utf-8").replace("](docs/", "](").replace("](LICENSE)", "](#)")
        (pages / page).write_text(text.replace("](CHANGELOG.md)", "](changelog.md)"), encoding="utf-8")
    for file in pages.rglob("*.md"):
        file.write_text(_converted(file.read_text(encoding="utf-8")), encoding="utf-8")


def _converted(text: str) -> str:
    """Turn formulas into MathML, and links to pages outside the folder into links within the site."""
    for name, page in TAKEN.items():
        text = text.replace(f"](../{name})", f"]({page})").replace(f"](../../{name})", f"](../{page})")
    parts = _CODE.split(text)
    return "".join(part if i % 2 else _FORMULA.sub(_mathml, part) for i, part in enumerate(parts))


def _mathml(found: re.Match[str]) -> str:
    """Return a formula as MathML; in a span, since Markdown takes a line that begins with it for a block."""
    convert = import_module("latex2mathml.converter").convert  # the checks do without it
    if found[1]:
        return str(convert(found[1].strip(), display="block"))
    return f"<span>{convert(found[2].strip(), display='inline')}</span>"


def main(root: Path, *, check_only: bool) -> int:
    """Check, prepare and build; return the exit code."""
    if found := faults(root):
        print("\n".join(found), file=sys.stderr)
        return 1
    if check_only:
        return 0
    prepare(root, root / "build" / "pages")
    build = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    run = subprocess.run(build, cwd=root, check=False, capture_output=True, text=True)
    if run.returncode:
        print(run.stdout + run.stderr, file=sys.stderr)
    return run.returncode


if __name__ == "__main__":
    sys.exit(main(Path(__file__).parents[1], check_only="--check" in sys.argv[1:]))
