"""Edges across borders: continuations of edges from the border of an outer box to a state inside the box."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf

from dsc.drawing.layered.arrange import without_detours
from dsc.drawing.layout import Area, Box, BoxKind, DrawnEdge, Point, Text, text_width
from dsc.drawing.maze import Maze

ROUND = frozenset({BoxKind.FINAL, BoxKind.HISTORY})
"""Kinds of boxes that contain a circle, at which edges end."""
TRACKS = (5.0, 11.0)
"""Distances of parallel lines from boxes and texts, in pixels."""
CLEAR = 3.0
"""Least distance of a line from boxes and texts, in pixels."""
ARRIVAL = 11.0
"""Length of the straight end of a line at a state, enough for an arrowhead, in pixels."""
LEAST = 2.5
"""Least distance between possible tracks in pixels; it bounds their number in large drawings."""
PORT_GAP = 14.0
CORNER = 11.0
"""Length at a state's corners where no line ends, in pixels."""


@dataclass(frozen=True, slots=True)
class Port:
    """A place at a box's border where a line may end, the direction out of the box, and the cost of the place."""

    place: Point
    out: Point
    price: float = 0.0

    @property
    def before(self) -> Point:
        """The point where the straight end of a line begins."""
        return _shift(self.place, self.out, ARRIVAL)


@dataclass(slots=True)
class _Ground:
    """The area of a box for new lines: obstacles, existing lines and possible tracks."""

    solid: list[Area] = field(default_factory=list)
    lines: list[tuple[Point, Point]] = field(default_factory=list)
    xs: list[float] = field(default_factory=list)
    ys: list[float] = field(default_factory=list)

    def keep_clear(self, area: Area) -> None:
        x, y, width, height = area
        self.solid.append((x - CLEAR, y - CLEAR, width + 2 * CLEAR, height + 2 * CLEAR))
        self.xs += [place for track in TRACKS for place in (x - track, x + width + track)]
        self.ys += [place for track in TRACKS for place in (y - track, y + height + track)]

    def enclose(self, box: Box) -> None:
        """Add a box whose border lines may cross but must not follow."""
        right, low = box.x + box.width, box.y + box.height
        corners = [(box.x, box.y), (right, box.y), (right, low), (box.x, low), (box.x, box.y)]
        self.lines += pairwise(corners)
        self.lines += [((box.x, y), (right, y)) for y in box.lines]
        self.xs += [place for track in TRACKS for place in (box.x + track, right - track)]
        self.ys += [place for track in TRACKS for place in (box.y + track, low - track)]


def prolonged(
    edge: DrawnEdge, start: Box, end: Box, also: Iterable[str], drawn: Sequence[DrawnEdge]
) -> list[DrawnEdge]:
    """Return an edge between two boxes, prolonged to its source state inside `start` and its target inside `end`.

    Args:
        edge: an edge that ends at the borders of both boxes.
        start: the box that contains the source, or the source's box.
        end: the box that contains the target, or the target's box.
        also: further targets in `end`; the edges to all targets share the line to the border of `end`.
        drawn: existing edges; each crossing with an existing edge has an additional cost.
    """
    first, second, *_ = edge.points
    before, last = edge.points[-2:]
    tail = [*reversed(_led_on(start, edge.source, (second, first), drawn)), *edge.points]
    edges: list[DrawnEdge] = []
    for target in (edge.target, *also):
        others = [one for one in (*drawn, *edges) if one.target != target] if target != end.name else ()
        points = without_detours([*tail, *_led_on(end, target, (before, last), others)])
        forked = replace(edge, label=(), area=None) if edges else edge
        edges.append(replace(forked, target=target, points=points))
    return edges


def join(box: Box, source: str, target: str) -> DrawnEdge:
    """Return the edge from a history of an orthogonal state to a state in one of its regions."""
    circle = way_to(box, source)[-1].boxes[0]
    port = (circle.x + circle.width / 2, circle.y + circle.height)
    points = _inwards(way_to(box, target), ((port[0], circle.y), port), ())
    return DrawnEdge(source, target, without_detours([port, *points]))


def way_to(box: Box, name: str) -> tuple[Box, ...]:
    """Return the boxes on the path from `box` to the state `name` inside it; empty if `box` lacks the state.

    A region of that name is not a result, because names of regions are separate from names of states.
    """
    if box.name == name and box.kind is not BoxKind.REGION:
        return (box,)
    for inner in box.boxes:
        if found := way_to(inner, name):
            return (box, *found)
    return ()


def _led_on(box: Box, name: str, last: tuple[Point, Point], drawn: Sequence[DrawnEdge]) -> list[Point]:
    """Return the continuation of a line from the border of `box` to the border of the state `name`."""
    if box.name != name:
        return _inwards(way_to(box, name), last, drawn)
    if box.kind is BoxKind.HISTORY:
        return [min((port.place for port in _ports(box)), key=lambda place: _distance(place, last[1]))]
    return []


