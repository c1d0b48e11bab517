"""Command `dsc monitor`: observes hosted components by a monitoring profile."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsc.cli.wire import REALM, Connect, Realm, ZenohFile, with_transport
from knowledge_base.cli.console import Json

if TYPE_CHECKING:
    from dsc.monitoring.monitor import Observation
    from dsc.wire.zenoh_transport import ZenohTransport


def monitor_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A monitoring profile (YAML).")],
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after this time.  [default: at Ctrl-C]")] = None,
    svg: Annotated[Path | None, typer.Option(metavar="OUT.svg", help="Draw the values over time at the end.")] = None,
    realm: Realm = REALM,
    connect: Connect = None,
    zenoh: ZenohFile = None,
    as_json: Json = False,
) -> None:
    """Print selected information about hosted components, periodically or at each change.

    With --json, each observation is one JSON line with seconds, component, entry and value.
    """
    from contextlib import suppress

    from dsc.monitoring.charts import draw_observations
    from dsc.monitoring.profile import load_monitoring
    from knowledge_base.output_files import Output

    profile = load_monitoring(file)
    output = None if svg is None else Output(svg, "--svg", file)
    found: list[Observation] = []

    def receive(one: Observation) -> None:
        if output is not None:
            found.append(one)
        _print(one, as_json=as_json)

    async def observe(transport: ZenohTransport) -> None:
        import asyncio

        from dsc.monitoring.monitor import Monitor
        from dsc.wire.realm import connect_all

        remote = {one.name: one for one in await connect_all([*profile.components], transport)}
        for one in remote.values():
            one.watch(watching=True)
        monitor = Monitor(profile, remote, receive)
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await monitor.run()

    with suppress(KeyboardInterrupt):
        with_transport(observe, realm, connect, zenoh)
    if output is not None:
        output.write(draw_observations(profile.name, found))


def _print(one: Observation, *, as_json: bool) -> None:
    import json
    import sys
    from dataclasses import asdict

    from dsc.model.reading import in_yaml

    if as_json:
        typer.echo(json.dumps(asdict(one)))
    else:
        is_plain = isinstance(one.value, str | int | float | None)
        shown = in_yaml(one.value) if is_plain else json.dumps(one.value)
        typer.echo(f"{one.seconds:10.3f} {one.component}.{one.entry} {shown}")
    sys.stdout.flush()
