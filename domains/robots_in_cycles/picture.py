"""Pictures of drives: the path of a robot over its track, or between the pillars of its room."""

from __future__ import annotations

from collections.abc import Iterable

from domains.robots_in_cycles.drives import Drive, line_of, pillars_of

_SCALE = 130.0
_HALF = 1.6


def draw_follow(drive: Drive, track: int) -> str:
    """Return the path of the line follower over its line as SVG."""
    line = [(float(x), float(y)) for x, y in line_of(track)]
    return _page(_path([*line, line[0]], "#222222", 0.04 * _SCALE), drive)


def draw_avoid(drive: Drive, room: int) -> str:
    """Return the path of the obstacle avoider between pillars and walls as SVG."""
    wall = f'<rect x="{0.1 * _SCALE}" y="{0.1 * _SCALE}" width="{3 * _SCALE}" height="{3 * _SCALE}"'
    shapes = [f'{wall} fill="none" stroke="#222222" stroke-width="4"/>']
    for x, y in pillars_of(room):
        across, down = _at(x, y)
        shapes.append(f'<circle cx="{across}" cy="{down}" r="{0.08 * _SCALE:.1f}" fill="#777777"/>')
    return _page("".join(shapes), drive)


def _page(scene: str, drive: Drive) -> str:
    size = 2 * _HALF * _SCALE
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size} {size}" width="{size}" height="{size}">'
    back = f'<rect width="{size}" height="{size}" fill="#ffffff"/>'
    return f"{head}{back}{scene}{_path(drive.path[::4], '#d04020', 1.5)}</svg>\n"


def _path(points: Iterable[tuple[float, float]], colour: str, width: float) -> str:
    places = " ".join(f"{across},{down}" for across, down in (_at(x, y) for x, y in points))
    return f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{width:.1f}"/>'


def _at(x: float, y: float) -> tuple[float, float]:
    """Return a place in metres as pixels from the top left."""
    return round((x + _HALF) * _SCALE, 1), round((_HALF - y) * _SCALE, 1)
