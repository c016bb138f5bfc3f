from pneucli.errors import InputError
from pneucli.pipeline.graph import Context


def run(context: Context) -> dict[str, object]:
    effects = context.config.model.effects
    faults = {"time-skew": InputError("raw.csv, line 3", "no number"), "stribeck": KeyError("a bug"),
              "dead-volume": KeyboardInterrupt()}  # fmt: skip
    for effect in effects:
        if effect in faults:
            raise faults[effect]
    model = {"effects": effects, "parameters": {}}
    return {"schema": "toy/identify/1", "effects": effects, "model": model, "warnings": []}
