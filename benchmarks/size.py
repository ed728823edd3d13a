"""How large and how entangled the library is, at some revisions side by side: ``python benchmarks/size.py [REVISION ...]``.

Without a revision the working tree alone is measured. Lines are those of ``stablepush`` and ``planners``, blank ones included;
statements are those of Python's parser. Complexity is that of McCabe, as ruff counts it.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONSTANT = re.compile(r"^_?[A-Z][A-Z_0-9]*(, *_?[A-Z][A-Z_0-9]*)* *(: *[^=]+)?= *[(0-9.-]")
#: The folders that are the library.
FOLDERS = ("stablepush", "planners")


def sources(root: Path) -> list[Path]:
    return sorted(file for folder in FOLDERS for file in (root / folder).rglob("*.py"))


def functions(tree: ast.AST) -> Iterator[int]:
    """Lines of the functions of a file, docstrings and parameters included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield (node.end_lineno or node.lineno) - node.lineno + 1


def complex_functions(root: Path, most: int) -> int:
    """Functions above a complexity."""
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901", "--output-format", "json"]
    command += ["--config", f"lint.mccabe.max-complexity={most}", "--ignore-noqa", *FOLDERS]
    found = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return len(json.loads(found.stdout))


def constants(folder: Path) -> int:
    """Names of numbers that stand at the top of the files of a folder."""
    names = 0
    for file in folder.rglob("*.py"):
        for line in file.read_text(encoding="utf-8").split("\n"):
            if CONSTANT.match(line):
                names += len(line.partition("=")[0].partition(":")[0].split(","))
    return names


def mentions(root: Path, words: list[str]) -> float:
    """Mean number of files, but for those of the blind check, that mention a word in quotes."""
    texts = [file.read_text(encoding="utf-8") for file in sources(root) if "blind" not in file.parts]
    return sum(sum(f'"{word}"' in text for text in texts) for word in words) / len(words)


def measured(root: Path) -> dict[str, str]:
    files = sources(root)
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
    lines = sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)
    diagnosis = sorted((root / "stablepush" / "diagnosis").rglob("*.py"))
    effects = ["tilt", "drift", "latency", "force-bias", "frame-offset", "inertia", "speed-dependence", "pressure-spread"]
    lengths = [length for tree in trees for length in functions(tree)]
    return {
        "lines": str(lines),
        "statements": str(sum(isinstance(node, ast.stmt) for tree in trees for node in ast.walk(tree))),
        "files": str(len(files)),
        "lines of diagnosis": str(sum(len(file.read_text(encoding="utf-8").splitlines()) for file in diagnosis)),
        "files of diagnosis": str(len(diagnosis)),
        "functions above 60 lines": str(sum(length > 60 for length in lengths)),
        "functions above complexity 20": str(complex_functions(root, 20)),
        "functions above complexity 15": str(complex_functions(root, 15)),
        "named constants of diagnosis": str(constants(root / "stablepush" / "diagnosis")),
        "files that name an effect (mean of eight)": f"{mentions(root, effects):.1f}",
    }


def at(revision: str) -> dict[str, str]:
    """The figures of a revision."""
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", revision, *FOLDERS], cwd=ROOT, capture_output=True, check=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
        return measured(Path(folder))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revisions", nargs="*", help="revisions of git")
    names = parser.parse_args().revisions
    columns = [*map(at, names), measured(ROOT)]
    print(f"{'':<44s}" + "".join(f"{name[:12]:>14s}" for name in [*names, "now"]))
    for key in columns[0]:
        print(f"{key:<44s}" + "".join(f"{column[key]:>14s}" for column in columns))


if __name__ == "__main__":
    main()
