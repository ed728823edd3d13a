"""Limits of the code that the linter does not know: how long a function may be, and what a constant must say."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
if not (ROOT / "stablepush").is_dir():
    pytest.skip("the sources are not here: an installed package is tested", allow_module_level=True)
FILES = sorted([*(ROOT / "stablepush").rglob("*.py"), *(ROOT / "planners").rglob("*.py")])
#: Lines of a function, without its docstring and its parameters: more than that is read twice.
LONGEST = 60
#: What is compiled runs slower in parts.
KERNELS = ("compiled", "inner", "inlined")


def functions(file):
    """Functions of a file, with the lines of their bodies."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if any(ast.unparse(decorator).startswith(KERNELS) for decorator in node.decorator_list):
            continue
        body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
        if body:
            yield node.name, node.end_lineno - body[0].lineno + 1


def test_no_function_is_long():
    long = [f"{file.relative_to(ROOT)}: {name}: {lines}" for file in FILES for name, lines in functions(file) if lines > LONGEST]
    assert not long


ASSIGNED = re.compile(r"^_?[A-Z][A-Z_0-9]*(, *_?[A-Z][A-Z_0-9]*)* *(: *[^=]+)?= ")
CONSTANT = re.compile(r"^_?[A-Z][A-Z_0-9]*(, *_?[A-Z][A-Z_0-9]*)* *(: *[^=]+)?= *[(0-9.-]")


@pytest.mark.parametrize("room", ["diagnosis", "effects"])
def test_constants_say_what_they_are(room):
    """A number that decides stands under a comment that says what it is, in which unit, and why."""
    bare = []
    for file in (ROOT / "stablepush" / room).rglob("*.py"):
        lines = file.read_text(encoding="utf-8").split("\n")
        for number, line in enumerate(lines[1:], start=1):
            block = lines[:number]
            while block and ASSIGNED.match(block[-1]):
                block.pop()
            if CONSTANT.match(line) and not (block and block[-1].startswith("#")):
                bare.append(f"{file.relative_to(ROOT)}:{number + 1}: {line}")
    assert not bare
