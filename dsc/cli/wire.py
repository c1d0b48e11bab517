"""Commands `dsc ps` and `dsc call`: the components that programs of a realm host, and calls of them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from knowledge_base.cli.console import Json, print_line
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from dsc.outcomes import Outcome
    from dsc.wire.remote import RemoteComponent
    from dsc.wire.zenoh_transport import ZenohTransport

T = TypeVar("T")
Realm = Annotated[str, typer.Option(metavar="NAME", help="The name that all programs of the robot share.")]
Connect = Annotated[
    list[str] | None,
    typer.Option(
        "--connect", metavar="ENDPOINT", help="Where another program listens, e.g. tcp/192.168.0.7:7447; repeatable."
    ),
]
ZenohFile = Annotated[
    Path | None, typer.Option("--zenoh", metavar="FILE", help="Zenoh's own settings, e.g. certificates.")
]
REALM = "dsc"
"""The realm of programs that name none."""
FAILED = 1
"""Exit status of a call that the component could not execute."""


def ps_command(realm: Realm = REALM, connect: Connect = None, zenoh: ZenohFile = None, as_json: Json = False) -> None:
    """List the components that programs host, with their state."""
    found = with_transport(_describe, realm, connect, zenoh)
    if as_json:
        print_line(found)
        return
    for one in found:
        reason = f": {one['reason']}" if one["reason"] else ""
        typer.echo(f"{one['name']:16} {one['life']:10} {one['mode'] or '-':10} {', '.join(one['skills'])}{reason}")
    if not found:
        typer.echo(f"no program hosts a component in the realm '{realm}'; start one: dsc host TARGET")


def call_command(
    what: Annotated[str, typer.Argument(metavar="COMPONENT[.SKILL]", help="The component, or one of its skills.")],
    arguments: Annotated[list[str] | None, typer.Argument(metavar="NAME=VALUE...", help="Arguments, in YAML.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; repeatable.")
    ] = None,
    switch: Annotated[str | None, typer.Option(metavar="MODE", help="Enter a mode.")] = None,
    diagnose: Annotated[bool, typer.Option("--diagnose", help="Ask the component for its diagnosis.")] = False,
    within: Annotated[float, typer.Option(min=0.0, help="Seconds until the skill is cancelled.")] = 60.0,
    realm: Realm = REALM,
    connect: Connect = None,
    zenoh: ZenohFile = None,
    as_json: Json = False,
) -> None:
    """Call a skill of a hosted component, or show and set the component's parameters.

    Without a skill, prints the component's skills, parameters and state. Exit status 1: the component could not do it.
    """
    from dsc.errors import ProgrammingError, SkillError

    component, _, skill = what.partition(".")
    given, values = _pairs(arguments or []), _pairs(set_ or [])
    if given and not skill:
        raise InputError(f"arguments are for a skill: name it as {component}.SKILL", found=what)

    async def act(transport: ZenohTransport) -> Any:
        from dsc.wire.realm import connect_all

        (remote,) = await connect_all([component], transport)
        for name, value in values.items():
            await remote.configure(name, value)
        if switch is not None:
            await remote.change_mode(switch)
        if skill:
            return _form(await _execute(remote, skill, given, within))
        return await remote.diagnose() if diagnose else _hull(remote)

    try:
        found = with_transport(act, realm, connect, zenoh)
    except (SkillError, ProgrammingError) as error:
        typer.echo(f"{what}: {error}", err=True)
        raise typer.Exit(FAILED) from None
    if as_json:
        print_line(found)
    else:
        from dsc.text.yaml import dump

        typer.echo(dump(found).rstrip())


def with_transport(
    act: Callable[[ZenohTransport], Awaitable[T]], realm: str, connect: list[str] | None, zenoh: Path | None
) -> T:
    """Return the result of `act` with a transport of the realm; errors as for `dsc.wire.client_transport`."""
    import asyncio

    from dsc.wire.realm import client_transport

    async def main() -> T:
        with client_transport(realm, connect or (), zenoh) as transport:
            return await act(transport)

    return asyncio.run(main())


async def _describe(transport: ZenohTransport) -> list[dict[str, Any]]:
    from dsc.wire.realm import SOON, connect_all, hosted_names

    names = await hosted_names(transport, SOON)
    return [_hull(one) for one in await connect_all(names, transport)]


def _hull(remote: RemoteComponent) -> dict[str, Any]:
    """Return the hull of a component (S1.22): its state, skills and parameters."""
    condition = remote.condition
    return {
        "name": remote.name,
        "life": str(condition["life"]),
        "reason": condition["reason"],
        "mode": condition["mode"],
        "skills": sorted(remote.skills()),
        "parameters": dict(remote.parameters.items()),
    }


async def _execute(remote: RemoteComponent, skill: str, arguments: dict[str, Any], within: float) -> Outcome:
    """Execute a skill, with its reports on standard error, and return its outcome."""
    import asyncio
    from secrets import token_hex

    from dsc.calls import SkillCall
    from dsc.data_types import check_all
    from dsc.sequencer.clock import LoopClock
    from dsc.skills import check_arguments
    from knowledge_base.errors import UnknownNameError

    if skill not in remote.skills():
        message = f"the component '{remote.name}' has no skill '{skill}'"
        raise UnknownNameError(message, found=skill, valid=remote.skills())
    signature = remote.skills()[skill]
    check_arguments(signature, arguments)
    check_all(
        "the argument '{name}' of skill {owner}",
        f"'{remote.name}.{skill}'",
        arguments,
        signature.parameters,
        signature.records,
    )
    clock, action = LoopClock(), f"{token_hex(6)}/call"
    call: SkillCall[Any] = SkillCall(action, clock, _show_report, clock.now() + within)
    try:
        async with asyncio.timeout(within):
            return await remote.execute(skill, call, arguments)
    finally:
        await remote.forget(action)


def _show_report(report: Outcome) -> None:
    """Print a report on standard error; observations and records are for robots."""
    if not report.event.startswith("("):
        typer.echo(_form(report), err=True)


def _form(outcome: Outcome) -> dict[str, Any]:
    return {"event": outcome.event, **outcome.attributes}


def _pairs(texts: list[str]) -> dict[str, Any]:
    """Return the values of texts `NAME=VALUE`, which are YAML."""
    from dsc.text.yaml import load_document

    return {name: load_document(f"value: {value}", name).data["value"] for name, value in texts_by_name(texts).items()}


def texts_by_name(texts: Iterable[str]) -> dict[str, str]:
    """Return the values of texts `NAME=VALUE`; raise `InputError` for a text of another form."""
    found = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not (name and sign):
            raise InputError(f"a parameter is written NAME=VALUE, not '{text}'", found=text)
        found[name] = value
    return found
