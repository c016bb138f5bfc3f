"""One case of an exam: what was hidden, what was answered, what is right about it and why the rest is not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pneucli.exam.conditions import USUAL, WIDE

PARAMETER_TOLERANCE = 0.15
HIGH_CONFIDENCE = 0.9
SUBSYSTEMS_OF_PART = {"force": ("mechanics",), "flow": ("gas",), "sensor": ("gas", "mechanics", "the whole")}
SMALL_EFFECTS_LABEL = "several small ones"  # what truths of other rigs say of small unknown effects


@dataclass(frozen=True)
class GradedCase:
    """One case: what was hidden, and what was answered (the object of ``diagnose --json``)."""

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
        """The large effect that no catalogue names; "" where there is none."""
        outside = self.truth["outside_the_catalogue"] or ""
        return "" if outside == SMALL_EFFECTS_LABEL else outside

    @property
    def has_small_effects(self) -> bool:
        """Whether small unknown effects act besides."""
        return bool(self.truth.get("mess")) or self.truth["outside_the_catalogue"] == SMALL_EFFECTS_LABEL

    @property
    def is_null(self) -> bool:
        """Whether nothing is to be named, and nothing large to be flagged."""
        return not self.hidden and not self.uncatalogued_effect

    @property
    def conditions(self) -> list[str]:
        """The groups to which the case belongs: its conditions together, and each of them alone."""
        names = list(self.truth.get("conditions", ["messy" if self.has_small_effects else USUAL]))
        together = WIDE if WIDE in names else "+".join(names)
        return list(dict.fromkeys([together, *names]))

    @property
    def candidates(self) -> dict[str, dict[str, Any]]:
        """The candidates that the answer names, by effect."""
        return {c["effect"]: c for c in self.answer.get("candidates", []) if c["effect"] in self.missing}

    @property
    def answer_set(self) -> set[str]:
        """All effects in the answer: named, or stated not to be told apart from a named one."""
        return self.missing.union(*(c.get("indistinguishable_from", []) for c in self.candidates.values()))

    @property
    def set_sizes(self) -> list[int]:
        """Of each named effect: how many it cannot be told from, itself included."""
        return [1 + len(c.get("indistinguishable_from", [])) for c in self.candidates.values()]

    @property
    def verdict_is_correct(self) -> bool:
        """Whether the verdict is the true one; ``unexplained`` is, too, where something unknown acts besides."""
        allowed = self.truth.get("unexplained_is_right", self.has_small_effects)
        if self.is_null or self.hidden:
            expected = "missing-effect" if self.hidden else "adequate"
            return self.verdict == expected or (self.verdict == "unexplained" and allowed)
        return self.verdict == "unexplained" and self.is_located

    @property
    def is_located(self) -> bool:
        """Whether what is said of the unknown names its subsystem and the signal of which it is a function."""
        about = self.answer.get("unexplained") or {}
        if not self.truth.get("part"):
            return True  # a truth that does not say where it is
        told = {about.get("variable"), *(d["over"] for d in self.answer.get("discrepancy", []))}
        return any(str(about.get("subsystem")).startswith(s) for s in SUBSYSTEMS_OF_PART[self.truth["part"]]) and (
            self.truth["over"] in told
        )

    @property
    def is_correct_null(self) -> bool:
        """Of a null: whether nothing was named and nothing flagged that is not there."""
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
        """For every parameter of a true effect that was named: whether it is within 15 % of the truth."""
        return [abs(found["value"] - true) <= PARAMETER_TOLERANCE * abs(true) for found, true in self._parameters()]

    @property
    def intervals_cover_truth(self) -> list[bool]:
        """Of these, where an interval was given: whether it holds the truth."""
        pairs = [(found["ci95"], true) for found, true in self._parameters() if found.get("ci95")]
        return [low <= true <= high for (low, high), true in pairs if None not in (low, high)]

    def _parameters(self) -> list[tuple[dict[str, Any], float]]:
        return [
            (self.candidates[effect]["parameters"][name], value)
            for effect in self.hidden & set(self.candidates)
            for name, value in self.truth["hidden"][effect].items()
            if name in self.candidates[effect]["parameters"]
        ]

    @property
    def confident_namings(self) -> list[bool]:
        """Of each effect that was named with a confidence of 0.9 or more: whether it, or a twin, is true."""
        return [bool(self.hidden & said) for said in self._confident_sets]

    @property
    def stated_probabilities(self) -> list[tuple[float, bool]]:
        """The probability of each effect that was fitted, a set of twins once, and whether it or a twin is there."""
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
        """For each true effect: whether it, or a twin, was named with a confidence of 0.9 or more."""
        return [any(effect in said for said in self._confident_sets) for effect in sorted(self.hidden)]

    @property
    def _confident_sets(self) -> list[set[str]]:
        """Each effect that was named with a confidence of 0.9 or more, with what it is not told from."""
        sure = [c for c in self.candidates.values() if (c.get("confidence") or 0.0) >= HIGH_CONFIDENCE]
        return [{c["effect"], *c.get("indistinguishable_from", [])} for c in sure]

    @property
    def final_error(self) -> float | None:
        """Error of the last rung of the ladder, in units of the noise floor."""
        if not self.answer.get("ladder"):
            return None
        rung = self.answer["ladder"][-1]
        error = rung["error_test"] if rung["error_test"] is not None else rung["error_train"]
        return None if error is None else float(error)

    @property
    def failure_cause(self) -> str | None:
        """Why the answer is not right, in few words; None where it is."""
        if self.verdict == "no answer":
            return "no answer"
        if self.verdict == "failed":
            return f"failed: {str(self.answer.get('error', '')).partition(':')[0]}"
        if self.is_null:
            return self._false_alarm()
        return self._missed() if self.hidden else self._missed_uncatalogued()

    def _false_alarm(self) -> str | None:
        if self.missing:
            return "healthy: an effect named"
        return None if self.verdict_is_correct else f"healthy: {self.verdict}"

    def _missed_uncatalogued(self) -> str | None:
        if self.missing:
            return "unknown: named as another" if self.verdict != "unexplained" else "unknown: another named beside"
        return None if self.verdict_is_correct else f"unknown: {self.verdict}"

    def _missed(self) -> str | None:
        if not self.missing:
            return f"missed: {self.verdict}{self._reasons()}"
        if not self.hidden & self.answer_set:
            return f"missed: another named{self._reasons()}"
        if not self.hidden <= self.answer_set:
            return f"missed: one of two{self._reasons()}"
        if not self.hidden <= self.missing:
            return "its twin named"
        if self.hidden < self.missing:
            return "another named beside"
        return None if self.verdict_is_correct else f"named, but {self.verdict}"

    def _reasons(self) -> str:
        """What the answer says of the true effects that it does not name."""
        everything = {c["effect"]: c for c in self.answer.get("candidates", [])}
        lost = sorted(self.hidden - self.answer_set)
        said = {str(everything[e]["reason"]) for e in lost if everything.get(e, {}).get("reason")}
        return f" ({', '.join(sorted(said))})" if said else ""
