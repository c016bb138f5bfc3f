"""What the site adds to the pages: README and changelog, and formulas as MathML, for which nothing is fetched."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
TAKEN = {"README.md": "readme.md", "CHANGELOG.md": "changelog.md"}
_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
_FORMULA = re.compile(r"\$\$(.+?)\$\$|(?<![\w$])\$([^$\n]+?)\$(?![\w$])", re.DOTALL)


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Take in the pages beside the folder, with their links as they are seen from within."""
    for name, page in TAKEN.items():
        text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](").replace("](LICENSE)", "](#)")
        text = text.replace("](CHANGELOG.md)", "](changelog.md)")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn formulas into MathML, and links to pages beside the folder into links within the site."""
    for name, page in TAKEN.items():
        markdown = markdown.replace(f"](../{name})", f"]({page})")
    parts = _CODE.split(markdown)
    return "".join(part if i % 2 else _FORMULA.sub(_mathml, part) for i, part in enumerate(parts))


def _mathml(found: re.Match[str]) -> str:
    return convert((found[1] or found[2]).strip(), display="block" if found[1] else "inline")
