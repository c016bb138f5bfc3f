#!/bin/sh
# matter-js 0.20.0 (npm): a body that is pushed all the time stays at one speed, as each has friction of the air unless told.
#
# A body of 1 kg without contact or gravity, pushed by a constant force. It should be twice as fast after twice the
# time; it never exceeds 16.7 px/s, where 200 are due after 20 s. `frictionAir`, 0.01 unless stated, takes 1 % of the
# speed in each sixtieth of a second, a time constant of 1.7 s: a viscous friction that identification finds, and nobody
# asked for. Friction with a wall acts besides. A force counts per square millisecond, so that 1e-5 is 10 px/s^2. State
# `frictionAir: 0`; speeds are then right, the way is 1.7 % too far after 1 s, as the first step counts whole.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . matter-js@0.20.0
cat >run.cjs <<'END'
const { Bodies, Body, Composite, Engine } = require("matter-js");

function pushed(options, until) {
  const engine = Engine.create({ gravity: { x: 0, y: 0 } });
  const body = Bodies.circle(0, 0, 10, options);
  Body.setMass(body, 1);
  Composite.add(engine.world, body);
  for (let step = 0; step < 60 * until; step++) {
    Body.applyForce(body, body.position, { x: 1e-5, y: 0 });
    Engine.update(engine, 1000 / 60);
  }
  return body;
}

for (const seconds of [1, 2, 5, 20]) {
  const [usual, free] = [pushed({}, seconds), pushed({ frictionAir: 0 }, seconds)];
  const speed = (body) => (body.velocity.x * 60).toFixed(1);
  console.log(`after ${seconds} s: ${speed(usual)} px/s, frictionAir 0: ${speed(free)}, due ${10 * seconds}.0`);
}
console.log("frictionAir of a new body:", pushed({}, 0).frictionAir);
console.log("way after 1 s, frictionAir 0:", pushed({ frictionAir: 0 }, 1).position.x.toFixed(2), "due 5.00");
END
node run.cjs | tee seen
diff - seen <<'END'
after 1 s: 7.5 px/s, frictionAir 0: 10.0, due 10.0
after 2 s: 11.7 px/s, frictionAir 0: 20.0, due 20.0
after 5 s: 15.8 px/s, frictionAir 0: 50.0, due 50.0
after 20 s: 16.7 px/s, frictionAir 0: 200.0, due 200.0
frictionAir of a new body: 0.01
way after 1 s, frictionAir 0: 5.08 due 5.00
END
