"""Work that grows with the number of contacts asks for the time at each of them: limits hold for hundreds."""

import numpy as np
import pytest
from conftest import small_scene, triangle
from stablepush_planners.context import PlanningContext

import stablepush as sp
from stablepush.core import Deadline, OutOfTimeError
from stablepush.planning.chance.scenario_choice import Choice


def many(count):
    places = np.linspace(0.03, 0.12, count)
    contacts = [sp.PushContact.on_edge(triangle(), 0, place, 0.03, 0.9) for place in places]
    return small_scene(contacts=contacts, obstacles=(), pusher=None)


class Counted(Deadline):
    """Passes after so many questions."""

    def __init__(self, most):
        super().__init__()
        self.asked, self.most = 0, most

    def passed(self):
        self.asked += 1
        return self.asked > self.most


@pytest.mark.parametrize("count", [6, 24])
def test_scenarios_are_chosen_contact_by_contact(count):
    problem = many(count)
    whole = Counted(10**9)
    Choice(problem, 0).regions(20, 0, whole, range(count))
    assert whole.asked >= 2 * count
    for most in (count // 2, count + count // 2):
        late = Counted(most)
        with pytest.raises(OutOfTimeError):
            Choice(problem, 0).regions(20, 0, late, range(count))
        assert late.asked == most + 1


def test_stable_sets_are_made_contact_by_contact():
    problem = many(24)
    late = Counted(12)
    with pytest.raises(OutOfTimeError):
        PlanningContext(problem, sp.PlanOptions(), late)
    assert late.asked == 13


def test_hundreds_of_contacts_are_planned_with():
    """Keys of a search had room for 200."""
    problem = many(260)
    context = PlanningContext(
        problem, sp.PlanOptions(regions=(None,) * 259 + (sp.stable_region(problem.surface, problem.contacts[-1]),)), Deadline()
    )
    assert list(context.stable) == [259]
