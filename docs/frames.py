"""Draw ``frames.svg``, the frames and signs of the library, from its own geometry: ``python docs/frames.py``."""

from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

import stablepush as sp
from stablepush.geometry import compose, transform_points

WIDTH, TOP, SIDE = 540, 440, 290
SCALE = 1700.0  # px per m
ORIGIN = np.array((42.0, 402.0))  # of W, in px
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#B85C00", "#00795A", "#B02A30", "#555555"
STYLE = """<style>
  text { font: 15px sans-serif; fill: #222222; }
  .name { font: bold 16px sans-serif; }
  .small { font: 13px sans-serif; }
</style>"""

SLIDER = sp.Slider.centered([(0.0, 0.0), (0.12, 0.0), (0.12, 0.05), (0.05, 0.05), (0.05, 0.11), (0.0, 0.11)], mass=0.8)
POSE = np.array((0.132, 0.138, 0.36))  # of B in W
RADIUS = 0.009  # m, of the fingers: drawn thick
CONTACT = sp.PushContact.on_edge(SLIDER, edge=0, center=0.065, width=0.06, mu=0.5)
CENTER = np.array((-0.078, 0.046))  # a rotation centre, in B


def px(points):
    """Return where points of W (m) are drawn."""
    return ORIGIN + SCALE * np.asarray(points) * (1.0, -1.0)


def seen(pose, point):
    """Return where a point of the frame ``pose`` is drawn."""
    return px(transform_points(pose, [point])[0])


def moved(at, right, down):
    """Return a place of the picture that is moved, in px."""
    return np.array((at[0] + right, at[1] + down))


def line(start, end, color, arrow=True, width=2.0, dashed=False):
    (x1, y1), (x2, y2) = start, end
    extra = (' marker-end="url(#head)"' if arrow else "") + (' stroke-dasharray="5 4"' if dashed else "")
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{color}" stroke-width="{width:g}"{extra}/>'


def disc(center, radius, fill, stroke="none"):
    return (
        f'<circle cx="{center[0]:.1f}" cy="{center[1]:.1f}" r="{radius:.1f}" fill="{fill}" stroke="{stroke}" stroke-width="1.5"/>'
    )


def box(left, top, width, height, fill, stroke="#222222"):
    place = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {place} fill="{fill}" stroke="{stroke}" stroke-width="1.5"/>'


def text(at, words, kind="", color="#222222", anchor="start"):
    place = f'x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}"'
    return f'<text {place} class="{kind}" style="fill: {color}">{escape(words)}</text>'


def axes(pose, color, names, length=0.035, lifted=0.0):
    """Return the axes of a frame at a pose in W, with names at their tips, the second of them ``lifted`` (px)."""
    origin, shapes = px(pose[:2]), []
    for name, along, up in zip(names, np.eye(2), (0.0, lifted), strict=True):
        tip = seen(pose, length * along)
        shapes.append(line(origin, tip, color, width=2.5))
        out = (tip - origin) / np.linalg.norm(tip - origin)
        shapes.append(text(tip + 13 * out + (0.0, 5.0 - up), name, "small", color, "middle"))
    return [*shapes, disc(origin, 3.5, color)]


def above():
    """The table from above: W, B, the two frames of the pusher, a rotation centre, twist and wrench."""
    outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in px(transform_points(POSE, SLIDER.vertices)))
    shapes = [f'<polygon points="{outline}" fill="#e6effb" stroke="#222222" stroke-width="1.5"/>']
    shapes += axes((0.0, 0.0, 0.0), GREY, "xy", 0.05)
    shapes.append(text(moved(px((0.0, 0.0)), -30, 18), "W: the table", "name", GREY))
    shapes.append(line(px((0.0, 0.0)), px(POSE[:2]), GREY, arrow=False, width=1.2, dashed=True))
    level = px(0.62 * POSE[:2])
    shapes.append(text(moved(level, -22, 6), "pose (x, y, θ)", color=GREY, anchor="end"))

    # the rotation centre, and the twist of the origin of B about it
    center = seen(POSE, CENTER)
    shapes += [line(center, px(POSE[:2]), BLUE, arrow=False, width=1.2, dashed=True), disc(center, 5, "white", BLUE)]
    shapes.append(text(moved(center, -16, -42), "COR (in B)", color=BLUE, anchor="middle"))
    shapes.append(text(moved(center, -16, -24), "sense +1: ccw", "small", BLUE, "middle"))
    turn = [center + 15 * np.array((np.cos(a), -np.sin(a))) for a in np.linspace(-0.9, 2.0, 25)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in turn)
    shapes.append(f'<polyline points="{path}" fill="none" stroke="{BLUE}" stroke-width="1.8" marker-end="url(#head)"/>')
    speed = np.array((CENTER[1], -CENTER[0]))
    tip = seen(POSE, 0.06 * speed / np.linalg.norm(speed))
    shapes += [line(px(POSE[:2]), tip, BLUE, width=3), text(moved(tip, 10, 2), "twist (vx, vy, ω)", color=BLUE)]

    # fingers behind their contact points
    for point, normal in zip(CONTACT.points, CONTACT.normals, strict=True):
        shapes.append(disc(seen(POSE, point - RADIUS * normal), SCALE * RADIUS, "#fde8d7", ORANGE))
        shapes.append(disc(seen(POSE, point), 3.5, "black"))
    shapes += axes(POSE, BLUE, "xy")
    start = moved(px(POSE[:2]), 126, -66)
    shapes += [
        line(start, moved(px(POSE[:2]), 6, -3), GREY, arrow=False, width=1),
        text(moved(start, 6, -4), "B: origin at the", "name", BLUE),
    ]
    shapes.append(text(moved(start, 6, 15), "centre of mass", "name", BLUE))

    # the two frames of the pusher, and the load
    at, behind = compose(POSE, CONTACT.frame), compose(POSE, sp.finger_frame(CONTACT, RADIUS))
    shapes += [*axes(at, GREEN, "xy", 0.017, 22.0), disc(px(behind[:2]), 4.5, ORANGE)]
    start = moved(px(at[:2]), 76, 40)
    shapes += [
        line(start, moved(px(at[:2]), 9, 3), GREEN, width=1.2),
        text(moved(start, 4, 4), "pusher in scenes and", "small", GREEN),
    ]
    shapes.append(text(moved(start, 4, 20), "plans: midway between", "small", GREEN))
    shapes.append(text(moved(start, 4, 36), "the contact points", "small", GREEN))
    start = moved(px(behind[:2]), 46, 108)
    shapes += [line(start, moved(px(behind[:2]), 3, 7), ORANGE, width=1.2)]
    shapes.append(text(moved(start, -128, 27), "pusher in logs and trajectories (px, py, ptheta):", "small", ORANGE))
    shapes.append(text(moved(start, -128, 43), "midway between the centres of the fingers", "small", ORANGE))
    tail = seen(POSE, CONTACT.points[0] - (0.0, 2 * RADIUS + 0.03))
    tip = seen(POSE, CONTACT.points[0] - (0.0, 2 * RADIUS))
    shapes += [line(tail, tip, RED, width=3), text(moved(tail, -6, 4), "wrench (fx, fy, tau):", color=RED, anchor="end")]
    shapes.append(text(moved(tail, -6, 20), "load of all fingers", "small", RED, "end"))
    shapes.append(text(moved(tail, -6, 35), "on the slider, in B", "small", RED, "end"))
    shapes.append(text((16, 24), "From above", "name"))
    return shapes


