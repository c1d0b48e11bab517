from dsc.wire.endpoint import Endpoint as Endpoint
from dsc.wire.endpoint import LocalTransport as LocalTransport
from dsc.wire.endpoint import Transport as Transport
from dsc.wire.heartbeat import Heartbeat as Heartbeat
from dsc.wire.host import Host as Host
from dsc.wire.remote import RemoteComponent as RemoteComponent
from dsc.wire.zenoh_transport import ZenohTransport as ZenohTransport
