"""The command that shows the catalogue of effects."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from stablepush.cli.common import told

#: What effects act on, in words.
_ACTS_ON = {
    "support": "the friction or loads under the object", "contact": "the contact of fingers and object",
    "inertia": "the mass that is accelerated", "sensing": "what the sensors read",
}  # fmt: skip


def effects(
    effect: Annotated[str | None, typer.Argument(metavar="ID", help="Id of one effect; all if not given.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the catalogue of what simulations leave out.

    For each effect: parameters, units, ranges, and what a log needs to show it. W is the frame of the table, B that of the
    slider; the numbers of a vector are given as 0.01/0.02.
    """
    from stablepush.core import check_choice
    from stablepush.effects import CATALOGUE, lab_effects

    own = {} if effect in CATALOGUE else lab_effects()
    if effect is not None:
        check_choice(effect, "ID", (*CATALOGUE, *own))
    chosen = [kind.description for kind in (*CATALOGUE.values(), *own.values()) if effect in (None, kind.id)]
    told(effects=chosen)
    if as_json:
        print(json.dumps(chosen if effect is None else chosen[0], indent=1))
        return
    for kind in chosen:
        print(f"{kind['id']}: {kind['what']}" + (f" (acts on {_ACTS_ON[kind['acts']]})" if effect else ""))
        for parameter in kind["parameters"] if effect else ():
            print(f"  {_words(parameter)}")
        if effect:
            print(f"  a log needs {kind['needs']}")
            print(f"  once it is named: {kind['remedy']}")
    if effect is None:
        print("stablepush effects ID describes one in detail")
        print("stablepush simulate --effect ID:PARAM=VALUE adds one of the catalogue to a rig")


def _words(parameter: dict[str, Any]) -> str:
    nominal = "the rig's own value" if parameter["nominal"] is None else f"{parameter['nominal']:g}"
    numbers = "two numbers, each " if parameter["size"] == 2 else ""
    unit = "no unit" if parameter["unit"] == "1" else parameter["unit"]
    found = f"{numbers}from {parameter['low']:.3g} to {parameter['high']:.3g} on real rigs"
    return f"{parameter['name']} [{unit}]: no effect at {nominal}; {found}"
