#!/bin/sh
# asyncua 2.1.0: with a deadband of 0.5 bar, a server tells nobody of a pressure that creeps from 6 to 10 bar.
#
# A client subscribes to a node of an asyncua server with an absolute deadband of 0.5 (`deadband_monitor`), and the server writes a pressure that
# moves on. The server compares each value with the one written before, not with the last one that it sent, as the standard asks
# (OPC UA part 8). In steps of 0.1 bar from 6 to 10, or of 0.04 from 6 to 2, nothing is sent after the first value; in steps of
# 0.6 each is. A client that holds the last value sees a leak as a constant pressure.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asyncua==2.1.0
v/bin/python -W ignore - <<'END' | tee seen
import asyncio
import logging

from asyncua import Client, Server

logging.disable(logging.CRITICAL)
URL = "opc.tcp://127.0.0.1:48413/"


class Handler:
    def __init__(self):
        self.got = []

    def datachange_notification(self, node, value, data):
        self.got.append(round(value, 2))


async def main():
    server = Server()
    await server.init()
    server.set_endpoint(URL)
    space = await server.register_namespace("rig")
    pressure = await server.nodes.objects.add_variable(space, "p1", 6.0)
    async with server, Client(URL) as client:
        for step, count in ((0.1, 40), (-0.04, 100), (0.6, 5)):
            await pressure.write_value(6.0)
            handler = Handler()
            subscription = await client.create_subscription(50, handler)
            await subscription.deadband_monitor(client.get_node(pressure.nodeid), 0.5)
            await asyncio.sleep(0.3)
            for number in range(1, count + 1):
                await pressure.write_value(6.0 + step * number)
                await asyncio.sleep(0.01)
            await asyncio.sleep(0.5)
            await subscription.delete()
            print(f"from 6 in {count} steps of {step} to {6 + step * count:g} bar: sent", *handler.got)


asyncio.run(main())
END
diff - seen <<'END'
from 6 in 40 steps of 0.1 to 10 bar: sent 6.0
from 6 in 100 steps of -0.04 to 2 bar: sent 6.0
from 6 in 5 steps of 0.6 to 9 bar: sent 6.0 6.6 7.2 7.8 8.4 9.0
END
