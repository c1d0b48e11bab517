"""Timelines: the schedule of each core after a common release of all its tasks, as SVG (S1.12)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.deployment.cores import Core, cores_of
from dsc.deployment.model import Deployment
from dsc.deployment.schedule import Job, Schedule
from dsc.deployment.tasks import Task
from dsc.deployment.words import in_mode, shown_time
from knowledge_base import svg

WIDTH = 900.0
"""Width of the time axis in pixels; all lengths are in pixels."""
ROW = 34.0
HEAD = 46.0
"""Height of a core's own texts, and of its time axis."""
MARGIN = 18.0
MOST_SHOWN = 24
"""Maximum number of jobs of the most frequent task in a timeline."""
_LATE = "#b3261e"
_LEGEND = "triangles: arrivals; long bars: deadlines; boxes: executions, red if they end after their deadline"
_STYLE = (
    f"text{{{svg.FONTS};font-size:12px;fill:{svg.DETAIL}}}.name{{font-weight:bold;fill:{svg.INK}}}"
    f".small{{font-size:11px;fill:{svg.SOFT}}}.axis{{stroke:{svg.SOFT};stroke-width:1}}.mid{{text-anchor:middle}}"
    f".grid{{stroke:#e2e8f0;stroke-width:1}}"
)


def draw_worst_cases(deployment: Deployment) -> str:
    """Return the worst case of each core over time as an SVG document.

    Bars are executions, triangles are arrivals, and bars on the axis are deadlines. A late execution is red.
    """
    cores = list(cores_of(deployment))
    names = max((len(task.name) for core in cores for task in core.tasks), default=10)
    left = MARGIN + names * 7.0 + 12
    body: list[str] = []
    y = MARGIN
    for core in cores:
        body += _core(core, left, y)
        y += 2 * HEAD + len(core.tasks) * ROW
    note = _LEGEND if cores else "the components have no real-time tasks"
    body.append(f'<text class="small" x="{svg.number(MARGIN)}" y="{svg.number(y)}">{note}</text>')
    y += MARGIN
    return svg.document(f"worst cases of {deployment.name}", left + WIDTH + 2 * MARGIN, y, _STYLE, body)


def _core(core: Core, left: float, top: float) -> Iterator[str]:
    schedule = core.worst_schedule()
    until = min(schedule.until, MOST_SHOWN * min(task.period for task in core.tasks))
    scale = WIDTH / until
    text = f"{core.host}, core {core.number}{in_mode(core.mode)}: {core.utilisation:.0%} of its time"
    yield f'<text class="name" x="{svg.number(MARGIN)}" y="{svg.number(top + 14)}">{svg.escaped(text)}</text>'
    bottom = top + HEAD + len(core.tasks) * ROW
    for number in range(11):
        x = svg.number(left + WIDTH * number / 10)
        yield f'<line class="grid" x1="{x}" x2="{x}" y1="{svg.number(top + HEAD - 10)}" y2="{svg.number(bottom)}"/>'
        label = shown_time(until * number // 10)
        yield f'<text class="small mid" x="{x}" y="{svg.number(bottom + 16)}">{label}</text>'
    for number, task in enumerate(core.tasks):
        yield from _task(task, schedule, left, top + HEAD + (number + 1) * ROW - 8, until, scale)


def _task(task: Task, schedule: Schedule, left: float, axis: float, until: int, scale: float) -> Iterator[str]:
    """Yield the row of a task: its name, the slices of its jobs, their arrivals and their deadlines."""
    late = set(schedule.misses)
    yield f'<text x="{svg.number(MARGIN)}" y="{svg.number(axis - 3)}">{svg.escaped(task.name)}</text>'
    yield f'<line class="axis" {svg.ends((left, axis), (left + WIDTH, axis))}/>'
    jobs = dict.fromkeys(one.job for one in schedule.slices if one.job is not None and one.job.task == task)
    for one in schedule.slices:
        if one.job in jobs and one.begin < until:
            fill, border = (_LATE, _LATE) if one.job in late else (svg.BLUE[1], svg.BLUE[1])
            area = svg.area(left + one.begin * scale, axis - 16, (min(one.end, until) - one.begin) * scale, 16)
            yield f'<rect {area} fill="{fill}" fill-opacity="0.75" stroke="{border}" stroke-width="0.8"/>'
    yield from _marks(jobs, left, axis, until, scale)


def _marks(jobs: dict[Job, None], left: float, axis: float, until: int, scale: float) -> Iterator[str]:
    for job in jobs:
        if 0 <= job.arrival <= until:
            x = left + job.arrival * scale
            corners = ((x, axis - 24), (x - 4, axis - 17), (x + 4, axis - 17))
            yield f'<path d="M{"L".join(map(svg.point, corners))}Z" fill="{svg.GREEN[1]}"/>'
        if job.due <= until:
            x = left + job.due * scale
            yield f'<line {svg.ends((x, axis - 20), (x, axis + 5))} stroke="{svg.ORANGE[1]}" stroke-width="2"/>'
