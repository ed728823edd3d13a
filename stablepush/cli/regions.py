"""Commands that show which rotation centres are stable, and from which contacts."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import (
    Contact,
    Output,
    Progress,
    about,
    also_written,
    number,
    options_of,
    require_files,
    require_png,
    told,
    whole_number,
)
from stablepush.core import InputError, UnsupportedContactError

if TYPE_CHECKING:
    from stablepush.objects import PushContact, Slider
    from stablepush.stability import StableRegion

#: Solid angle (sr) of all unit twists, and one below which two regions are the same.
_ALL_MOTIONS, _SLIVER = 4 * math.pi, 1e-3


#: Longest number of a contact.
_DIGITS = 4

Model = Annotated[Path, typer.Argument(metavar="MODEL", help="model/1 file, or a scene.")]


def classify(
    model: Model,
    cors: Annotated[Path, typer.Option("--cors", help="CSV with columns cor_x, cor_y, sense.")],
    output: Output,
    contact: Contact = None,
) -> None:
    """Tell which rotation centres are stable, and by what margin.

    cor_x, cor_y are the rotation centre in the frame of the slider, in m; sense is 1 for a counter-clockwise turn, -1 for a
    clockwise one. The table gets the columns stable (1 or 0), margin (rad; negative: not stable) and probability (blank
    without an ensemble).
    """
    import numpy as np

    from stablepush.core import note_cors
    from stablepush.geometry import twist_from_cor
    from stablepush.io import IS_SENSE, load_contact, load_model, read_table, table_text, write_atomically
    from stablepush.stability import BOUNDARY_SLACK, StabilityOracle

    contact, number_in_scene, _ = _of_scene(model, contact)
    require_files(output, read=(model, contact, cors))
    columns = ("cor_x", "cor_y", "sense")
    oracle = StabilityOracle(load_model(model), load_contact(contact, number_in_scene))
    table, _ = read_table(cors, required=columns, numbers=columns, filled=columns, rules={"sense": IS_SENSE})
    centers = np.stack((table["cor_x"], table["cor_y"]), axis=-1).reshape(-1, 2)
    note_cors(centers, oracle.surface.characteristic_length, f"{cors}: cor_x, cor_y")
    twists = twist_from_cor(centers, table["sense"])
    with about(model):
        margins, shares = oracle.margin(twists), oracle.probability(twists)
    stable = (margins >= -BOUNDARY_SLACK).astype(float)
    probability = np.full(len(centers), "", dtype=object) if shares is None else shares
    write_atomically(output, table_text({**table, "stable": stable, "margin": margins, "probability": probability}))
    told(output=output, stable=int(stable.sum()), rotation_centres=len(stable))
    print(f"{output}: {int(stable.sum())} of {len(stable)} rotation centres stable")


def _of_scene(model: Path, contact: Path | None, slider: Path | None = None) -> tuple[Path, int | None, Path | None]:
    """The files of contact and slider: where they are not given, the scene that is given for the model. A number is that of one
    of its contacts."""
    from stablepush.io import read_json

    words = "" if contact is None else str(contact)
    numeral = words.isascii() and words.isdecimal() and len(words) <= _DIGITS
    number = int(words) if contact is not None and numeral and not contact.exists() else None
    if number is not None:
        contact = None
    scene = (contact is None or slider is None) and read_json(model, "model/1", "scene/1")["format"].value == "scene/1"
    if contact is None and not scene:
        raise InputError("--contact", "expected a contact file; only a scene has a contact of its own")
    return contact or model, number, slider or (model if scene else None)


def draw_map(
    model: Model,
    output: Output,
    contact: Contact = None,
    slider: Annotated[
        Path | None,
        typer.Option(help="slider/1 file; needed for the all-pressure and the conservative region. A scene has its own."),
    ] = None,
    regions_file: Annotated[Path | None, typer.Option("--json", help="Regions as JSON.")] = None,
    extent: Annotated[float | None, typer.Option(parser=number, metavar="METRES", help="Half side of the map in m.")] = None,
    probability: Annotated[
        float | None,
        typer.Option(parser=number, metavar="P", help="Also the region that is stable with this probability, by the ensemble."),
    ] = None,
    com_tolerance: Annotated[
        float,
        typer.Option(
            parser=number, metavar="METRES", help="Half width of the box in which the centre of mass may lie (all-pressure)."
        ),
    ] = 0.0,
    least_mu: Annotated[
        float | None,
        typer.Option(
            parser=number,
            metavar="MU",
            help="The all-pressure region holds from this friction up to that of the contact.",
        ),
    ] = None,
    margins: Annotated[
        Path | None, typer.Option(help="Chart of the margin over the curvature of a push, from right to left turns, as PNG.")
    ] = None,
    sphere: Annotated[Path | None, typer.Option(help="Regions on the sphere of unit twists, as PNG.")] = None,
    view: Annotated[
        Path | None, typer.Option(help="The map as an HTML page; it shows the margin of any rotation centre.")
    ] = None,
) -> None:
    """Draw which rotation centres are stable.

    By the model, for every pressure under the slider (all-pressure), and by the test STABLE (conservative).
    """
    import numpy as np

    from stablepush.core import check_number, note_off_outline
    from stablepush.geometry import nearest_on_outline
    from stablepush.io import load_contact, load_model, load_slider, write_atomically, write_json
    from stablepush.stability import chance_region, probability_map, regions_to_json, stable_region
    from stablepush.views.plot import figure_png, plot_margins, plot_regions, plot_twist_sphere

    require_png(output)
    if extent is not None:
        check_number(extent, "--extent", positive=True)
    contact, number_in_scene, slider = _of_scene(model, contact, slider)
    for option, value in (("--com-tolerance", com_tolerance), ("--least-mu", least_mu)):
        if slider is None and value:
            raise InputError(
                option, "expected --slider with it, as it is for the all-pressure region", f"{option} {value:g} alone"
            )
    require_files(output, regions_file, margins, sphere, view, read=(model, contact, slider))
    surface, fingers = load_model(model), load_contact(contact, number_in_scene)
    body = None if slider is None else load_slider(slider)
    if body is not None:
        near, _ = nearest_on_outline(body.vertices, fingers.points)
        note_off_outline(float(np.linalg.norm(near - fingers.points, axis=1).max()), f"{contact}: points")
    shading, rho = None, surface.characteristic_length
    given = options_of("probability", "com_tolerance", mu="least-mu")
    with about(model, contact, given):
        regions = [stable_region(surface, fingers)]
        if probability is not None:
            regions.append(chance_region(surface, fingers, probability))
        if surface.members() and regions[0].curve is None:
            size = 5 * max(fingers.radius, 0.0 if body is None else body.radius) if extent is None else extent
            shading = probability_map(surface, fingers, size)
    if body is not None and slider is not None:
        with about(slider, contact, given):
            limits = None if least_mu is None else (least_mu, fingers.mu)
            regions += _of_slider(body, fingers, limits, com_tolerance, rho)
    # all is made before any of it is written
    with about(model):
        pictures: list[tuple[Path, str | bytes]] = [
            (output, figure_png(plot_regions(regions, fingers, body, extent, probability=shading)))
        ]
        if margins is not None:
            pictures.append((margins, figure_png(plot_margins(surface, fingers, regions))))
        if sphere is not None:
            pictures.append((sphere, figure_png(plot_twist_sphere(regions))))
        if view is not None:
            from stablepush.views import region_html

            pictures.append((view, region_html(surface, fingers, regions, body, extent)))
    if regions_file is not None:
        write_json(regions_file, regions_to_json(regions, extent))
    for path, picture in pictures:
        write_atomically(path, picture)
    written = [str(path) for path, _ in pictures] + ([] if regions_file is None else [str(regions_file)])
    _tell_regions(regions, output, model)
    print(f"{', '.join(written)}: written")


def _of_slider(
    body: Slider, fingers: PushContact, limits: tuple[float, float] | None, com_tolerance: float, rho: float
) -> list[StableRegion]:
    """The regions that hold whatever the pressure under a slider."""
    from stablepush.stability import all_pressure_region, lynch_mason_region

    regions = []
    if len(body.support_vertices) < 3:
        print("no all-pressure region: the slider's support points lie on a line")
    else:
        regions.append(all_pressure_region(body, fingers, mu=limits, com_tolerance=com_tolerance, characteristic_length=rho))
    try:
        regions.append(lynch_mason_region(body, fingers, characteristic_length=rho))
    except UnsupportedContactError as error:
        print(f"no conservative region: {error}")
    return regions


def _tell_regions(regions: list[StableRegion], output: Path, model: Path) -> None:
    """Print how large the regions are, and how tight the turns in them."""
    told(
        output=output,
        regions=[
            {"name": r.name, "solid_angle": r.solid_angle(), "translations": r.translation_intervals,
             "tightest_left": r.tightest_turn(1), "tightest_right": r.tightest_turn(-1)}
            for r in regions
        ],
    )  # fmt: skip
    for region in regions:
        spans = " and ".join(f"{math.degrees(low):.1f} to {math.degrees(high):.1f}" for low, high in region.translation_intervals)
        turns = [region.tightest_turn(sense) for sense in (1, -1)]
        words = [
            f"{1000 * math.hypot(*cor):.3g} mm {word}"
            for cor, word in zip(turns, ("counter-clockwise", "clockwise"), strict=True)
            if cor is not None
        ]
        angle = region.solid_angle()
        print(
            f"{region.name}: {100 * angle / _ALL_MOTIONS:.1f} % of all motions ({angle:.3f} of {_ALL_MOTIONS:.2f} sr), "
            + (f"translations towards {spans} deg from x of B" if spans else "no stable translation")
            + (f", tightest turns {' and '.join(words)} from the centre of mass" if words else ", no stable turn")
        )
    if any(r.name == "all-pressure" and _reaches_beyond(r, regions[0]) for r in regions[1:]):
        print(
            f"{model}: note: the all-pressure region reaches beyond that of the model, which only approximates a pressure: "
            "count on what is in both",
            file=sys.stderr,
        )


def _reaches_beyond(region: StableRegion, model: StableRegion) -> bool:
    """Whether a region has motions that are not in that of the model."""
    if any(r.curve is not None for r in (region, model)):
        return False
    return any(region.disc(sense).difference(model.disc(sense)).area > _SLIVER for sense in (1, -1))


def contacts(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model/1 file.")],
    slider: Annotated[Path, typer.Option(help="slider/1 file, or a scene.")],
    mu: Annotated[
        float,
        typer.Option(
            "--contact-mu",
            "--mu",
            parser=number,
            metavar="MU",
            help="Friction between finger and slider. --mu: its former name.",
        ),
    ],
    output: Output,
    measure: Annotated[str, typer.Option(help="Rank by area, tightest-turn or margin.")] = "area",
    width: Annotated[
        list[float] | None, typer.Option(parser=number, metavar="METRES", help="Distance of the fingers; repeatable.")
    ] = None,
    edge: Annotated[
        list[int] | None, typer.Option(parser=whole_number, metavar="INTEGER", help="Edge that can be reached; repeatable.")
    ] = None,
    places: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Places along each edge.")] = 9,
    finger_radius: Annotated[
        float,
        typer.Option(parser=number, metavar="METRES", help="Radius of the fingers; places without room for them are left out."),
    ] = 0.0,
    best_file: Annotated[
        Path | None, typer.Option("--best", help="File to write the best contact to, as classify and map take it.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Picture of the contacts as PNG.")] = None,
) -> None:
    """Rank places for two fingers along the edges.

    Writes a table (CSV), the best first.

    Columns: edge; center, width, tightest_left, tightest_right in m (blank: no turn is stable); area in sr; margin in rad.
    """
    import numpy as np

    from stablepush.io import load_model, load_slider, save_contact, table_text, write_atomically
    from stablepush.stability import rank_contacts
    from stablepush.views.plot import figure_png, plot_contacts

    require_files(output, picture, best_file, read=(model, slider))
    require_png(picture)
    surface, body = load_model(model), load_slider(slider)
    given = options_of("measure", "places", "edge", "finger_radius", mu="contact-mu", widths="width", edges="edge")
    with Progress("contacts") as step, about(model, options=given):
        ranked = rank_contacts(
            body, surface, mu, measure=measure, widths=width or None, places=places, edges=edge or None,
            finger_radius=finger_radius, progress=step.to,
        )  # fmt: skip
    columns = {
        name: np.array([getattr(one, name) for one in ranked])
        for name in ("edge", "center", "width", "area", "tightest_left", "tightest_right", "margin")
    }
    # a turn that no COR allows is a blank
    for name in ("tightest_left", "tightest_right"):
        columns[name] = np.where(np.isfinite(columns[name]), columns[name], np.nan)
    drawn = figure_png(plot_contacts(body, ranked, measure)) if picture is not None else b""
    write_atomically(output, table_text(columns))
    if picture is not None:
        write_atomically(picture, drawn)
    best = ranked[0]
    if best_file is not None:
        save_contact(best.contact, best_file)
    told(output=output, contacts=len(ranked), measure=measure, edge=best.edge, center=best.center, width=best.width)
    print(
        f"{output}: {len(ranked)} contacts; best by {measure}: edge {best.edge}, middle {best.center:.4g} m along it, "
        f"fingers {best.width:.4g} m apart"
    )
    also_written(best_file, picture)
