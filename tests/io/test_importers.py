"""An importer of another laboratory's logs is one class and one entry point."""

from types import SimpleNamespace

import pytest
from conftest import make_log, one_line, small_scene

import stablepush as sp
from stablepush.cli import main
from stablepush.core import plugins
from stablepush.io.importers import Source, find_sources, import_source, registry


class OneNumber:
    """Logs that hold the number of their pushes."""

    def find(self, root):
        files = [root] if root.is_file() else sorted(root.rglob("*.number"))
        return [Source("one-number", file, file.stem, {}) for file in files if file.suffix == ".number"]

    def read(self, source, slider):
        log = make_log(count=int(source.file.read_text(encoding="utf-8")))
        return log, ["all of it is made up"]


@pytest.fixture
def installed(monkeypatch, tmp_path):
    entry = SimpleNamespace(name="one-number", load=OneNumber)
    monkeypatch.setattr(plugins, "entry_points", lambda group, name="": [entry])
    for name in ("b", "a"):
        (tmp_path / f"{name}.number").write_text("16", encoding="utf-8")
    return tmp_path


def test_it_is_found_and_read(installed):
    sources = find_sources(installed)
    assert [source.name for source in sources] == ["a", "b"]
    log, notes = import_source(sources[0])
    assert isinstance(log, sp.PushLog)
    assert notes == ["all of it is made up"]


def test_the_program_takes_it(installed, capsys):
    assert main(["import", str(installed), "--kind", "one-number", "-o", str(installed / "logs")]) == 0
    assert len(sp.read_pushlog(installed / "logs" / "a")) == 16
    capsys.readouterr()
    command = ["import", installed, "--kind", "other", "-o", installed / "more"]
    one_line(capsys, command, "--kind: expected one-number, got 'other'")


def test_a_package_that_is_broken_is_one_line_and_no_one_elses_trouble(monkeypatch, tmp_path, capsys):
    def broken():
        raise ModuleNotFoundError("No module named 'gone'")

    entry = SimpleNamespace(name="broken", load=broken, dist=None, module="gone")
    kept = plugins.entry_points

    def entry_points(group, name=""):
        found = list(kept(group=group))
        return [e for e in (*found, entry) if name in ("", e.name)]

    monkeypatch.setattr(plugins, "entry_points", entry_points)
    assert "broken" in registry.importers()
    one_line(capsys, ["import", tmp_path, "--kind", "broken", "-o", tmp_path / "more"], "broken", "gone", "cannot be loaded")
    # who does not ask for it has no trouble by it
    left_out = pytest.warns(sp.StablepushWarning, match="left out: stablepush.importers: broken of the package gone")
    with left_out, pytest.raises(sp.InputError, match="expected a raw log of kind"):
        registry.find_sources(tmp_path)
    assert sp.plan(small_scene(), refinement_budget=0).solved
    with pytest.raises(sp.UnavailableError, match="broken of the package gone"):
        sp.plan(small_scene(), "broken")


def test_the_library_has_the_manipulation_labs():
    assert {"mlab-poke", "mlab-stable"} <= set(registry.importers())


@pytest.mark.parametrize("method", ["find", "read"])
def test_an_importer_that_fails_is_named_with_its_line(monkeypatch, tmp_path, capsys, method):
    class Failing:
        def find(self, root):
            if method == "find":
                raise ValueError("no such row")
            return [registry.Source("mine", root, "log", {})]

        def read(self, source, slider):
            raise ValueError("no such row")

    # what is loaded is kept by its name
    entry = SimpleNamespace(name=f"mine-{method}", load=Failing, dist=None, module="mine")
    kept = plugins.entry_points
    monkeypatch.setattr(
        plugins, "entry_points", lambda group, name="": [e for e in (*kept(group=group), entry) if name in ("", e.name)]
    )
    words = f"importer {entry.name}: it failed by ValueError: no such row (test_importers.py, line"
    one_line(capsys, ["import", tmp_path, "--kind", entry.name, "-o", tmp_path / "more"], words, f"in {method}")
