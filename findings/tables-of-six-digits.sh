#!/bin/sh
# tabulate 0.10.0: a log written as TSV has six digits, so that all its stamps are 1.76732e+09.
#
# `tabulate(rows, tablefmt="tsv")` writes each number with `%g`: seconds since 1970 are the same for ten thousand
# seconds, 1 234 567.8 Pa is 1.23457e+06, 601325.25 Pa has lost its decimals, and the text "007" is 7. pandas'
# `to_markdown`, made by it, does the same. texttable keeps three decimals: 0.00012 kg/s is 0.000. prettytable keeps
# all. Nothing warns. State `floatfmt=".17g"`, or write CSV by the csv module.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile tabulate==0.10.0 pandas==3.1.1 numpy==2.4.6 texttable==1.7.2 prettytable==3.18.0
v/bin/python -W ignore - <<'END' | tee seen
import pandas as pd
from prettytable import PrettyTable
from tabulate import tabulate
from texttable import Texttable

names = ["t", "p1", "q"]
rows = [[1767323045.0005, 601325.25, 0.00012], [1767323045.001, 1234567.8, 0.00013]]
print("tabulate:", tabulate(rows, names, tablefmt="tsv").split())
print('tabulate, floatfmt=".17g":', tabulate(rows, names, tablefmt="tsv", floatfmt=".17g").split()[3:])
print("to_markdown:", pd.DataFrame(rows, columns=names).to_markdown(index=False).replace("|", " ").split()[:3], end=" ")
print(pd.DataFrame(rows, columns=names).to_markdown(index=False).replace("|", " ").split()[-6:])
plain = Texttable(0)
plain.set_deco(0)
plain.add_rows([names, *rows])
print("texttable:", plain.draw().split()[3:])
pretty = PrettyTable(names)
pretty.add_rows(rows)
print("prettytable:", pretty.get_csv_string().split()[1:])
END
diff - seen <<'END'
tabulate: ['t', 'p1', 'q', '1.76732e+09', '601325', '0.00012', '1.76732e+09', '1.23457e+06', '0.00013']
tabulate, floatfmt=".17g": ['1767323045.0005', '601325.25', '0.00012', '1767323045.0009999', '1234567.8', '0.00012999999999999999']
to_markdown: ['t', 'p1', 'q'] ['1.76732e+09', '601325', '0.00012', '1.76732e+09', '1.23457e+06', '0.00013']
texttable: ['1.767e+09', '601325.250', '0.000', '1.767e+09', '1234567.800', '0.000']
prettytable: ['1767323045.0005,601325.25,0.00012', '1767323045.001,1234567.8,0.00013']
END
