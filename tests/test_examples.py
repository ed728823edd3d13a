"""Every example runs alone, from any folder, and so does the Python of README and documentation."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import stablepush as sp

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples" / "gallery").glob("*.py"))


#: Studies that need no data, cut short, and the files that they leave.
STUDIES = {
    "figure3.py": (["--trials", "2", "--cases", "ring_noise_free"], ["figure3.json", "figure3.png"]),
    "online.py": (["--streams", "2"], ["online.json", "online.png"]),
}


def run(path, arguments, folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(path), *arguments],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path):
    run(path, [], tmp_path)
    pictures = list(tmp_path.glob("*.png"))
    assert len(pictures) == 1 and pictures[0].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", STUDIES)
def test_study(name, tmp_path):
    arguments, files = STUDIES[name]
    assert run(ROOT / "examples" / "paper" / name, arguments, tmp_path).strip()
    assert sorted(f.name for f in (tmp_path / "paper").iterdir()) == files


def test_the_readme_s_python_runs(tmp_path):
    """All blocks, one after the other, in a folder in which the demo has run."""
    from stablepush.demo import demo_pokes

    sp.write_pushlog(demo_pokes(), tmp_path / "stablepush-demo" / "pokes")
    assert blocks("README.md", tmp_path).strip()


@pytest.mark.parametrize("page", ["tutorial.md", "robot.md", "choosing.md"])
def test_a_page_s_python_runs(page, tmp_path):
    assert blocks(Path("docs") / page, tmp_path).strip()


def blocks(page, folder):
    """Output of the Python blocks of a page, one after the other."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert found
    (folder / "block.py").write_text("\n".join(found), encoding="utf-8")
    return run(folder / "block.py", [], folder)


def test_the_reference_has_every_public_name():
    text = (ROOT / "docs" / "api.rst").read_text(encoding="utf-8")
    listed = re.findall(r":: stablepush\.(\w+)$", text, flags=re.MULTILINE)
    assert sorted(listed) == sorted(set(sp.__all__))


def test_the_picture_of_the_architecture_is_true():
    """Every module is in it, and imports within the package go to the same group or further down."""
    picture = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    place, row = {}, -1
    for kind, text in re.findall(r'class="(group|name)">([\w, /]+)<', picture):
        row += kind == "group"
        place[text] = row
    package = Path(sp.__file__).parent
    modules = {p.stem: p for p in package.iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()}
    public = {name for name in modules if not name.startswith("_")}
    assert public <= set(place)
    for name in public:
        files = [modules[name]] if modules[name].is_file() else modules[name].rglob("*.py")
        for file in files:
            for other in re.findall(r"^ *from stablepush\.(\w+)[\w.]* import", file.read_text(encoding="utf-8"), re.MULTILINE):
                if other in public:
                    assert place[name] <= place[other], f"{name} imports {other}"
