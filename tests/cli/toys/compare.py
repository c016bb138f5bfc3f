from pneucli.pipeline.graph import Context
from pneucli.stages import history


def run(context: Context) -> dict[str, object]:
    effects = list(context.answers["identify"]["effects"])
    error = 3.0 - len(effects)
    (context.out / "residuals.parquet").write_text(" ".join(effects))
    channel = {"recording": "step", "use": "test", "channel": "p1", "unit": "Pa", "rmsd": 400 * error, "percent": 1.0}
    answer = {
        "schema": "toy/compare/1",
        "pipeline": context.config.name,
        "model": {"effects": effects, "parameters": {}},
        "channels": [{**channel, "ratio_to_noise": error}],
        "error": {"train": None, "test": error},
        "where": [],
        "data": f"horizon {context.config.compare.horizon or 0.5:g}",
    }
    return answer | history.record_model(context, answer, "residuals.parquet")
