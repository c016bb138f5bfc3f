"""Show a picture in a terminal with sixel or kitty graphics (textual-image, the extra ``terminal``)."""

from __future__ import annotations

import io
import os
import sys

INSTALL = "pip install 'pneucli[terminal]'"


def show_picture(png: bytes) -> str:
    """Show a PNG on standard output; return the reason where that is not possible, else nothing."""
    if not (sys.stdout.isatty() and sys.stdin.isatty()) or os.environ.get("TERM") == "dumb":
        return "standard output is no terminal"
    try:
        from rich.console import Console
        from textual_image.renderable import Image, SixelImage, TGPImage
    except ImportError:
        return f"pictures in a terminal need the extra terminal: {INSTALL}"
    if Image not in (SixelImage, TGPImage):
        return "this terminal shows no pictures (neither sixel nor kitty graphics)"
    Console().print(Image(io.BytesIO(png), width="auto"))
    return ""
