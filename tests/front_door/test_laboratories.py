"""A hundred recordings as other laboratories write them: each read right, marked, told or refused; none in silence."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from .judge import judge
from .laboratory import sheet, write

GROUPS, EACH = 10, 10


@pytest.mark.parametrize("group", range(GROUPS))
def test_no_recording_is_read_wrong_in_silence(group: int, tmp_path: Path) -> None:
    verdicts: Counter[str] = Counter()
    for number in range(EACH):
        rng = np.random.default_rng([47, group, number])
        found = sheet(rng)
        folder = tmp_path / str(number)
        folder.mkdir()
        path = write(found, folder, rng)
        outcome = judge(path, folder, found.base)
        verdicts[outcome.verdict] += 1
        assert outcome.verdict != "wrong in silence", f"{found.kinds}: {outcome.verdicts}\n{outcome.why}"
    assert verdicts["right"] + verdicts["marked"] + verdicts["told"] >= 0.8 * EACH, dict(verdicts)
