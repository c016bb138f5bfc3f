from pneucli.pipeline.context import Context


def run(context: Context) -> dict[str, object]:
    for percent in range(101):
        context.progress("reading", percent / 100)
    return {"schema": "toy/ingest/1", "pipeline": context.config.name}


def describe(answer: dict[str, object]) -> str:
    return "one recording"
