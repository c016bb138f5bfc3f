#!/bin/sh
# asyncua 2.1.0: a sensor that the controller calls uncertain reads as good, or raises, by the call that asks.
#
# A pressure of 6 bar with a status (OPC UA). `read_value` raises where the status is uncertain, as where it is bad.
# `read_values`, of the same node, and a subscription hand over the number; in the first the status is gone. Of a bad status the
# last usable value, which the controller sends with it, arrives as None everywhere. A repeated 6.0 with a new stamp
# is not announced to a subscription, so that its rows are sparse; a repeated NaN is announced each time.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asyncua==2.1.0
v/bin/python -W ignore - <<'END' | tee seen
import asyncio
import logging
import socket

from asyncua import Client, Server, ua

logging.disable(logging.CRITICAL)


async def main():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"opc.tcp://127.0.0.1:{free.getsockname()[1]}/"
    server, heard = Server(), []
    await server.init()
    server.set_endpoint(address)
    p1 = await server.nodes.objects.add_variable(await server.register_namespace("rig"), "p1", 0.0)

    class Handler:
        def datachange_notification(self, node, value, data):
            heard.append((value, data.monitored_item.Value.StatusCode.name))

    async with server, Client(address) as client:
        node = client.get_node(p1.nodeid)
        await (await client.create_subscription(20, Handler())).subscribe_data_change(node)
        await asyncio.sleep(0.3)

        async def write(value, status="Good"):
            await p1.write_value(ua.DataValue(ua.Variant(value), ua.StatusCode(getattr(ua.StatusCodes, status))))
            await asyncio.sleep(0.2)

        for status in ("Good", "UncertainSensorNotAccurate", "BadSensorFailure"):
            await write(6.0, status)
            try:
                single = await node.read_value()
            except ua.UaError:
                single = "raises"
            print(f"{status:26s} read_value {single}, read_values {await client.read_values([node])}, subscription {heard[-1]}")
        for value in (6.0, float("nan")):
            await write(1.0)
            heard.clear()
            for _ in range(3):
                await write(value)
            print(f"{value} three times: {len(heard)} announced")


asyncio.run(main())
END
diff - seen <<'END'
Good                       read_value 6.0, read_values [6.0], subscription (6.0, 'Good')
UncertainSensorNotAccurate read_value raises, read_values [6.0], subscription (6.0, 'UncertainSensorNotAccurate')
BadSensorFailure           read_value raises, read_values [None], subscription (None, 'BadSensorFailure')
6.0 three times: 1 announced
nan three times: 3 announced
END
