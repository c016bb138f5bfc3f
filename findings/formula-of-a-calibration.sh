#!/bin/sh
# py_expression_eval 0.3.14, mathparse 0.2.9, simpleeval 1.0.8, asteval 1.0.10: 10-2^2 is 6, 6, 10 and 10.
#
# A calibration written as text in a configuration. In simpleeval and asteval ^ is Python's exclusive or of whole
# numbers, which also goes after minus: 10-2^2 is 8^2, 10; with a fraction both complain. A power of a power is taken
# from the left in py_expression_eval, from the right in mathparse, even for **. A minus before a power is squared in
# mathparse, 4, and not in the others. log is the natural one but in mathparse, where it is decimal. Write products and
# brackets, and try the formula at one known point.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile py_expression_eval==0.3.14 mathparse==0.2.9 simpleeval==1.0.8 asteval==1.0.10 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import io

from asteval import Interpreter
from mathparse import mathparse
from py_expression_eval import Parser
from simpleeval import simple_eval

packages = {
    "py_expression_eval": lambda text: Parser().parse(text).evaluate({}),
    "mathparse": mathparse.parse,
    "simpleeval": simple_eval,
    "asteval": lambda text: Interpreter(err_writer=io.StringIO()).eval(text, show_errors=False, raise_errors=True),
}


def said(ask, text):
    try:
        return f"{float(ask(text)):.4g}"
    except Exception:
        return "refused"


for text in ("10-2^2", "3-(-2)^2", "-2^2", "2^3^2", "2**3**2", "2^0.5", "log(100)", "8/4/2"):
    print(f"{text}:", ", ".join(f"{name} {said(ask, text)}" for name, ask in packages.items()))
END
diff - seen <<'END'
10-2^2: py_expression_eval 6, mathparse 6, simpleeval 10, asteval 10
3-(-2)^2: py_expression_eval -1, mathparse -1, simpleeval 7, asteval 7
-2^2: py_expression_eval -4, mathparse 4, simpleeval -4, asteval -4
2^3^2: py_expression_eval 64, mathparse 512, simpleeval 3, asteval 3
2**3**2: py_expression_eval 64, mathparse refused, simpleeval 512, asteval 512
2^0.5: py_expression_eval 1.414, mathparse 1.414, simpleeval refused, asteval refused
log(100): py_expression_eval 4.605, mathparse 2, simpleeval refused, asteval 4.605
8/4/2: py_expression_eval 1, mathparse 1, simpleeval 1, asteval 1
END
