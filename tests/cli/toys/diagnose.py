from pneucli.pipeline.context import Context


def run(context: Context) -> dict[str, object]:
    return {"schema": "toy/diagnose/1", "excluded": context.options.get("exclude", [])}