def beside():
    """The tool from the side: what ``--height`` and ``--tool`` are."""
    table, x, px_m = TOP + SIDE - 46.0, 240.0, 1100.0
    height, arm = table - 0.02 * px_m, 0.11 * px_m
    flange = height - arm
    shapes = [line((16, table), (WIDTH - 16, table), "#222222", arrow=False), box(80, table - 52, 144, 52, "#e6effb")]
    shapes.append(text((146, table - 21), "slider", anchor="middle"))
    shapes.append(box(x - 24, flange, 48, 20, "#dddddd"))
    shapes.append(box(x - 14, flange + 20, 28, table - 8 - flange - 20, "#fde8d7", ORANGE))
    shapes.append(text((x + 16, flange - 22), "flange (tx, ty, tz, qx, qy, qz, qw)", "small", RED))
    shapes.append(text((x + 16, flange - 7), "in W, its z looks down", "small", RED))
    shapes += [
        line((x, flange), (x, flange + 46), RED, width=2.5),
        disc((x, flange), 3.5, RED),
        text((x - 20, flange + 46), "z", "small", RED, "end"),
    ]
    shapes += [line((x, height), (x, height - 40), ORANGE, width=2.5), text((x - 20, height - 36), "z", "small", ORANGE, "end")]
    shapes += [line((x, height), (x - 40, height), ORANGE, width=2.5), text((x - 32, height - 8), "x", "small", ORANGE, "end")]
    shapes += [disc((x, height), 4.5, ORANGE)]
    gauge = x + 40
    shapes += [line((x + 8, height), (gauge + 8, height), GREY, arrow=False, width=1, dashed=True)]
    shapes += [line((gauge, table), (gauge, height), GREY, width=1.5), text((gauge + 12, table - 6), "--height", "small", GREY)]
    gauge = x + 118
    shapes += [line((x + 8, height), (gauge + 8, height), GREY, arrow=False, width=1, dashed=True)]
    shapes += [
        line((x + 8, flange), (gauge + 8, flange), GREY, arrow=False, width=1, dashed=True),
        line((gauge, height), (gauge, flange), GREY, width=1.5),
        text((gauge + 8, height - 34), "--tool: flange in", "small", GREY),
    ]
    shapes.append(text((gauge + 8, height - 18), "the pusher's frame", "small", GREY))
    shapes.append(text((16, TOP + 22), "From the side", "name"))
    shapes.append(
        text((16, table + 28), "Pusher: x along the inward normal of the edge, z up, at the fingers' centres", "small", ORANGE)
    )
    return shapes


def picture():
    """Return the picture as SVG."""
    head = (
        '<defs><marker id="head" viewBox="0 0 10 10" refX="7" refY="5" markerWidth="11" markerHeight="11"'
        ' markerUnits="userSpaceOnUse" orient="auto"><path d="M 0 0 L 10 5 L 0 10 z" fill="context-stroke"/></marker></defs>'
    )
    size = f'width="{WIDTH}" height="{TOP + SIDE}" viewBox="0 0 {WIDTH} {TOP + SIDE}"'
    ground = f'<rect width="{WIDTH}" height="{TOP + SIDE}" fill="white"/>'
    return (
        "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {size}>', STYLE, head, ground, *above(), *beside(), "</svg>"]) + "\n"
    )


if __name__ == "__main__":
    Path(__file__).with_name("frames.svg").write_text(picture(), encoding="utf-8")
