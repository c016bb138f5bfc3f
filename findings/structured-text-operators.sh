#!/bin/sh
# blark 0.8.3 and tree-sitter-iec61131-3-st 0.1.2: operators and comments of IEC 61131-3 that the two read differently.
#
# The power operator and the sign & are refused by blark, which knows EXPT and AND alone. tree-sitter reads a ** b ** c from
# right to left (2 ** 3 ** 2 is 512), where the standard evaluates operators of equal rank from left to right (64), and
# binds a leading minus before the power, as the standard does (-2 ** 2 is 4, which is -4 in Python). Nested comments are
# read by blark alone. Names such as BY and DO are refused by blark alone; the rank of comparisons is the standard's in both.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile blark==0.8.3 tree-sitter==0.26.1 tree-sitter-iec61131-3-st==0.1.2
v/bin/python -W ignore - <<'END' | tee seen
import tree_sitter
import tree_sitter_iec61131_3_st
from blark.parse import parse_source_code

parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_iec61131_3_st.language()))


def by_blark(node):
    if hasattr(node, "left"):
        return f"({by_blark(node.left)} {node.op} {by_blark(node.right)})"
    return f"({node.op} {by_blark(node.expr)})" if hasattr(node, "expr") else str(node)


def by_tree(node):
    if node.child_count < 2:
        return by_tree(node.children[0]) if node.child_count else node.text.decode()
    return "(" + " ".join(map(by_tree, node.children)) + ")"


def show(expression, name="a"):
    source = f"FUNCTION_BLOCK F\nVAR\n{name}, b, c, x : LREAL;\nEND_VAR\nx := {expression};\nEND_FUNCTION_BLOCK\n"
    try:
        block = parse_source_code(source).transform().items[0]
        first = by_blark(block.body.statements[0].expression)
    except Exception:
        first = "refused"
    root = parser.parse(source.encode()).root_node
    waiting = [root]
    while waiting and waiting[0].type not in ("assignment", "assignment_statement"):
        waiting = waiting[1:] + waiting[0].children
    second = "refused" if root.has_error else by_tree(waiting[0]).removeprefix("(x := ").removesuffix(" ;)")
    print(f"{expression:20s} blark {first} | tree-sitter {second}")


for expression in ("a ** b ** c", "-a ** b", "a & b", "a = b < c", "a (* 1 (* 2 *) *)"):
    show(expression)
show("by + b", name="by")
END
diff - seen <<'END'
a ** b ** c          blark refused | tree-sitter (a ** (b ** c))
-a ** b              blark refused | tree-sitter ((- a) ** b)
a & b                blark refused | tree-sitter (a & b)
a = b < c            blark (a = (b < c)) | tree-sitter (a = (b < c))
a (* 1 (* 2 *) *)    blark a | tree-sitter refused
by + b               blark refused | tree-sitter (by + b)
END
