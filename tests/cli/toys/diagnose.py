from pneucli.pipeline.graph import Context


def run(context: Context) -> dict[str, object]:
    missing = ["valve-leak"] if "valve-leak" not in context.config.model.effects else []
    rungs = [{"add": name, "error_train": None, "error_test": 2.0 - i} for i, name in enumerate([None, *missing])]
    area = {"area": {"value": 1e-8, "unit": "m^2", "ci95": [0.9e-8, 1.1e-8]}}
    leak = {"effect": "valve-leak", "title": "Leak in the valve", "parameters": area, "error_after": 1.0}
    return {
        "schema": "toy/diagnose/1",
        "excluded": context.options.get("exclude", []),
        "verdict": "missing-effect" if missing else "adequate",
        "missing": missing,
        "sentence": "The model lacks valve-leak." if missing else "Nothing is missing.",
        "ladder": rungs,
        "candidates": [{**leak, "indistinguishable_from": [], "why": "It explains the creep."}] if missing else [],
        "detectable": [],
        "next_experiment": None,
        "warnings": [],
    }
