"""Draw ``architecture.svg`` from the layers of the import rules in ``pyproject.toml``: ``python docs/architecture.py``."""

import ast
import textwrap
import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
WIDTH, GAP, PADDING, LINE, CHARACTER = 1000, 10, 10, 17, 6.8
COLOURS = ("#fde8d7", "#fbe3ea", "#e6effb", "#e4f4ea", "#f3ecfa")
STYLE = """<style>
  .room { font: bold 14px sans-serif; fill: #222222; }
  .purpose { font: 12px sans-serif; fill: #222222; }
  .modules { font: 11px monospace; fill: #444444; }
</style>"""


def layers(contracts: list[dict], container: str) -> list[list[str]]:
    """Return the layers of a package, highest first, each the names of its modules."""
    contract = next(c for c in contracts if c.get("containers") == [container])
    return [layer.replace(":", "|").replace(" ", "").split("|") for layer in contract["layers"]]


def purpose(room: str) -> str:
    """Return the first sentence of a room's docstring."""
    folder = ROOT / "stablepush" / room
    file = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")[0].replace("``", "").replace("\n", " ")


def filled(text: str, kind: str, width: float) -> list[tuple[str, str]]:
    """Fill lines of a width in pixels; each comes with its class of text."""
    return [(kind, line) for line in textwrap.wrap(text, int(width / CHARACTER), break_on_hyphens=False)]


def picture(contracts: list[dict]) -> str:
    """Return the picture as SVG: one row a layer, one box a room, in it what lives there and its modules."""
    packages = {c["containers"][0] for c in contracts if c["type"] == "layers"}
    shapes, y = [], GAP
    rows = [rooms for rooms in layers(contracts, "stablepush") if rooms != ["__main__"]]
    for row, rooms in enumerate(rows):
        width = (WIDTH - GAP * (len(rooms) + 1)) / len(rooms)
        texts = []
        for room in rooms:
            names = layers(contracts, f"stablepush.{room}") if f"stablepush.{room}" in packages else []
            modules = [f"{m}/" if f"stablepush.{room}.{m}" in packages else m for layer in names for m in layer]
            inside = width - 2 * PADDING
            texts.append(
                [("room", room), *filled(purpose(room), "purpose", inside), *filled(" ".join(modules), "modules", inside)]
            )
        height = 2 * PADDING + LINE * max(len(lines) for lines in texts)
        for column, lines in enumerate(texts):
            x = GAP + column * (width + GAP)
            place = f'x="{x:g}" y="{y}" width="{width:g}" height="{height}"'
            shapes.append(f'<rect {place} rx="6" fill="{COLOURS[row % len(COLOURS)]}"/>')
            for number, (kind, line) in enumerate(lines):
                place = f'x="{x + PADDING:g}" y="{y + PADDING + 12 + LINE * number}"'
                shapes.append(f'<text {place} class="{kind}">{escape(line)}</text>')
        y += height + GAP
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y}" role="img"'
    return "\n".join([f'{head} aria-label="the rooms of stablepush: imports go down">', STYLE, *shapes, "</svg>", ""])


def main() -> None:
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    (ROOT / "docs" / "architecture.svg").write_text(picture(rules), encoding="utf-8")


if __name__ == "__main__":
    main()
