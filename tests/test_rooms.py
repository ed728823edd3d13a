"""The house: what a room shows stands in its stub, and the others use no more than that."""

import ast
import importlib
from pathlib import Path

import pytest

import stablepush as sp

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "stablepush"
if not PACKAGE.is_dir():
    pytest.skip("the sources are not here: an installed package is tested", allow_module_level=True)
ROOMS = sorted(stub.parent for stub in PACKAGE.rglob("__init__.pyi"))


def dotted(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("room", ROOMS, ids=dotted)
def test_every_name_of_a_stub_is_there(room):
    module = importlib.import_module(dotted(room))
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None
    assert len((module.__doc__ or "").splitlines()) >= (
        1 if room.name in ("kernels", "importers", "plot") or room == PACKAGE else 3
    )


def imports(file):
    """Modules of the library and names that a file imports from them."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "stablepush":
            for alias in node.names:
                yield node.module, alias.name


def faces():
    """Names that each room shows; a module of a room without a stub shows none."""
    return {dotted(room): set(importlib.import_module(dotted(room)).__all__) for room in ROOMS}


def test_other_rooms_and_planners_import_what_a_room_shows():
    shown = faces()
    others = []
    for file in [*PACKAGE.rglob("*.py"), *(ROOT / "planners").rglob("*.py")]:
        own = dotted(file).split(".")[1] if file.is_relative_to(PACKAGE) and file.parent != PACKAGE else None
        for module, name in imports(file):
            room = module.split(".")[1] if "." in module else None
            if room in (None, own, "demo") or file == PACKAGE / "__main__.py":
                continue
            if name not in shown.get(module, ()):
                others.append(f"{dotted(file)}: {module}.{name}")
    assert not others


def test_public_names_are_loaded_on_first_use():
    """No module of the library is loaded by ``import stablepush`` itself."""
    import subprocess
    import sys

    code = "import sys, stablepush; print([m for m in sys.modules if m.startswith(('stablepush.', 'numpy'))])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no_such_name"):
        sp.no_such_name  # noqa: B018