def _inwards(way: Sequence[Box], last: tuple[Point, Point], drawn: Sequence[DrawnEdge]) -> list[Point]:
    """Return the line from the border of the first box on the path to the border of the last box."""
    box, ports = way[0], _ports(way[-1])
    vertical = abs(last[0][0] - last[1][0]) < abs(last[0][1] - last[1][1])
    start = _shift(last[1], _direction(*last), TRACKS[0])
    ground = _ground(way, drawn)
    befores = [port.before for port in ports]
    maze = Maze(
        _places([start[0], *(x for x, _ in befores)], ground.xs, (box.x, box.x + box.width)),
        _places([start[1], *(y for _, y in befores)], ground.ys, (box.y, box.y + box.height)),
        ground.solid,
        ground.lines,
    )
    arrivals = {(port.before, port.out[0] == 0): port for port in ports}
    words = [_text_area(text) for text in way[-1].texts] if way[-1].kind in ROUND else []
    goals = {goal: port.price + _price_of(port, words, ground.lines) for goal, port in arrivals.items()}
    points = maze.way(start, goals, vertical=vertical)
    return [*points, next(port.place for (before, _), port in arrivals.items() if before == points[-1])]


def _places(needed: Iterable[float], useful: Iterable[float], bounds: tuple[float, float]) -> list[float]:
    """Return the positions of tracks: all in `needed`, and those in `useful` that are not close to another track."""
    fixed = [(place, 0) for place in needed]
    free = [(place, 1) for place in useful if bounds[0] < place < bounds[1]]
    places: list[float] = []
    last = -inf
    for place, rank in sorted({*fixed, *free}):
        if rank == 0 or place - last >= LEAST:
            places.append(place)
            last = place
    return places


def _ground(way: Sequence[Box], drawn: Sequence[DrawnEdge]) -> _Ground:
    ground = _Ground()
    for edge in drawn:
        ground.lines += pairwise(edge.points)
    _survey(way[0], way, ground)
    return ground


def _survey(box: Box, way: Sequence[Box], ground: _Ground) -> None:
    """Add the content of `box` to `ground`: regions and boxes on the path are open, all other boxes are obstacles."""
    ground.enclose(box)
    for area in _writing(box):
        ground.keep_clear(area)
    for edge in box.edges:
        ground.lines += pairwise(edge.points)
    for inner in box.boxes:
        ahead = way[1:] if inner in way[1:2] else ()
        if len(ahead) > 1 or inner.kind is BoxKind.REGION:
            _survey(inner, ahead, ground)
            continue
        for area in (_area(inner.boxes[0]), *_writing(inner)) if ahead and inner.kind in ROUND else (_area(inner),):
            ground.keep_clear(area)


def _area(box: Box) -> Area:
    return box.x, box.y, box.width, box.height


def _writing(box: Box) -> Iterator[Area]:
    """Yield the areas of all texts in a box and at the edges inside it."""
    for text in box.texts:
        yield _text_area(text)
    for edge in box.edges:
        if edge.area is not None:
            yield edge.area


def _text_area(text: Text) -> Area:
    width = text_width(text.text, text.style)
    return text.x - (width / 2 if text.centred else 0.0), text.y - 10.0, width, 12.0


def _ports(box: Box) -> list[Port]:
    """Return the places at a state's border where lines may end."""
    shape = box.boxes[0] if box.kind in ROUND else box
    x, y = shape.x + shape.width / 2, shape.y + shape.height / 2
    beside, above = _spread(shape.height), _spread(shape.width)
    if box.kind in ROUND or box.kind is BoxKind.CHOICE:
        beside = above = [0.0]
    ports = []
    for sign in (-1.0, 1.0):
        ports += [Port((x + off, y + sign * shape.height / 2), (0.0, sign), abs(off) / 4) for off in above]
        ports += [Port((x + sign * shape.width / 2, y + off), (sign, 0.0), abs(off) / 4) for off in beside]
    return ports


def _spread(length: float) -> list[float]:
    room = length / 2 - CORNER
    middle = [number * PORT_GAP for number in range(-2, 3) if abs(number) * PORT_GAP <= max(room, 0.0)]
    return [-room, *middle, room] if room > middle[-1] + PORT_GAP / 2 else middle


def _price_of(port: Port, words: Iterable[Area], lines: Iterable[tuple[Point, Point]]) -> float:
    """Return the additional cost of a port because of texts or other lines at its place."""
    near = sum(1 for ends in lines if any(_distance(end, port.place) < PORT_GAP / 2 for end in ends))
    return 60.0 * near + 500.0 * any(_holds(area, port.before) for area in words)


def _holds(area: Area, point: Point) -> bool:
    x, y, width, height = area
    return x <= point[0] <= x + width and y <= point[1] <= y + height


def _distance(one: Point, other: Point) -> float:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


def _direction(before: Point, after: Point) -> Point:
    length = _distance(before, after) or 1.0
    return (after[0] - before[0]) / length, (after[1] - before[1]) / length


def _shift(point: Point, direction: Point, length: float) -> Point:
    return point[0] + direction[0] * length, point[1] + direction[1] * length
