"""Every example runs alone, from any folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import stablepush as sp

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


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
    assert done.stdout.strip()
    assert done.stderr == ""


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path):
    run(path, [], tmp_path)


@pytest.mark.parametrize("name", STUDIES)
def test_study(name, tmp_path):
    arguments, files = STUDIES[name]
    run(EXAMPLES[0].parent / "paper" / name, arguments, tmp_path)
    assert sorted(f.name for f in (tmp_path / "paper").iterdir()) == files


def test_the_readme_s_python_runs(tmp_path):
    """All blocks, one after the other, in a folder in which the demo has run."""
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    block = "\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL))
    from stablepush.demo import demo_pokes

    sp.write_pushlog(demo_pokes(), tmp_path / "stablepush-demo" / "pokes")
    (tmp_path / "block.py").write_text(block, encoding="utf-8")
    run(tmp_path / "block.py", [], tmp_path)
