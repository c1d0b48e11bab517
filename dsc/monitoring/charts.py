"""Observed values over time as SVG: a chart for each entry of each component (S2.20)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from dsc.monitoring.monitor import Observation
from knowledge_base import svg

WIDTH, HEIGHT = 640.0, 56.0
"""Size of one chart in pixels; all lengths are in pixels."""
CHARACTER = 7.6
SCALE = 64.0
"""Width of the numbers between the name and the chart."""
MARGIN, GAP = 18.0, 26.0
_STYLE = (
    f"text{{{svg.FONTS};font-size:12px;fill:{svg.DETAIL}}}.name{{font-weight:bold;fill:{svg.INK}}}"
    f".small{{font-size:11px;fill:{svg.SOFT}}}.line{{fill:none;stroke:{svg.BLUE[1]};stroke-width:1.8}}"
    f".axis{{stroke:{svg.SOFT};stroke-width:1}}"
)
_Point = tuple[float, object]


class _Frame(NamedTuple):
    """The place of a chart, and the last second of all charts."""

    left: float
    top: float
    end: float

    @property
    def right(self) -> float:
        return self.left + WIDTH

    @property
    def bottom(self) -> float:
        return self.top + HEIGHT

    def x(self, second: float) -> float:
        return self.left + WIDTH * second / self.end


def draw_observations(title: str, observations: Iterable[Observation]) -> str:
    """Return the observations as one SVG document; numbers are lines, and other values are words at their time."""
    series: dict[str, list[_Point]] = {}
    for one in observations:
        for name, value in _parts(f"{one.component}.{one.entry}", one.value):
            series.setdefault(name, []).append((one.seconds, value))
    end = max((points[-1][0] for points in series.values()), default=0.0) or 1.0
    left = MARGIN + max(map(len, series), default=0) * CHARACTER + SCALE
    body: list[str] = []
    for row, (name, points) in enumerate(series.items()):
        body += _chart(name, points, _Frame(left, MARGIN + row * (HEIGHT + GAP), end))
    height = MARGIN + len(series) * (HEIGHT + GAP) + MARGIN
    return svg.document(title, left + WIDTH + 2 * MARGIN, height, _STYLE, body)


def _parts(name: str, value: object) -> Iterator[tuple[str, object]]:
    """Yield a value, or the values of a mapping, with their names."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _parts(f"{name}.{key}", part)
    else:
        yield name, value


def _chart(name: str, points: list[_Point], frame: _Frame) -> Iterator[str]:
    below = svg.number(frame.bottom + 14)
    yield f'<text class="name" x="{svg.number(MARGIN)}" y="{svg.number(frame.top + 16)}">{svg.escaped(name)}</text>'
    yield f'<line class="axis" {svg.ends((frame.left, frame.bottom), (frame.right, frame.bottom))}/>'
    yield f'<text class="small" x="{svg.number(frame.left)}" y="{below}">0 s</text>'
    yield f'<text class="small" x="{svg.number(frame.right - 30)}" y="{below}">{frame.end:.4g} s</text>'
    numbers = [
        (second, float(value))
        for second, value in points
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    yield from _line(numbers, frame) if len(numbers) == len(points) else _words(points, frame)


def _line(points: list[tuple[float, float]], frame: _Frame) -> Iterator[str]:
    """Yield the values as steps: each is known until the next observation."""
    least, most = min(value for _, value in points), max(value for _, value in points)
    middle, reach = (least + most) / 2, (most - least) or 1.0
    y_of = {value: frame.top + HEIGHT / 2 - (value - middle) / reach * (HEIGHT - 16) for _, value in points}
    (second, first), *others = points
    steps = "".join(f"H{svg.number(frame.x(second))}V{svg.number(y_of[value])}" for second, value in others)
    path = f"M{svg.point((frame.x(second), y_of[first]))}{steps}H{svg.number(frame.right)}"
    yield f'<path class="line" d="{path}"/>'
    for value in dict.fromkeys((most, least)):
        place = f'x="{svg.number(frame.left - SCALE + 4)}" y="{svg.number(y_of[value] + 4)}"'
        yield f'<text class="small" {place}>{value:.6g}</text>'


def _words(points: list[_Point], frame: _Frame) -> Iterator[str]:
    for number, (second, value) in enumerate(points):
        x, y = frame.x(second), frame.top + 14 + (number % 3) * 16
        yield f'<line class="axis" {svg.ends((x, frame.top), (x, frame.bottom))} stroke-dasharray="2 3"/>'
        text = svg.escaped("-" if value is None else str(value)[:40])
        yield f'<text x="{svg.number(x + 3)}" y="{svg.number(y)}">{text}</text>'
