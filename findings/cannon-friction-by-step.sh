#!/bin/sh
# cannon-es 0.20.0 (npm): a block that slides at 3 m/s stops after three time steps, however short they are.
#
# A flat block of 1 kg on a plane, with the friction of 0.3 that all materials have by default, should slide 1.53 m in
# 1.02 s. It stops within three steps: in 50 ms with 60 steps a second, in 3 ms with 1000. The solver takes the limit of
# friction, a force, for an impulse, and that at each of four contacts, so that friction is four times as strong over a
# step of 1 s, and 4000 times over 1 ms; a push of 100 N, where 2.9 N suffice, moves nothing. Without contact a body
# still loses 1 % of its speed in a second (linearDamping). Nothing warns. State a friction of 0, and add that of the
# seal as a force.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . cannon-es@0.20.0
cat >run.mjs <<'END'
import { Body, Box, Plane, Vec3, World } from "cannon-es";

function block(friction, speed) {
  const world = new World({ gravity: new Vec3(0, 0, -9.81) });
  if (friction !== undefined) world.defaultContactMaterial.friction = friction;
  world.addBody(new Body({ mass: 0, shape: new Plane() }));
  const shape = new Box(new Vec3(1, 1, 0.01));
  const position = new Vec3(0, 0, 0.01);
  const body = new Body({ mass: 1, shape, position, velocity: new Vec3(speed, 0, 0), linearDamping: 0 });
  world.addBody(body);
  return { world, body, friction: world.defaultContactMaterial.friction };
}

for (const rate of [60, 240, 1000]) {
  const { world, body, friction } = block(undefined, 3);
  let steps = 0;
  for (; body.velocity.x > 0.01 && steps < 10 * rate; steps++) world.step(1 / rate);
  const push = block(undefined, 0);
  for (let step = 0; step < rate; step++) {
    push.body.applyForce(new Vec3(100, 0, 0));
    push.world.step(1 / rate);
  }
  const way = (body.position.x * 1000).toPrecision(2);
  console.log(`${rate} steps/s, friction ${friction}: stops after ${steps} steps and ${way} mm;`,
    `pushed by 100 N for 1 s: ${push.body.velocity.x.toFixed(2)} m/s`);
}
END
node run.mjs | tee seen
diff - seen <<'END'
60 steps/s, friction 0.3: stops after 3 steps and 4.2 mm; pushed by 100 N for 1 s: 0.00 m/s
240 steps/s, friction 0.3: stops after 3 steps and 1.0 mm; pushed by 100 N for 1 s: 0.00 m/s
1000 steps/s, friction 0.3: stops after 3 steps and 0.26 mm; pushed by 100 N for 1 s: 0.00 m/s
END
