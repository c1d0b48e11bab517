"""Deployment diagram: hosts with their devices, components and wires, as SVG (S0.16)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from dsc.components.demands import Demand
from dsc.deployment.model import Deployment
from knowledge_base import svg
from knowledge_base.spelling import number_text

LINE = 17.0
"""Height of a line of text in pixels; all lengths are in pixels."""
CHARACTER = 7.0
PADDING = 10.0
GAP = 14.0
"""Space between two cards of a host."""
BETWEEN = 110.0
"""Space between two hosts, and next to the last one, for wires."""
TITLE = 46.0
"""Height of a host's own texts."""
MARGIN = 18.0
_WIRES = tuple(border for _, border in (svg.BLUE, svg.ORANGE, svg.GREEN, svg.PINK, svg.VIOLET))
_STYLE = (
    f"text{{{svg.FONTS};font-size:12px;fill:{svg.DETAIL}}}.name{{font-weight:bold;fill:{svg.INK}}}"
    f".kind{{fill:{svg.SOFT};font-style:italic}}.wire{{fill:none;stroke-width:1.6}}"
)


@dataclass(slots=True)
class _Card:
    """A component or device, with its place."""

    title: str
    kind: str
    lines: list[str]
    ports: list[str] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0

    @property
    def height(self) -> float:
        return (1 + bool(self.kind) + len(self.lines) + len(self.ports)) * LINE + PADDING

    def port(self, name: str) -> float:
        """The height of the middle of a port."""
        above = 1 + bool(self.kind) + len(self.lines) + self.ports.index(name)
        return self.y + above * LINE + LINE / 2 + PADDING / 2


def draw_deployment(deployment: Deployment, wires: Mapping[str, str]) -> str:
    """Return the deployment diagram as an SVG document.

    Args:
        deployment: a deployment model whose placement has no mistakes.
        wires: providers by required port, both as `component.port`.
    """
    cards = {name: _component(deployment, name, wires) for name in deployment.components}
    hosts = {host: [*_devices(deployment, host), *_cards_on(deployment, host, cards)] for host in deployment.hosts}
    right, bottom = MARGIN, 0.0
    body: list[str] = []
    for host, inside in hosts.items():
        width = max([*map(_width, inside), len(_host_text(deployment, host)) * CHARACTER, 120.0]) + 2 * PADDING
        height = TITLE + sum(one.height + GAP for one in inside)
        y = MARGIN + TITLE
        for one in inside:
            one.x, one.y, one.width = right + PADDING, y, width - 2 * PADDING
            y += one.height + GAP
        body += _frame(deployment, host, svg.area(right, MARGIN, width, height), right)
        right, bottom = right + width + BETWEEN, max(bottom, MARGIN + height)
    body += [line for number, wire in enumerate(wires.items()) for line in _wire(*wire, cards, number)]
    body += [line for inside in hosts.values() for one in inside for line in _card(one)]
    return svg.document(f"deployment {deployment.name}", right - BETWEEN / 2, bottom + MARGIN, _STYLE, body)


def _component(deployment: Deployment, name: str, wires: Mapping[str, str]) -> _Card:
    found = deployment.components[name].demands(None)
    lines = [f"{text}{f' in {path[-1]}' if path else ''}" for path, one in found for text in _needs(deployment, one)]
    ports = [port for wire in wires.items() for port in wire if port.partition(".")[0] == name]
    return _Card(name, "", lines, list(dict.fromkeys(ports)))


def _needs(deployment: Deployment, demand: Demand) -> Iterator[str]:
    yield from (f"needs {wanted}" for wanted in demand.hardware)
    yield from (deployment.amount(*one) for one in demand.resources.items())
    for name, task in demand.tasks.items():
        yield f"{name}: {task.worst_case:g} s every {task.period:g} s, core {task.core}"


def _devices(deployment: Deployment, host: str) -> Iterator[_Card]:
    for name, device in deployment.devices.items():
        if device.host == host:
            yield _Card(name, f"{device.kind}, shared" if device.shared else device.kind, [])


def _cards_on(deployment: Deployment, host: str, cards: Mapping[str, _Card]) -> Iterator[_Card]:
    return (card for name, card in cards.items() if deployment.host_of(name) == host)


def _width(card: _Card) -> float:
    texts = (card.title, card.kind, *card.lines, *(_port_text(card, port) for port in card.ports))
    return max(map(len, texts)) * CHARACTER + 2 * PADDING


def _port_text(card: _Card, port: str) -> str:
    return port.removeprefix(f"{card.title}.")


def _host_text(deployment: Deployment, host: str) -> str:
    found = deployment.hosts[host]
    platform = deployment.platforms[found.platform]
    parts = [
        found.platform,
        number_text(platform.cores, "core"),
        platform.scheduling.replace("_", " "),
    ]
    return ", ".join([*parts, *(deployment.amount(*one) for one in deployment.capacity(host).items())])


def _frame(deployment: Deployment, host: str, area: str, x: float) -> Iterator[str]:
    fill, border = svg.GREY
    yield f'<rect {area} rx="9" fill="{fill}" stroke="{border}" stroke-width="1.4"/>'
    left = svg.number(x + PADDING)
    yield f'<text class="name" x="{left}" y="{svg.number(MARGIN + 18)}">{svg.escaped(host)}</text>'
    text = svg.escaped(_host_text(deployment, host))
    yield f'<text class="kind" x="{left}" y="{svg.number(MARGIN + 35)}">{text}</text>'


def _card(one: _Card) -> Iterator[str]:
    fill, border = svg.ORANGE if one.kind else svg.BLUE
    area = svg.area(one.x, one.y, one.width, one.height)
    yield f'<rect {area} rx="6" fill="{fill}" stroke="{border}" stroke-width="1.3"/>'
    texts = [("name", one.title), ("kind", one.kind), *(("line", line) for line in one.lines)]
    texts += [("line", _port_text(one, port)) for port in one.ports]
    for number, (style, text) in enumerate(text for text in texts if text[1]):
        y = svg.number(one.y + (number + 1) * LINE)
        yield f'<text class="{style}" x="{svg.number(one.x + PADDING)}" y="{y}">{svg.escaped(text)}</text>'


def _wire(required: str, provided: str, cards: Mapping[str, _Card], number: int) -> Iterator[str]:
    """Yield a curve from the provided port to the required one; the ends in one host are on the same side."""
    target, source = cards[required.partition(".")[0]], cards[provided.partition(".")[0]]
    rightwards = source.x <= target.x
    begin = (source.x + source.width if rightwards else source.x, source.port(provided))
    end = (target.x if source.x < target.x else target.x + target.width, target.port(required))
    bend = 60.0 + 6 * (number % 4)
    out = begin[0] + bend if rightwards else begin[0] - bend
    into = end[0] - bend if source.x < target.x else end[0] + bend
    colour = _WIRES[number % len(_WIRES)]
    base, head = svg.arrowhead((into, end[1]), end)
    curve = f"M{svg.point(begin)}C{svg.point((out, begin[1]))} {svg.point((into, end[1]))} {svg.point(base)}"
    yield f'<path class="wire" d="{curve}" stroke="{colour}"/>'
    yield f'<path d="{head}" fill="{colour}"/>'
