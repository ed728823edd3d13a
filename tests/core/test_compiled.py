"""Machine code that is kept on disk."""

import pickle
import sys
from importlib import import_module

import pytest

SOURCE = """
from stablepush.core import compiled


@compiled
def twice(x):
    return 2 * x
"""


@pytest.mark.parametrize("index", [b"", b"no pickle", pickle.dumps("1")[:-1], b"cstablepush.core\nNoSuchType\n."])
def test_an_index_that_cannot_be_read_is_built_again(tmp_path, monkeypatch, index):
    """As after an upgrade: numba's index of the version before may hold types that are gone."""
    (tmp_path / "kept_code.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    for _ in range(2):
        sys.modules.pop("kept_code", None)
        assert import_module("kept_code").twice(3.0) == 6.0
        kept = list(tmp_path.rglob("*.nbi"))
        if not kept:
            pytest.skip("compiling is turned off")
        head = pickle.dumps(pickle.loads(kept[0].read_bytes()))
        kept[0].write_bytes(head + index)
    sys.modules.pop("kept_code", None)
