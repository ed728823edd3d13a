"""Makes the pictures of the pages from the examples of the gallery: ``python docs/pictures.py``.

They are kept in the repository, so that the pages are readable there, too.
"""

from __future__ import annotations

import io
import os
import re
import runpy
import tempfile
from pathlib import Path

from PIL import Image

from stablepush.views.plot.canvas import figure_png

DOCS = Path(__file__).parent
GALLERY = DOCS.parent / "examples" / "gallery"
#: Colours that a picture keeps: lines stay smooth, and files small.
_COLOURS = 128


def shown() -> list[str]:
    """Return the names of the gallery's pictures that pages show."""
    pages = "".join(page.read_text(encoding="utf-8") for page in sorted(DOCS.glob("*.md")))
    return sorted(set(re.findall(r"\(pictures/(\w+)\.png\)", pages)))


def make(name: str) -> None:
    """Run the example ``plot_N_name.py`` and keep its figure."""
    (example,) = GALLERY.glob(f"plot_?_{name}.py")
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        # the example writes its own picture beside it
        os.chdir(folder)
        figure = runpy.run_path(str(example))["figure"]
        os.chdir(here)
    picture = Image.open(io.BytesIO(figure_png(figure))).convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
    path = DOCS / "pictures" / f"{name}.png"
    path.parent.mkdir(exist_ok=True)
    picture.save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    for each in shown():
        make(each)
