import numpy as np
import pytest
import shapely

import stablepush as sp

MAP = "type octile\nheight 4\nwidth 6\nmap\n......\n.@@T..\n.@@..W\nS..G@@\n"


def test_rectangles_cover_the_blocked_cells(tmp_path):
    path = tmp_path / "small.map"
    path.write_text(MAP)
    obstacles, bounds = sp.load_movingai_map(path, 0.5)
    assert bounds == (0, 0, 3, 2)
    rows = MAP.split("map\n")[1].splitlines()
    blocked = shapely.union_all([shapely.Polygon(o) for o in obstacles])
    for k, row in enumerate(rows):
        for j, sign in enumerate(row):
            center = shapely.Point((j + 0.5) * 0.5, (len(rows) - k - 0.5) * 0.5)
            assert shapely.contains(blocked, center) == (sign in "@TW")
    assert sum(shapely.Polygon(o).area for o in obstacles) == pytest.approx(blocked.area)
    assert len(obstacles) < sum(sign in "@TW" for row in rows for sign in row)


@pytest.mark.parametrize("seed", range(3))
def test_random_maps(tmp_path, seed):
    rng = np.random.default_rng(seed)
    grid = rng.random((17, 23)) < 0.4
    path = tmp_path / "random.map"
    path.write_text(
        "type octile\nheight 17\nwidth 23\nmap\n" + "\n".join("".join("@" if b else "." for b in row) for row in grid)
    )
    obstacles, _ = sp.load_movingai_map(path, 1.0)
    assert sum(shapely.Polygon(o).area for o in obstacles) == grid.sum()


@pytest.mark.parametrize(
    ("text", "words"),
    (
        ("", "line 1: expected 'type'"),
        ("type octile\nheight x\n", "line 2"),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n", "expected 2 rows"),
        ("type octile\nheight 1\nwidth 3\nmap\n..\n", "line 5: expected 3 cells"),
        ("type octile\nheight 1\nwidth 3\nmap\n.?.\n", "line 5: column 2"),
    ),
)
def test_bad_maps_are_named(tmp_path, text, words):
    path = tmp_path / "bad.map"
    path.write_text(text)
    with pytest.raises(sp.InputError, match=words) as error:
        sp.load_movingai_map(path, 0.1)
    assert str(path) in str(error.value)
    with pytest.raises(sp.InputError):
        sp.load_movingai_map(tmp_path / "none.map", 0.1)
