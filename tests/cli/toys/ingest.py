from pneucli.pipeline.graph import Context


def run(context: Context) -> dict[str, object]:
    for percent in range(101):
        context.progress("reading", percent / 100)
    step = {"name": "step", "experiment": "valve", "use": "test", "samples": 2, "signals": ["time", "p1"]}
    answer = {"schema": "toy/ingest/1", "pipeline": context.config.name, "recordings": [step]}
    return {**answer, "repairs": [], "warnings": []}
