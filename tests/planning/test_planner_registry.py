"""Planners that other packages register."""

import pytest
from conftest import small_scene

import stablepush as sp
from stablepush.planning import registry


@pytest.mark.parametrize(
    ("registered", "words"),
    [
        (lambda problem: None, r"planner mine: expected a function f\(problem, \*, deadline, seed, options, progress\)"),
        (
            lambda problem, *, deadline, seed, options, progress: None,
            "planner mine: expected it to return a PlanResult, got NoneType",
        ),
        (3, "planner mine: expected a function"),
        (
            lambda problem, *, deadline, seed, options, progress: problem.nothing,
            "planner mine: it failed by AttributeError: 'PlanningProblem' object has no attribute 'nothing' "
            r"\(test_planner_registry.py, line \d+, in <lambda>\)",
        ),
    ],
)
def test_what_is_registered_as_a_planner_and_is_none_is_said(monkeypatch, registered, words):
    monkeypatch.setattr(registry, "load_plugin", lambda group, name: registered)
    with pytest.raises(sp.UnavailableError, match=words):
        sp.plan(small_scene(), "mine")


def test_a_planner_that_asks_another_is_the_author(monkeypatch):
    load = registry.load_plugin
    inner = lambda problem, *, deadline, seed, options, progress: sp.plan(problem, seed=seed)  # noqa: E731
    monkeypatch.setattr(registry, "load_plugin", lambda group, name: inner if name == "mine" else load(group, name))
    result = sp.plan(small_scene(), "mine")
    assert result.solved and result.planner == "mine"
