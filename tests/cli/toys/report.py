from pneucli.pipeline.graph import Context


def run(context: Context) -> dict[str, object]:
    (context.out / "report.html").write_text("<p>all is well</p>")
    checks = [{"path": path, "passed": True} for path in context.config.checks]
    about = {"files": ["report.html"], "bytes": 18, "checks": checks}
    return {"schema": "toy/report/1", "stages": sorted(context.answers), **about}
