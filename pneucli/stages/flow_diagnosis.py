"""Diagnosis of a steady bench: which of the catalogue's effects its rows show, and what they say beyond these."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pneucli.compare import overall_error
from pneucli.diagnose.free_run_error import held_out_error, remaining_error_share, removed_error_share
from pneucli.errors import InputError
from pneucli.figure import Figure, read, to_answer
from pneucli.identify.valve.flow_bench import (
    FlowBench,
    FlowHypothesis,
    closed_paths,
    compare_flow,
    fit_hypothesis,
    leak_area,
)
from pneucli.identify.valve.flow_findings import AREA_FINDINGS, bench_findings
from pneucli.identify.valve.iso6358 import ELLIPSE_SUBSONIC_INDEX
from pneucli.identify.valve.steady_flow import MIN_GAIN
from pneucli.messages.compare import GOOD_ERROR_RATIO
from pneucli.messages.diagnose import Answer, CandidateAnswer, GivenModel, Step, impossible_data_sentence
from pneucli.messages.findings import tell
from pneucli.messages.flow import (
    effect_reason,
    flow_verdict,
    next_rows,
    other_characteristics,
    other_shape,
    undetermined_sentence,
)
from pneucli.messages.formatting import format_parameters
from pneucli.messages.ingest import implausibility_sentences
from pneucli.physics.declaration import Effect
from pneucli.stages import history
from pneucli.stages.answer_parts import purpose_of
from pneucli.stages.diagnosis_answer import SHAPE_FILE, write_flow_diagnosis
from pneucli.stages.flow_bench import LEAK_PORT, RATIO_PORT, flow_bench, flow_results
from pneucli.stages.pipeline_data import PipelineData

MAX_ISO_SHARE = 0.9  # of the error with one critical ratio for all openings, that C, b and m of each leave


def diagnose_flow_only(study: PipelineData) -> dict[str, Any]:
    """Diagnose a pipeline that records steady benches alone; write the tables, return the answer of ``diagnose``.

    Raises InputError where no row can be fitted, or an option needs a recording over time.
    """
    context = study.context
    if context.options.get("since"):
        wanted = "recordings over time, whose model a baseline keeps"
        mend = "compare the parameters of both identify answers"
        raise InputError("--since", "rows of a steady bench alone", wanted, mend, code="E071")
    found = flow_diagnosis(study)
    assert found is not None
    write_flow_diagnosis(study, found)
    answer = to_answer(found)
    return answer | history.record_model(context, answer, SHAPE_FILE)


def flow_diagnosis(study: PipelineData) -> Answer | None:
    """Return the diagnosis of the steady benches of a pipeline; None where it records none."""
    bench = flow_bench(study)
    if bench is None:
        return None
    search = _Search(study, bench)
    return search.answer()


class _Search:
    """Adds the effects that a bench can show, the most significant one first."""

    def __init__(self, study: PipelineData, bench: FlowBench) -> None:
        self._study, self._bench = study, bench
        self._present = {effect.name for effect in study.effects}
        settled = self._present.union(study.excluded_effects)
        self._absent = [e for name, e in study.available_effects.items() if name not in settled]
        can = {RATIO_PORT: any(p.b.determined for p in bench.paths), LEAK_PORT: bool(closed_paths(bench))}
        self._shown = {port for port, shows in can.items() if shows}
        available = study.available_effects.values()
        self._by_port = {port: next((effect for effect in available if port in effect.ports), None) for port in can}
        open_effects = [self._by_port[port] for port in can if port in self._shown]
        self._open = [e.name for e in open_effects if e is not None and e.name not in settled]
        self._noise = {one.recording.name: one.noise for one in compare_flow(bench, study.flow_recordings)}
        self._rows = sum(path.rows.flow.size for path in bench.paths)
        self.added: list[str] = []
        self.path = [self._fit(self._present)]
        self._tried: dict[str, tuple[FlowHypothesis, FlowHypothesis]] = {}
        self._run()

    def _fit(self, effects: Sequence[str] | set[str]) -> FlowHypothesis:
        has = {port for port, effect in self._by_port.items() if effect is not None and effect.name in effects}
        return fit_hypothesis(self._bench, free_ratio=RATIO_PORT in has, leak=LEAK_PORT in has)

    def _run(self) -> None:
        while True:
            now, best, most = self.path[-1], None, MIN_GAIN
            for name in [n for n in self._open if n not in self.added]:
                other = self._fit({*self._present, *self.added, name})
                self._tried[name] = (now, other)
                scale = max(other.cost / max(self._rows - other.free, 1), 1e-300)
                if (gain := (now.cost - other.cost) / scale) > most:
                    best, most = name, gain
            if best is None:
                return
            self.added.append(best)
            self.path.append(self._tried[best][1])

    def errors(self, model: FlowHypothesis | None) -> dict[str, float | None]:
        """Return the error of a model over noise by use; None: of C, b and m of each command."""
        results = self._results(model)
        return {use: overall_error(results, use) for use in ("train", "test")}

    def _results(self, model: FlowHypothesis | None) -> Any:
        bench = self._bench if model is None else model.bench(self._bench)
        results = flow_results(compare_flow(bench, self._study.flow_recordings))
        return [
            replace(r, noise=self._noise[r.recording], ratio_to_noise=r.rmsd / self._noise[r.recording])
            for r in results
        ]

    def answer(self) -> Answer:
        """Return the answer of ``diagnose`` for the benches."""
        study, context = self._study, self._study.context
        forced = bool(context.options.get("force", False))
        impossible = [] if forced else self._impossible()
        errors = [self.errors(model) for model in self.path]
        missing = [] if impossible else list(self.added)
        left = self._left(errors[-1])
        known = bool(self._shown)
        verdict = self._verdict(missing, left, impossible=bool(impossible), known=known)
        named = " and ".join(f"{n} ({format_parameters(self._parameters(n))})" for n in missing)
        beyond = "" if left else self._beyond(errors[-1])
        sentence = flow_verdict(held_out_error(errors[0]), held_out_error(errors[-1]), named, left, beyond)
        if impossible:
            sentence = impossible_data_sentence(impossible)
        elif verdict == "inconclusive":
            sentence = undetermined_sentence()
        ladder = [Step(add, e["train"], e["test"]) for add, e in zip([None, *self.added], errors, strict=True)]
        shown = self.path[-1] if missing else self.path[0]
        held_out = any(one.use == "test" for one in study.flow_recordings)
        return replace(
            read(Answer, {}),  # what rows of a bench do not show is empty
            schema="pneucli/diagnose/1",
            pipeline=context.config.name,
            model=GivenModel([e.name for e in study.effects]),
            data=study.data_digest,
            held_out="apart" if held_out else "none",
            excluded=study.excluded_effects,
            forced=forced,
            impossible=impossible,
            verdict=verdict,
            missing=missing,
            ladder=ladder if not impossible else ladder[:1],
            candidates=[self._candidate(e, missing) for e in self._absent],
            unexplained_share=remaining_error_share(errors[0], errors[-1]),
            explained_share=removed_error_share(errors[0], errors[-1]),
            purpose=purpose_of(self._results(shown), context.config.compare.tolerance),
            next_experiment=next_rows(
                ratio=RATIO_PORT not in self._shown, closed=LEAK_PORT not in self._shown and not known
            ),
            warnings=[tell("flow-function-of-simulations"), *([] if held_out else [tell("no-held-out")])],
            sentence=sentence,
            plausibility=study.ingested.plausibility,
            contradicted=study.contradicted,
            parameters={},
        )

    def _impossible(self) -> list[str]:
        names = {one.name for one in self._study.flow_recordings}
        return implausibility_sentences([one for one in self._study.impossible if one.recording in names])

    def _verdict(self, missing: Sequence[str], left: str, *, impossible: bool, known: bool) -> str:
        if impossible or not (known or left):
            return "inconclusive"
        return "unexplained" if left else "missing-effect" if missing else "adequate"

    def _left(self, last: dict[str, float | None]) -> str:
        """Return what the rows say that no effect of the catalogue explains; empty where nothing is left."""
        findings = list(bench_findings(self._bench))
        for one in findings:
            if one.code in AREA_FINDINGS or one.code == "curve-not-followed":
                return one.text
        error = held_out_error(last)
        if error is None or error <= GOOD_ERROR_RATIO:
            return ""
        if findings:
            return findings[0].text
        best = held_out_error(self.errors(None))
        within = best is not None and best <= max(GOOD_ERROR_RATIO, MAX_ISO_SHARE * error)
        return "" if within else other_shape(best)

    def _beyond(self, last: dict[str, float | None]) -> str:
        """Return how C, b and m of each opening describe what one critical ratio does not; empty where that does."""
        error, best = held_out_error(last), held_out_error(self.errors(None))
        if error is None or best is None or error <= GOOD_ERROR_RATIO or best > MAX_ISO_SHARE * error:
            return ""
        worst = max(
            self._bench.paths, key=lambda p: abs(p.m.value - ELLIPSE_SUBSONIC_INDEX) if p.m.determined else 0.0
        ).m
        return other_characteristics((worst.value, worst.low, worst.high), best)

    def _parameters(self, name: str) -> dict[str, Figure]:
        effect = self._study.available_effects[name]
        value, (low, high) = self._ratio() if RATIO_PORT in effect.ports else self._leak()
        (parameter, *_) = effect.parameters
        return {parameter.name: Figure(value, low, high, parameter.unit)}

    def _ratio(self) -> tuple[float, tuple[float, float]]:
        model = next(one for one in reversed(self.path) if one.ratio_interval is not None)
        assert model.ratio_interval is not None
        return model.critical_ratio, model.ratio_interval

    def _leak(self) -> tuple[float, tuple[float, float]]:
        value, low, high = (float(one) for one in leak_area(self._bench))
        return value, (low, high)

    def _candidate(self, effect: Effect, missing: Sequence[str]) -> CandidateAnswer:
        name, tried = effect.name, self._tried.get(effect.name)
        named = name in missing
        before, after = (None, None) if tried is None else (held_out_error(self.errors(one)) for one in tried)
        first = held_out_error(self.errors(self.path[0]))
        why = f"{effect.title}. A steady bench cannot show it." if tried is None else None
        return replace(
            read(CandidateAnswer, {}),  # no probability: no exam has such rows
            effect=name,
            title=effect.title,
            error_before=first if tried is None else before,
            error_after=first if tried is None else after,
            parameters=self._parameters(name) if named else {},
            supported=named,
            reason="supported" if named else "cannot-show" if tried is None else "not-significant",
            why=why or effect_reason(effect.title, named=named, before=before, after=after),
        )
