#!/bin/sh
# planck 1.4.2 (npm): a piston below 1 m/s does not rebound from its stop; one at 4 mm/s stops after 2 mm.
#
# Box2D's solver in metres and seconds. With a restitution of 0.8, 1.1 m/s comes back as 0.88 m/s, and 0.9 m/s as 0:
# below `velocityThreshold`, 1 m/s, an impact is without rebound. A body slower than 10 mm/s for half a second is put
# to sleep, and stands, though nothing brakes it: neither its velocity nor a warning says why. Nothing moves faster
# than 120 m/s at 60 steps a second (2 m in a step). Set `Settings.velocityThreshold` and `allowSleep: false` before a
# simulated axis is compared.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . planck@1.4.2
cat >run.mjs <<'END'
import { Box, Settings, Vec2, World } from "planck";

function piston(speed, options) {
  const world = new World({ gravity: Vec2(0, 0), ...options });
  const body = world.createBody({ type: "dynamic", bullet: true });
  body.createFixture({ shape: new Box(0.1, 0.1), density: 25, friction: 0, restitution: 0.8 });
  body.setLinearVelocity(Vec2(speed, 0));
  return [world, body];
}

function rebound(speed) {
  const [world, body] = piston(speed);
  world.createBody().createFixture({ shape: new Box(0.1, 1, Vec2(0.5, 0)), friction: 0, restitution: 0.8 });
  for (let step = 0; step < 3000; step += 1) world.step(1e-3);
  return -body.getLinearVelocity().x / speed;
}

for (const speed of [3, 1.1, 0.9, 0.2]) console.log(`${speed} m/s: share that comes back ${rebound(speed).toFixed(2)}`);
Settings.velocityThreshold = 0.01;
console.log(`0.9 m/s, threshold of 0.01 m/s: ${rebound(0.9).toFixed(2)}`);
for (const options of [{}, { allowSleep: false }]) {
  const [world, body] = piston(0.004, options);
  for (let step = 0; step < 5000; step += 1) world.step(1e-3);
  const moved = `${(body.getPosition().x * 1000).toFixed(1)} mm in 5 s`;
  console.log(`4 mm/s ${JSON.stringify(options)}: ${moved}, awake ${body.isAwake()}`);
}
const [world, body] = piston(150);
for (let step = 0; step < 60; step += 1) world.step(1 / 60);
console.log(`150 m/s: ${body.getPosition().x.toFixed(1)} m in 1 s`);
END
node run.mjs | tee seen
diff - seen <<'END'
3 m/s: share that comes back 0.80
1.1 m/s: share that comes back 0.80
0.9 m/s: share that comes back 0.00
0.2 m/s: share that comes back 0.00
0.9 m/s, threshold of 0.01 m/s: 0.80
4 mm/s {}: 2.0 mm in 5 s, awake false
4 mm/s {"allowSleep":false}: 20.0 mm in 5 s, awake true
150 m/s: 120.0 m in 1 s
END
