"""Grade one case of an exam: the hidden effects, the answer, and the causes of errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pneucli.exam.conditions import USUAL, WIDE

PARAMETER_TOLERANCE = 0.15
HIGH_CONFIDENCE = 0.9
SUBSYSTEMS_OF_PART = {"force": ("mechanics",), "flow": ("gas",), "sensor": ("gas", "mechanics", "the complete")}
SMALL_EFFECTS_LABEL = "several small ones"  # small disturbances in the truths of other rigs


@dataclass(frozen=True)
class GradedCase:
    """One case: the truth, and the answer (the object of ``diagnose --json``)."""

    case: str
    truth: dict[str, Any]
    answer: dict[str, Any]
    seconds: float | None = None

    @property
    def hidden(self) -> set[str]:
        """The true effects of the catalogue."""
        return set(self.truth["hidden"])

    @property
    def missing(self) -> set[str]:
        """The effects that the answer names."""
        return set(self.answer["missing"])

    @property
    def verdict(self) -> str:
        """The verdict of the answer."""
        return str(self.answer["verdict"])

    @property
    def uncatalogued_effect(self) -> str:
        """The large disturbance outside the catalogue; "" where there is none."""
        outside = self.truth["outside_the_catalogue"] or ""
        return "" if outside == SMALL_EFFECTS_LABEL else outside

    @property
    def has_small_effects(self) -> bool:
        """Whether small disturbances act as well."""
        return bool(self.truth.get("mess")) or self.truth["outside_the_catalogue"] == SMALL_EFFECTS_LABEL

    @property
    def is_null(self) -> bool:
        """Whether the rig is healthy: no effect to be named, no large disturbance to be flagged."""
        return not self.hidden and not self.uncatalogued_effect

    @property
    def conditions(self) -> list[str]:
        """The groups to which the case belongs: its combined condition, and each single one."""
        names = list(self.truth.get("conditions", ["messy" if self.has_small_effects else USUAL]))
        together = WIDE if WIDE in names else "+".join(names)
        return list(dict.fromkeys([together, *names]))

    @property
    def candidates(self) -> dict[str, dict[str, Any]]:
        """The candidates that the answer names, by effect."""
        return {c["effect"]: c for c in self.answer.get("candidates", []) if c["effect"] in self.missing}

    @property
    def answer_set(self) -> set[str]:
        """All effects in the answer: named, or indistinguishable from a named one."""
        return self.missing.union(*(c.get("indistinguishable_from", []) for c in self.candidates.values()))

    @property
    def set_sizes(self) -> list[int]:
        """For each named effect: the number of effects that are indistinguishable from it, including itself."""
        return [1 + len(c.get("indistinguishable_from", [])) for c in self.candidates.values()]

    @property
    def verdict_is_correct(self) -> bool:
        """Whether the verdict is the true one; ``unexplained`` is also correct where small disturbances act."""
        allowed = self.truth.get("unexplained_is_right", self.has_small_effects)
        if self.is_null or self.hidden:
            expected = "missing-effect" if self.hidden else "adequate"
            return self.verdict == expected or (self.verdict == "unexplained" and allowed)
        return self.verdict == "unexplained" and self.is_located

    @property
    def is_located(self) -> bool:
        """Whether the answer states the subsystem of the disturbance and the signal of which it is a function."""
        about = self.answer.get("unexplained") or {}
        if not self.truth.get("part"):
            return True  # the truth does not state the location
        signals = {about.get("variable"), *(d["over"] for d in self.answer.get("discrepancy", []))}
        return any(str(about.get("subsystem")).startswith(s) for s in SUBSYSTEMS_OF_PART[self.truth["part"]]) and (
            self.truth["over"] in signals
        )

    @property
    def is_correct_null(self) -> bool:
        """Whether the answer to a healthy rig names nothing and flags nothing."""
        return self.verdict_is_correct and not self.missing

    @property
    def truth_label(self) -> str:
        """The row of the confusion matrix."""
        return self.uncatalogued_effect or " + ".join(sorted(self.hidden)) or "none"

    @property
    def answer_label(self) -> str:
        """The column of the confusion matrix."""
        names = " + ".join(sorted(self.missing))
        return f"{names} (unexplained)" if names and self.verdict == "unexplained" else names or self.verdict

    @property
    def parameters_within_tolerance(self) -> list[bool]:
        """For each parameter of a true effect that was named: whether it is within 15 % of the truth.

        Of a truth of 0, which has no per cent: whether the interval holds it.
        """
        return [
            abs(found["value"] - true) <= PARAMETER_TOLERANCE * abs(true) if true else _holds_zero(found)
            for found, true in self._parameters()
        ]

    @property
    def intervals_cover_truth(self) -> list[bool]:
        """For each of these with an interval: whether it contains the truth."""
        return [low <= true <= high for (low, high), true in _intervals(self._parameters())]

    @property
    def stated_within_tolerance(self) -> list[bool]:
        """For each parameter of an effect in the pipeline file: whether it is within 15 % of the truth.

        Of healthy rigs: where an effect is hidden, the model of the pipeline file lacks it.
        """
        return [abs(found["value"] - true) <= PARAMETER_TOLERANCE * abs(true) for found, true in self._stated()]

    @property
    def stated_intervals_cover_truth(self) -> list[bool]:
        """For each of these with an interval: whether it contains the truth."""
        return [low <= true <= high for (low, high), true in _intervals(self._stated())]

    def _stated(self) -> list[tuple[dict[str, Any], float]]:
        found = self.answer.get("parameters", {}) if self.is_null else {}
        names = {
            f"{effect}.{name}": value
            for effect, values in self.truth.get("baseline_parameters", {}).items()
            for name, value in values.items()
        }
        return [(found[name], value) for name, value in names.items() if name in found]

    @property
    def is_source_recognised(self) -> bool:
        """Whether the answer states that the command sets no area."""
        return self.answer.get("command_sets_area") is False

    def _parameters(self) -> list[tuple[dict[str, Any], float]]:
        return [
            (self.candidates[effect]["parameters"][name], value)
            for effect in sorted(self.hidden & set(self.candidates))
            for name, value in self.truth["hidden"][effect].items()
            if name in self.candidates[effect]["parameters"]
        ]

    @property
    def confident_namings(self) -> list[bool]:
        """For each effect named with a confidence of 0.9 or more: whether it, or an indistinguishable one, is true."""
        return [bool(self.hidden & names) for names in self._confident_sets]

    @property
    def stated_probabilities(self) -> list[tuple[float, bool]]:
        """The probability of each fitted effect, an indistinguishable set once, and whether one of the set is true."""
        alike = {other for c in self.candidates.values() for other in c.get("indistinguishable_from", [])}
        found = []
        for c in self.answer.get("candidates", []):
            if c.get("confidence") is None or not c.get("parameters") or c["effect"] in alike - self.missing:
                continue
            mine = {c["effect"], *(c["indistinguishable_from"] if c["effect"] in self.missing else [])}
            found.append((float(c["confidence"]), bool(self.hidden & mine)))
        return found

    @property
    def confident_detections(self) -> list[bool]:
        """For each true effect: whether it, or an indistinguishable one, was named with a confidence of 0.9 or more."""
        return [any(effect in names for names in self._confident_sets) for effect in sorted(self.hidden)]

    @property
    def _confident_sets(self) -> list[set[str]]:
        """Each effect named with a confidence of 0.9 or more, together with those indistinguishable from it."""
        confident = [c for c in self.candidates.values() if (c.get("confidence") or 0.0) >= HIGH_CONFIDENCE]
        return [{c["effect"], *c.get("indistinguishable_from", [])} for c in confident]

    @property
    def final_error(self) -> float | None:
        """Error of the last step of the selection path, in units of the noise floor."""
        if not self.answer.get("ladder"):
            return None
        step = self.answer["ladder"][-1]
        error = step["error_test"] if step["error_test"] is not None else step["error_train"]
        return None if error is None else float(error)

    @property
    def failure_cause(self) -> str | None:
        """The cause of a wrong answer, in few words; None where the answer is right."""
        if self.verdict == "no answer":
            return "no answer"
        if self.verdict == "failed":
            return f"failed: {str(self.answer.get('error', '')).partition(':')[0]}"
        if self.is_null:
            return self._false_alarm()
        return self._detection_failure() if self.hidden else self._disturbance_failure()

    def _false_alarm(self) -> str | None:
        if self.missing:
            return "healthy: an effect named"
        return None if self.verdict_is_correct else f"healthy: {self.verdict}"

    def _disturbance_failure(self) -> str | None:
        if self.missing:
            return "unknown: named as another" if self.verdict != "unexplained" else "unknown: another named as well"
        return None if self.verdict_is_correct else f"unknown: {self.verdict}"

    def _detection_failure(self) -> str | None:
        if not self.missing:
            return f"missed: {self.verdict}{self._reasons()}"
        if not self.hidden & self.answer_set:
            return f"missed: another named{self._reasons()}"
        if not self.hidden <= self.answer_set:
            return f"missed: one of two{self._reasons()}"
        if not self.hidden <= self.missing:
            return "its twin named"
        if self.hidden < self.missing:
            return "another named as well"
        return None if self.verdict_is_correct else f"named, but {self.verdict}"

    def _reasons(self) -> str:
        """The reasons that the answer states for rejecting the true effects."""
        everything = {c["effect"]: c for c in self.answer.get("candidates", [])}
        lost = sorted(self.hidden - self.answer_set)
        reasons = {str(everything[e]["reason"]) for e in lost if everything.get(e, {}).get("reason")}
        return f" ({', '.join(sorted(reasons))})" if reasons else ""


def _intervals(parameters: Sequence[tuple[Mapping[str, Any], float]]) -> list[tuple[tuple[float, float], float]]:
    """Return the interval and the truth of each parameter that has a closed interval."""
    pairs = [(found["ci95"], true) for found, true in parameters if found.get("ci95")]
    return [((low, high), true) for (low, high), true in pairs if None not in (low, high)]


def _holds_zero(found: Mapping[str, Any]) -> bool:
    """Whether the interval of a parameter holds 0."""
    low, high = found.get("ci95") or (None, None)
    return low is not None and high is not None and low <= 0.0 <= high
