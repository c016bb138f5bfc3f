#!/bin/sh
# modbus-serial 8.0.25 (npm): a set-point that is NaN is written as 0, and one of 28.99999 as 28.
#
# A controller's output, written to a register by `writeRegister` and `writeRegisters`. A computation that failed, NaN,
# is sent as 0, which opens the valve to one side; 0.29 times 100 is 28.999999999999996, and sent as 28. Numbers beyond
# 16 bits are refused, -5 with them, though it is read back as 65531 where a drive has it. Nothing warns. Test for NaN
# and round before writing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . modbus-serial@8.0.25
cat >run.mjs <<'END'
import { createRequire } from "module";

const ModbusRTU = createRequire(import.meta.url)("modbus-serial");
const registers = new Map();
const server = new ModbusRTU.ServerTCP(
  {
    setRegister: (address, value) => registers.set(address, value),
    getHoldingRegister: (address) => registers.get(address) ?? 0,
  },
  { host: "127.0.0.1", port: 15021, unitID: 1 },
);
await new Promise((resolve) => server.once("initialized", resolve));
const client = new ModbusRTU();
await client.connectTCP("127.0.0.1", { port: 15021 });
client.setID(1);
for (const value of [29, 0.29 * 100, 28.5, NaN, undefined, -5, 70000]) {
  const said = [];
  for (const write of [() => client.writeRegister(0, value), () => client.writeRegisters(0, [value])]) {
    try {
      await write();
      said.push(registers.get(0));
    } catch (error) {
      said.push(error.name);
    }
  }
  console.log(`${value}: register ${said.join(", registers ")}`);
}
registers.set(1, 65531);
console.log("a drive's -5 is read as", (await client.readHoldingRegisters(1, 1)).data[0]);
client.close(() => {});
server.close(() => process.exit());
setTimeout(() => process.exit(), 1000);
END
node run.mjs | tee seen
diff - seen <<'END'
29: register 29, registers 29
28.999999999999996: register 28, registers 28
28.5: register 28, registers 28
NaN: register 0, registers 0
undefined: register 0, registers 0
-5: register RangeError, registers RangeError
70000: register RangeError, registers RangeError
a drive's -5 is read as 65531
END
