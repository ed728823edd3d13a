"""Compiled: how a slider moves at an instant under contacts whose places move as a pusher does.

The slider's twist ``V`` and the contact forces ``f_i`` obey: the load ``F(V)`` of the table is ``Σ (f_i, p_i × f_i)``; no contact
penetrates, ``g_i = n_i·(v(p_i) - u_i) >= 0`` with ``u_i`` the pusher's velocity there; open contacts (``g_i > 0``) have no force;
sticking ones keep ``v = u`` with ``f`` in the friction cone; sliding ones have ``f`` on the edge of the cone against the slip.

``F`` is monotone (the gradient of a convex power), so each combination of modes that is possible in the plane leaves at most one
number to be found: the turn about a sticking contact (the torque about it vanishes and grows with the turn), the slip of a
single contact (the force turns monotonically from where it sticks to the edge of its cone), or where on the line of twists that
close two contacts these slip, both or one of them.
"""

from __future__ import annotations

import math

from stablepush.core import compiled, inner
from stablepush.mechanics.kernels.contacts import MOST_CONTACTS, OPEN, STICKING
from stablepush.mechanics.kernels.friction import load_of
from stablepush.mechanics.kernels.one_contact import one_contact
from stablepush.mechanics.kernels.two_contacts import (
    both_stick_at,
    clear_forces,
    closing_line,
    hold,
    load_on_line,
    others_open,
    two_slide,
)


@inner
def _free_twist(table, at, twist, load):  # type: ignore[no-untyped-def]
    """Twist with no contact: at rest, or braked by friction over the step."""
    twist[0] = twist[1] = twist[2] = 0.0
    if table.inertia[0] > 0.0 and (at.vx != 0.0 or at.vy != 0.0 or at.omega != 0.0):
        # what friction takes of the last twist in the step; it does not turn it round
        load_of(table, at, at.vx, at.vy, at.omega, load)
        vx, vy = at.vx - at.dt * load[0] / table.inertia[0], at.vy - at.dt * load[1] / table.inertia[0]
        w = at.omega - at.dt * load[2] / table.inertia[1]
        if table.inertia[0] * (vx * at.vx + vy * at.vy) + table.inertia[1] * w * at.omega > 0.0:
            twist[0], twist[1], twist[2] = vx, vy, w
    load[0] = load[1] = load[2] = 0.0


@inner
def _first_solution(found, twist, load, solution):  # type: ignore[no-untyped-def]
    """Count a solution and store the first; return whether this is the first."""
    solution.found[0] = found
    if found > 1:
        return False
    for q in range(3):
        solution.twist[q], solution.load[q] = twist[q], load[q]
    return True


@compiled
def respond(table, at, touch, pushed, mu, length, dt, every, solution, work):  # type: ignore[no-untyped-def]
    """Fill ``solution`` with how the slider moves: ``pushed`` (3,) is the twist it would have if it were stuck to the pusher.

    Sticking comes before sliding, more contacts before fewer. ``every`` counts all combinations of modes that are consistent;
    else the first ends the search. Without any the slider stays, jammed.
    """
    k = touch.number[0]
    speed = 0.0
    for m in range(k):
        speed = max(speed, math.sqrt(touch.velocity[m, 0] ** 2 + touch.velocity[m, 1] ** 2))
    slack = 1e-9 * speed + 1e-13
    found = 0
    twist, load, force, line = work.twist, work.load, work.force, work.line
    _free_twist(table, at, twist, load)
    clear_forces(solution.force)
    for m in range(MOST_CONTACTS):
        solution.mode[m] = OPEN
    free = others_open(touch, -1, -1, twist, dt, slack)
    if not free:
        twist[0] = twist[1] = twist[2] = 0.0
    _first_solution(1 if free else 0, twist, load, solution)
    if free:
        return
    # all stick: pairs of several
    for i in range(k):
        for j in range(i + 1, k):
            if not closing_line(touch, i, j, pushed, length, dt, line):
                continue
            place = both_stick_at(touch, i, j, line, speed + length * abs(pushed[2]) + 1e-300, dt)
            if math.isnan(place):
                continue
            load_on_line(table, at, line, place, twist, load)
            if not others_open(touch, i, j, twist, dt, slack):
                continue
            held = hold(touch, i, j, False, mu, length, load, work)
            if not held and k > 2 and i == 0 and j == 1:
                held = hold(touch, i, j, True, mu, length, load, work)
            if not held:
                continue
            found += 1
            if _first_solution(found, twist, load, solution):
                for m in range(k):
                    solution.force[m, 0], solution.force[m, 1] = force[m, 0], force[m, 1]
                    if force[m, 0] != 0.0 or force[m, 1] != 0.0:
                        solution.mode[m] = STICKING
            if not every:
                return
    # one contact: first sticking, then sliding; the slider turns about as it did
    guess = at.omega if at.omega != 0.0 else pushed[2]
    for sliding in (False, True):
        for i in range(k):
            nx, ny = touch.normal[i, 0], touch.normal[i, 1]
            back = touch.gap[i] / dt
            ux, uy = touch.velocity[i, 0] - back * nx, touch.velocity[i, 1] - back * ny
            if ux * nx + uy * ny <= 0.0:
                # nothing presses here
                continue
            px, py = touch.point[i, 0], touch.point[i, 1]
            mode = one_contact(table, at, px, py, nx, ny, ux, uy, mu, guess, length, sliding, twist, load)
            if mode < 0 or (sliding and mode == STICKING) or not others_open(touch, i, i, twist, dt, slack):
                continue
            found += 1
            if _first_solution(found, twist, load, solution):
                solution.force[i, 0], solution.force[i, 1] = load[0], load[1]
                solution.mode[i] = mode
            if not every:
                return
        if sliding:
            break
        for i in range(k):
            for j in range(i + 1, k):
                if not closing_line(touch, i, j, pushed, length, dt, line):
                    continue
                if not two_slide(table, at, touch, i, j, mu, length, dt, slack, work):
                    continue
                found += 1
                if _first_solution(found, twist, load, solution):
                    for side in range(2):
                        m = i if side == 0 else j
                        solution.force[m, 0], solution.force[m, 1] = force[m, 0], force[m, 1]
                        solution.mode[m] = work.mode[m]
                if not every:
                    return
