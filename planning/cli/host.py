"""Command `dsc host`: offer the components of a robot, or its plots, to other programs of a realm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dsc.cli.logs import Quiet, Verbose, show_logs
from dsc.cli.wire import REALM, Connect, Realm, ZenohFile
from knowledge_base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from dsc.components.component import Component
    from dsc.text.profiles import Profile
    from dsc.wire.host import Host
    from dsc.wire.service_manager import ServiceManager
    from dsc.wire.zenoh_transport import ZenohTransport
    from planning.robot.bundles import Bundle
    from planning.robot.robot import Robot


def host_command(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="The robot, as for dsc run.")],
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="COMPONENT", help="Host only this component; repeatable.")
    ] = None,
    plots: Annotated[
        str | None, typer.Option("--plots", metavar="NAME", help="Host the robot's plots instead, as this component.")
    ] = None,
    private: Annotated[
        bool, typer.Option("--private", help="With --plots, keep the planning domain and the knowledge inside.")
    ] = False,
    replace: Annotated[
        bool,
        typer.Option("--replace", help="Take over from a program that hosts the same components, e.g. one that hangs."),
    ] = False,
    supervised: Annotated[
        bool,
        typer.Option("--supervised", help="Start the program again when it crashes or hangs, with growing delays."),
    ] = False,
    profile: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="The robot, its parameters and its wiring, as for dsc run.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the simulation's faults.")] = None,
    faults: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Chance of a fault per skill call.")] = None,
    realm: Realm = REALM,
    listen: Annotated[
        list[str] | None, typer.Option("--listen", metavar="ENDPOINT", help="Listen here, e.g. tcp/0.0.0.0:7447.")
    ] = None,
    connect: Connect = None,
    zenoh: ZenohFile = None,
    verbose: Verbose = 0,
    quiet: Quiet = False,
) -> None:
    """Host the components of a robot until Ctrl-C, in real time.

    Programs of one machine meet without options. On several machines, one program listens and the others connect.
    """
    import asyncio
    from pathlib import Path

    from dsc.text.profiles import find_profile
    from dsc.wire.realm import host_transport
    from planning.robot.targets import bundle_at

    show_logs(verbose, quiet=quiet)
    if private and plots is None:
        raise InputError("a program hosts components, which are never private, or plots: give --plots")
    bundle = bundle_at(target)
    if supervised:
        raise typer.Exit(_supervise())

    settings = None if profile is None else find_profile(profile, bundle.profiles or Path())

    async def main() -> None:
        with host_transport(realm, listen or (), connect or (), zenoh) as transport:
            if plots is None:
                found = _devices(bundle, only or [], seed, faults, settings)
                await _host(found, transport, replace=replace)
                return
            if only:
                raise InputError("a program hosts components, or plots: give --only, or --plots")
            with await _robot(bundle, seed, faults, settings, transport) as robot:
                await _host([_component(plots, robot, private=private)], transport, replace=replace)

    asyncio.run(main())


def _supervise() -> int:
    """Run this command as a program that is started again, and return its exit status."""
    import sys

    from planning.cli.supervision import Supervisor

    command = [one for one in sys.argv if one != "--supervised"]
    return Supervisor([sys.executable, *command], lambda line: typer.echo(line, err=True)).run()


def _devices(
    bundle: Bundle, only: list[str], seed: int | None, faults: float | None, profile: Profile | None
) -> list[Component]:
    """Return the components of a bundle, or some of them; each of their required ports has a source."""
    from planning.robot.bringup import devices

    found = {one.name: one for one in devices(bundle, seed=seed, faults=faults, profile=profile)}
    for name in only:
        if name not in found:
            raise UnknownNameError(f"'{bundle.name}' has no component '{name}'", found=name, valid=found)
    if not found:
        raise InputError(f"'{bundle.name}' has no components to host; --plots NAME hosts its plots", found=bundle.name)
    hosted = {name: one for name, one in found.items() if not only or name in only}
    _name_sources(hosted, found, bundle)
    return list(hosted.values())


def _name_sources(hosted: dict[str, Component], found: dict[str, Component], bundle: Bundle) -> None:
    """Choose the providers of the hosted components; without remote components, each port must have one."""
    from dsc.components.wiring import name_sources, wiring_errors

    for port, error in () if bundle.remote else wiring_errors(found.values()):
        if port.name.partition(".")[0] in hosted:
            raise error
    name_sources(hosted.values(), found.values())


async def _robot(
    bundle: Bundle, seed: int | None, faults: float | None, profile: Profile | None, transport: ZenohTransport
) -> Robot:
    """Return the robot of a bundle, connected to its remote components."""
    from dsc.wire.realm import connect_all
    from planning.robot.bringup import deploy

    remote = await connect_all(bundle.remote, transport)
    return deploy(bundle, seed=seed, faults=faults, profile=profile, clock="real", remote=remote)


def _component(name: str, robot: Robot, *, private: bool) -> Component:
    from planning.robot.robot_component import RobotComponent

    return RobotComponent(name, robot, private=private)


async def _host(components: list[Component], transport: ZenohTransport, *, replace: bool) -> None:
    """Host the components until SIGINT or SIGTERM, or until later hosts have taken over."""
    import asyncio
    import signal
    from contextlib import suppress

    from dsc.sequencer.clock import LoopClock
    from dsc.wire.host import Host
    from dsc.wire.hosted_wiring import HostedWiring
    from dsc.wire.realm import SOON, hosted_names
    from dsc.wire.service_manager import READY, ServiceManager

    taken = [] if replace else await hosted_names(transport, SOON)
    for one in components:
        if one.name in taken:
            message = f"another program hosts '{one.name}' in the realm '{transport.realm}': end it, or --replace it"
            raise InputError(message, found=one.name)
    hosts = [Host(one, transport, LoopClock()) for one in components]
    wires = asyncio.create_task(HostedWiring(components, transport).run())
    names = ", ".join(one.name for one in components)
    typer.echo(f"hosting {names} in the realm '{transport.realm}'; Ctrl-C ends it")
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows
            loop.add_signal_handler(number, ended.set)
    manager = ServiceManager()
    manager.notify(READY)
    waiting = [loop.create_task(one) for one in (ended.wait(), _all_replaced(hosts), _until_alone(manager))]
    await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
    for task in waiting:
        task.cancel()
    wires.cancel()
    for host in hosts:
        await host.close()
    if not ended.is_set() and all(host.replaced.is_set() for host in hosts):
        raise InputError("later hosts have taken over all components")


async def _until_alone(manager: ServiceManager) -> None:
    """Send signs of life until the supervisor has ended; without a supervisor, wait."""
    import asyncio

    if manager.address is None:
        await asyncio.Event().wait()
    await manager.watch()


async def _all_replaced(hosts: list[Host]) -> None:
    for host in hosts:
        await host.replaced.wait()
