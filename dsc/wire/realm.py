"""Realms: the programs of one robot that meet on Zenoh, and the components that they host."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from pathlib import Path

from dsc.errors import NoAnswerError, RefusedError
from dsc.wire.remote import RemoteComponent
from dsc.wire.zenoh_transport import IN_USE, LOOPBACK, ZenohTransport
from knowledge_base.errors import InputError, UnknownNameError

MEETING = "tcp/127.0.0.1:7447"
"""The endpoint where the programs of one machine meet by default: the first host listens there."""
SOON = 1.0
"""Seconds within which a transport has connected to programs that run."""
_AGAIN = 0.05
PATIENCE = 10.0
"""Default seconds for which a program waits for the components that others host."""


def host_transport(
    realm: str, listen: Collection[str] = (), connect: Collection[str] = (), config: Path | None = None
) -> ZenohTransport:
    """Return the transport of a program that hosts components; without endpoints, it meets others at `MEETING`.

    Raises:
        InputError: as for `ZenohTransport`.
    """
    if listen or connect or config is not None:
        return ZenohTransport(realm, listen=listen or None, connect=connect or None, config=config)
    try:
        return ZenohTransport(realm, listen=[MEETING])
    except InputError as error:
        if IN_USE not in str(error):
            raise
        return ZenohTransport(realm, listen=LOOPBACK, connect=[MEETING])  # another host of this machine was first


def client_transport(realm: str, connect: Collection[str] = (), config: Path | None = None) -> ZenohTransport:
    """Return the transport of a program that uses components; without endpoints, it meets others at `MEETING`.

    Raises:
        InputError: as for `ZenohTransport`.
    """
    wanted = list(connect) or ([MEETING] if config is None else None)
    return ZenohTransport(realm, connect=wanted, config=config)


async def connect_all(
    names: Collection[str], transport: ZenohTransport, within: float = PATIENCE
) -> list[RemoteComponent]:
    """Return the components of these names, which other programs host; wait for those that start later.

    Raises:
        UnknownNameError: no program has hosted a component within that time; the message has the hosted ones.
    """
    found = await asyncio.gather(*(_connect(name, transport, within) for name in names))
    missing = [name for name, one in zip(names, found, strict=True) if one is None]
    if missing:
        message = (
            f"no program hosts the component '{missing[0]}' in the realm '{transport.realm}' (`dsc host TARGET` does)"
        )
        raise UnknownNameError(message, found=missing[0], valid=await hosted_names(transport))
    return [one for one in found if one is not None]


async def hosted_names(transport: ZenohTransport, within: float = 0.0) -> list[str]:
    """Return the names of all components that programs of the realm host, in order.

    Without any, wait up to `within` seconds, as the transport may still connect.
    """
    loop = asyncio.get_running_loop()
    until = loop.time() + within
    while True:
        found = sorted(name for name in await transport.addresses() if " " not in name)  # clients have a blank
        if found or loop.time() >= until:
            return found
        await asyncio.sleep(_AGAIN)


async def _connect(name: str, transport: ZenohTransport, within: float) -> RemoteComponent | None:
    loop = asyncio.get_running_loop()
    until = loop.time() + within
    while (left := until - loop.time()) > 0:
        try:
            return await RemoteComponent.connect(name, transport, min(left, 1.0))
        except NoAnswerError:
            continue
        except RefusedError as error:
            raise InputError(str(error), found=name) from error
    return None
