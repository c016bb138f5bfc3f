"""An example of each command, for the end of its ``--help``."""

from __future__ import annotations

_EXAMPLES = {
    "init": "pneucli init axis-7 --from recordings/*.csv",
    "ingest": "pneucli ingest axis-7/pipeline.toml",
    "identify": "pneucli identify axis-7/pipeline.toml",
    "compare": "pneucli compare axis-7/pipeline.toml -v",
    "diagnose": "pneucli diagnose axis-7/pipeline.toml --exclude extra-mass",
    "plan": "pneucli plan axis-7/pipeline.toml --minutes 1",
    "design": "pneucli design axis-7/pipeline.toml --compare pid,relay,best",
    "simulate": "pneucli simulate axis-7/pipeline.toml -v",
    "report": "pneucli report axis-7/pipeline.toml",
    "export": "pneucli export axis-7/pipeline.toml --to c --to mat",
    "add": "pneucli add axis-7/pipeline.toml --suggested",
    "remove": "pneucli remove axis-7/pipeline.toml stribeck",
    "history": "pneucli history axis-7/pipeline.toml",
    "diff": "pneucli diff axis-7/pipeline.toml axis-8/pipeline.toml",
    "plot": "pneucli plot axis-7/pipeline.toml stickslip_2 --channel x --save stickslip_2.svg",
    "run": "pneucli run axis-7/pipeline.toml",
    "open": "pneucli open axis-7/pipeline.toml",
    "check": "pneucli check axis-7/pipeline.toml",
    "status": "pneucli status axis-7/pipeline.toml",
    "effects": "pneucli effects friction-hysteresis",
    "schema": "pneucli schema > axis-7/pipeline.schema.json",
    "explain": "pneucli explain E042",
    "fleet": "pneucli fleet plant-3/fleet.toml --executor dask://scheduler:8786",
    "exam": "pneucli exam my-exam --cases 12 --nulls 4 --answer --grade",
}


def example_line(command: str) -> str:
    """Return the last lines of a command's help."""
    return f"Example: {_EXAMPLES[command]}"
